//! Willmore flow of phase fields by minimizing movements, with any step of mean curvature flow inside. A time step $`\tau`$ from $`u_k`$ minimizes
//!
//! ```math
//! e[u] = \varepsilon \int |u - u_k|^2 + \frac{\tau \varepsilon}{\tilde\tau^2} \int |v[u] - u|^2
//! ```
//!
//! with a step $`v[u]`$ of mean curvature flow of the size $`\tilde\tau`$ and interfaces of the width $`\varepsilon`$ (Franken, Rumpf and Wirth;
//! Rumpf, Sassen and Norden-Smoch).
//!
//! ```
//! use geometry::{Grid, exact::willmore_radius, measure::l2_distance, phase_field, shapes::Ball};
//! use model::{MeanCurvatureOperator, Shipped};
//! use operators::ComputeDevice;
//! use solver::{FlowParams, Problem, Stepper};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A disc of radius 0.2 grows under Willmore flow: R(t) = (r^4 + 2 t)^(1/4).
//! let device = ComputeDevice::default_compiled()?;
//! let grid = Grid::<2>::per_unit(128, 1.25)?;
//! let params = FlowParams::paper(2.0 * grid.spacing(), grid.spacing().powi(2));
//! let network = Shipped::Paper.find(params.ratios(&grid, 17))?;
//! let disc = |radius| phase_field(grid, &Ball::<2>::new([0.0, 0.0], radius)?, params.eps);
//!
//! let problem = Problem::new(MeanCurvatureOperator::new(&network, &device)?, &grid, params, &device)?;
//! let start = problem.start(&disc(0.2)?)?;
//! let mut flow = Stepper::new(problem, start);
//! let tau = params.mcf_step;
//! for _ in 0..2 {
//!     let step = flow.step(tau)?;
//!     println!("t = {:.2e}: w = {:.3}, {} products", step.time, step.willmore_energy, step.newton.hvp);
//!     assert!(step.energy < step.energy_before);
//! }
//! let exact = disc(willmore_radius(0.2, flow.state.time, 2))?;
//! assert!(l2_distance(&flow.field()?, &exact)? < 0.007);
//! # Ok(())
//! # }
//! ```
//!
//! [`MinimizingMovement`] is the energy of a step as a Burn graph. Burn's autodiff computes the gradient, and [`linearize`] differentiates
//! the gradient for Hessian-vector products. `docs/algorithm.md` explains the scheme, its calibration, the minimization
//! ([`NewtonVariant::Preconditioned`]), held perimeter and volume ([`Problem::hold`]), and further terms of the energy ([`EnergyTerm`],
//! [`Problem::set_energy`]).
//!
//! # Conventions
//!
//! [`geometry`] defines grids, norms and signs. Energies in [`StepRecord`] have the units of the formula above: squares are
//! integrated over the box, not summed over the nodes. Energies and gradients have the precision of the device, `f64` on CPUs. On a GPU in `f32`
//! the energy of a step has about seven digits. So a minimization can end with [`Exit::Precision`] before it reaches a tight tolerance. Errors
//! of the device and of the crates that this crate depends on pass through unchanged.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod bounds;
mod bricks;
mod cancel;
mod cg;
mod constraints;
mod displacement;
mod dissection;
mod domain;
mod energy;
mod error;
mod euler;
mod held;
mod interface;
mod mean_curvature_flow;
mod movement;
mod newton;
mod params;
mod preconditioner;
mod problem;
mod record;
mod region;
mod samples;
mod scheme;
mod second_order;
mod sparse;
mod start;
mod state;
mod stepper;
mod times;

pub use bounds::Bounds;
pub use bricks::REACH as BRICK_REACH;
pub use cancel::Cancel;
pub use constraints::Constraints;
pub use displacement::widths_between;
pub use domain::{Domain, DomainScales};
pub use energy::{
    EnergyTerm, EnergyTerms, Helfrich, MinimizingMovement, MovementGraph, Objective, Pressure,
    SpontaneousCurvature, Tension, TermCheck,
};
pub use error::{Error, rounded};
pub use euler::Euler;
pub use held::{Held, Target};
pub use mean_curvature::{
    Accuracy, Coarser, Factors, Identity, MeanCurvatureStep, PhaseInverse, PhaseInverses,
    StepFailure, StepScales,
};
pub use mean_curvature_flow::MeanCurvatureFlow;
pub use movement::{Minimizations, Minimum, Movement};
pub use newton::{Exit, NewtonInfo, minimize};
pub use operators::{extrapolate, retract};
pub use params::{FlowParams, NewtonParams, NewtonVariant, Precision};
pub use problem::Problem;
pub use record::{DirectRecord, Start, StartKind, StepRecord};
pub use scheme::{Candidate, Scheme, StepSize};
pub use second_order::{SecondOrder, StepEstimates};
pub use state::{DeviceField, Memory, State};
pub use stepper::Stepper;
pub use times::PhaseTimes;
