//! Willmore flow of phase fields by minimizing movements, with any step of mean curvature flow inside.
//!
//! ```
//! use geometry::{Grid, exact::willmore_radius, measure::l2_distance, phase_field, shapes::Ball};
//! use model::Shipped;
//! use operators::ComputeDevice;
//! use solver::{FlowParams, WillmoreFlow};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A disc of radius 0.2 grows under Willmore flow: R(t) = (r^4 + 2 t)^(1/4).
//! let device = ComputeDevice::default_compiled()?;
//! let grid = Grid::<2>::per_unit(128, 1.25)?;
//! let params = FlowParams::paper(2.0 * grid.spacing(), grid.spacing().powi(2));
//! let network = Shipped::Paper.find(params.ratios(&grid, 17))?;
//! let disc = |radius| phase_field(grid, &Ball::<2>::new([0.0, 0.0], radius)?, params.eps);
//!
//! let mut flow = WillmoreFlow::with_network(&network, &disc(0.2)?, params, &device)?;
//! let tau = params.mcf_step;
//! for _ in 0..2 {
//!     let step = flow.advance(tau)?;
//!     println!("t = {:.2e}: w = {:.3}, {} products", step.time, step.willmore_energy, step.newton.hvp);
//!     assert!(step.energy < step.energy_before);
//! }
//! let exact = disc(willmore_radius(0.2, flow.time(), 2))?;
//! assert!(l2_distance(&flow.field()?, &exact)? < 0.007);
//! # Ok(())
//! # }
//! ```
//!
//! [`MinimizingMovement`] is the energy of a step as a Burn graph: the gradient is Burn's autodiff, the Hessian-vector product its
//! linearization ([`linearize`]), forward over reverse. The scheme, its calibration, the minimization ([`Method::Preconditioned`]), the
//! constraints ([`WillmoreFlow::constrain`]) and the further terms of the energy ([`WillmoreFlow::set_energy`]) are explained in
//! `docs/algorithm.md`.
//!
//! # Conventions
//!
//! Grids, norms and signs are those of [`geometry`]. Energies in [`StepRecord`] are in the paper's units with true L2 norms.
//! Energies and gradients have the precision of the device, `f64` on CPUs. On a GPU in `f32` the energy of a step is known to about
//! seven digits, so that a minimization can end with [`Exit::Precision`] before a tight tolerance. Errors of the device and of the crates below
//! pass through as they are.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod active;
mod cg;
mod constraints;
mod displacement;
mod dissection;
mod energy;
mod error;
mod flow;
mod helfrich;
mod interface;
mod newton;
mod params;
mod preconditioner;
mod region;
mod samples;
mod sparse;
mod stored;
mod times;

pub use constraints::Constraints;
pub use displacement::widths_between;
pub use energy::{MinimizingMovement, Objective};
pub use error::Error;
pub use flow::{FlowState, Start, StartKind, StepEstimates, StepRecord, WillmoreFlow};
pub use helfrich::{Helfrich, HelfrichTerms};
pub use mean_curvature::{
    Accuracy, Factors, MeanCurvatureStep, PhaseInverse, PhaseInverses, StepFailure,
};
pub use newton::{Exit, NewtonInfo, minimize};
pub use operators::{extrapolate, retract};
pub use params::{FlowParams, Method, NewtonParams, Precision};
pub use times::PhaseTimes;
