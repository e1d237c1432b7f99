//! The loop over time steps of Willmore flow and mean curvature flow: it runs a case, and resumes it.
//!
//! ```
//! use engine::{Case, Formulation, Operator, Run, Scales, StepRule};
//! use geometry::{Grid, phase_field, shapes::Cuboid};
//! use model::Networks;
//! use operators::ComputeDevice;
//! use runs::Interrupt;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A square becomes round: the bending energy falls towards that of a circle, pi / R.
//! let grid = Grid::<2>::per_unit(64, 1.0)?;
//! let scales = Scales::of_grid(grid.spacing(), 2.0);
//! let network = Networks::default().find(Formulation::Accurate.shipped(), &scales.needs(2, grid.spacing()))?;
//! let square = phase_field(grid, &Cuboid::new([0.25; 2])?, scales.eps)?;
//! let operator = Operator::learned(Formulation::Accurate, network)?;
//! let steps = StepRule::ByEnergy(None);
//! let case = Case::willmore("square of side 1/2", square, operator, scales, steps, 4);
//! let mut run = Run::new(case, &ComputeDevice::default_compiled()?)?;
//! run.advance(None, &mut [], &Interrupt::never())?;
//! for record in run.records() {
//!     println!("t = {:.2e}: w = {:.1}", record.time, record.willmore_energy().unwrap());
//! }
//! # let energies: Vec<f64> = run.records().iter().filter_map(|r| r.willmore_energy()).collect();
//! # assert!(energies.len() == 4 && energies.windows(2).all(|w| w[1] < w[0]));
//! # Ok(())
//! # }
//! ```
//!
//! Your program needs an optimized profile: `cargo run --release`, or `opt-level = 3` under `[profile.dev]` and
//! `[profile.dev.package."*"]` in its `Cargo.toml`. It does not inherit the profile of this workspace. Without optimization each step takes many
//! times as long.
//!
//! A [`Case`] is everything that a result depends on: initial phase field, region, held perimeter and volume, operator, scales, time steps, stop
//! rules, measures. Only a [`Run`] computes a case, step by step ([`Run::step`]) or to its end ([`Run::advance`]). The solver knows nothing of
//! files, progress or shapes. [Observers](Observer) are called after each accepted step. A [`Store`] keeps a run on disk. One checkpoint holds
//! the phase fields and all records. A run that is resumed from it gives the same results, byte for byte, as a run without interruption.
//!
//! [`Run::step`] makes one step in three parts. A [`Controller`] gives the size. A [`Scheme`](solver::Scheme) makes a candidate. The controller
//! accepts the candidate, or asks for another one. Your own terms, schemes, controllers and stop rules go into [`Own`], an operator into
//! [`Operator::own`], a measure into [`Measure::new`]. An [`Observer`] sees the run.
//!
//! Errors of the crates that this crate depends on, such as [`Error::Runs`] and [`Error::Geometry`], pass through unchanged. If a function can
//! also refuse an input on its own, its documentation says so.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod case;
mod controller;
mod current;
mod edges;
mod error;
mod error_control;
mod flow;
mod measure;
mod observer;
mod operator;
mod own;
mod parts;
mod record;
mod run;
mod step_control;
mod stop;
mod storage;
mod store;
mod substeps;
mod time_steps;
mod trajectory;
mod until_stop;

pub use case::Case;
pub use controller::{Attempts, Controller, EqualSteps, Verdict};
pub use current::Current;
pub use direct::DirectParams;
pub use edges::round_edges;
pub use error::Error;
pub use error_control::ErrorControl;
pub use flow::Flow;
pub use measure::{DISPLACEMENT, Measure};
pub use observer::{Event, Observer, Samples};
pub use operator::{Discretization, Formulation, Method, Operator, Scales, quarter_square};
pub use own::{MakeController, MakeScheme, Own};
pub use record::{
    Record, Values, energy_increases, estimated_time_error, mean_hvp, minimizations, total_hvp,
};
pub use run::Run;
pub use solver::{DirectRecord, Held, Helfrich, Target};
pub use step_control::StepControl;
pub use stop::{Progress, Stop, StopRule, StopWhen};
pub use storage::Storage;
pub use store::{Checkpoints, METRICS, Store, TIMINGS, dimension, ended, initial, notes, records};
pub use time_steps::{Order, StepRule, TimeSteps};
pub use trajectory::Trajectory;
