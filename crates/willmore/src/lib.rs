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
//! [`Willmore`] has defaults for most flows. Each time step measures curvature by a short step of mean curvature flow, the inner step. By
//! default this is a learned operator. Its network is trained by the accurate recipe, the most accurate of the recipes. The time step is
//! calibrated: two factors of its energy correct an error of the operator (`docs/calibration.md`). The grid is divided into blocks, the bricks.
//! If the bricks near the surface are less than half of the grid, only they are stored. Time steps are of second order, and their estimated
//! errors limit their sizes. The methods of [`Willmore`] change these defaults.
//!
//! # Meshes, segmentations, drawings
//!
//! The commands of the program `willmore` are functions: [`fair`](jobs::fair), [`flow`](jobs::flow), [`inpaint`](jobs::inpaint),
//! [`surfaces_of_labels`](jobs::surfaces_of_labels), [`shared_labels`](jobs::shared_labels), [`sample`](jobs::sample), and
//! [`run_in_folder`](jobs::run_in_folder) for runs that are kept. They choose the grid, and report which parts of the shape it does not resolve.
//!
//! ```no_run
//! use willmore::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let smooth = fair(FairOptions::of("scan.obj"), &Silent)?;
//! println!("the noise was {:?}", smooth.summary.mesh.and_then(|mesh| mesh.noise));
//! # Ok(())
//! # }
//! ```
//!
//! # Parts of one's own
//!
//! | part | trait | example |
//! |---|---|---|
//! | a term of the energy | [`EnergyTerm`](solver::EnergyTerm) | `examples/own_energy.rs` |
//! | a step of mean curvature flow | [`MeanCurvatureStep`](mean_curvature::MeanCurvatureStep) | `examples/own_operator.rs` |
//! | a network | [`MeanCurvatureStep`](mean_curvature::MeanCurvatureStep) | `examples/own_network.rs` |
//! | a time scheme | [`Scheme`](solver::Scheme) | `examples/own_scheme.rs` |
//! | a controller of the time steps | [`Controller`](engine::Controller) | `examples/own_controller.rs` |
//! | a stop rule | [`StopRule`](engine::StopRule) | `examples/own_stop.rs` |
//! | a measure | [`Measure`](engine::Measure) | `examples/own_measure.rs` |
//! | a shape | [`SignedDistance`](geometry::SignedDistance) | `examples/own_shape.rs` |
//!
//! Each part is one file that imports the [`prelude`] and the tensor library Burn. `docs/extending.md` explains the parts. Flows with such parts
//! have the same features as all other flows: regions, held perimeter and volume, control of the steps, stop rules, measures, and checkpoints. A
//! run that is resumed from a checkpoint gives the same results, byte for byte, as a run without interruption.
//!
//! # The crates
//!
//! This crate re-exports the crates that it is made of:
//!
//! - [`geometry`]: grids, distances, phase fields,
//! - [`linearize`]: forward mode for Burn,
//! - [`operators`]: devices and periodic operations,
//! - [`mean_curvature`]: the trait of the inner step, its calibration,
//! - [`model`]: learned operators,
//! - [`fem`]: finite elements,
//! - [`solver`]: one time step by minimizations,
//! - [`direct`]: one time step by convolutions,
//! - [`engine`]: cases and the loop over steps,
//! - [`jobs`]: from files and options to results,
//! - [`surfaces`], [`volumes`]: meshes, segmentations,
//! - [`runs`]: run folders.
//!
//! Your program needs an optimized profile: `cargo run --release`, or `opt-level = 3` under `[profile.dev]` and
//! `[profile.dev.package."*"]` in its `Cargo.toml`. It does not inherit the profile of this workspace. Without optimization each step takes many
//! times as long.

mod builder;
pub mod prelude;

pub use builder::{Error, Kept, Willmore};
pub use {
    direct, engine, fem, geometry, jobs, linearize, mean_curvature, model, operators, runs, solver,
    surfaces, volumes,
};

/// The programs of these documents are compiled and run.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../../../README.md")]
    struct Readme;
    #[doc = include_str!("../../../docs/extending.md")]
    struct Extending;
}
