//! Willmore flow of curves and surfaces that are the zero sets of phase fields: the $`L^2`$ gradient flow of the bending energy
//!
//! ```math
//! w[\Gamma] = \frac{1}{2} \int_\Gamma \kappa^2 \, dA
//! ```
//!
//! with the sum of the principal curvatures $`\kappa`$.
//!
//! ```
//! use willmore::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A square of side 1/2 becomes round: its energy falls towards that of a circle, pi / R.
//! let grid = Grid::<2>::per_unit(64, 1.0)?;
//! let mut flow = Willmore::on(grid).start(&Cuboid::new([0.25; 2])?)?;
//! for record in flow.take(5) {
//!     let record = record?;
//!     println!("t = {:.1e}: w = {:.2}", record.time, record.willmore_energy().unwrap());
//! }
//! # let energies: Vec<f64> = flow.records().iter().filter_map(|r| r.willmore_energy()).collect();
//! # assert!(energies.len() == 5 && energies.windows(2).all(|w| w[1] < w[0]));
//! # Ok(())
//! # }
//! ```
//!
//! [`Willmore`] has the defaults that are good for most: the learned operator of the accurate recipe inside, calibrated; bricks near the
//! surface where they are less than half of the grid; steps of second order, as long as their errors allow. Everything else is a method of it.
//!
//! # Parts of one's own
//!
//! | part | trait | example |
//! |---|---|---|
//! | a term of the energy | [`EnergyTerm`](solver::EnergyTerm) | `examples/own_energy.rs` |
//! | a step of mean curvature flow | [`MeanCurvatureStep`](mean_curvature::MeanCurvatureStep) | `examples/own_operator.rs` |
//! | a network | [`MeanCurvatureStep`](mean_curvature::MeanCurvatureStep) | `examples/own_network.rs` |
//! | a time scheme | [`Scheme`](solver::Scheme) | `examples/own_scheme.rs` |
//! | what chooses the size of steps | [`Controller`](engine::Controller) | `examples/own_controller.rs` |
//! | a stop rule | [`StopRule`](engine::StopRule) | `examples/own_stop.rs` |
//! | a measure | [`Measure`](engine::Measure) | `examples/own_measure.rs` |
//! | a shape | [`SignedDistance`](geometry::SignedDistance) | `examples/own_shape.rs` |
//!
//! Each is one file that imports the [`prelude`] and Burn; `docs/extending.md` explains them. With all of them a flow has what the loop offers: regions, held
//! sizes, control of the steps, stop rules, measures, and checkpoints from which it goes on to the same bytes.
//!
//! # The crates
//!
//! This crate re-exports the ones it is made of: [`geometry`] (grids, distances, phase fields), [`linearize`] (forward mode for Burn), [`operators`] (devices and
//! periodic operations), [`mean_curvature`] (the trait of the step inside, its calibration), [`model`] (learned operators), [`fem`] (finite elements), [`solver`] (one
//! time step), [`engine`] (cases and the loop over steps), [`runs`] (run folders).
//!
//! A program of one's own needs an optimized profile, which is not inherited from here: `cargo run --release`, or `opt-level = 3` under
//! `[profile.dev]` and `[profile.dev.package."*"]` in its `Cargo.toml`. Without, each step takes many times as long.

mod builder;
pub mod prelude;

pub use builder::{Error, Kept, Willmore};
pub use {engine, fem, geometry, linearize, mean_curvature, model, operators, runs, solver};

/// The programs of these documents are compiled and run.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../../../README.md")]
    struct Readme;
    #[doc = include_str!("../../../docs/extending.md")]
    struct Extending;
}
