//! Willmore flow of phase fields by minimizing movements, with any step of mean curvature flow inside.
//!
//! ```
//! use geometry::{Grid, exact::willmore_radius, measure::l2_distance, phase_field, shapes::Ball};
//! use model::Shipped;
//! use operators::ComputeDevice;
//! use solver::{Factors, FlowParams, NewtonParams, WillmoreFlow};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A disc of radius 0.2 grows under Willmore flow: R(t) = (r^4 + 2 t)^(1/4).
//! let device = ComputeDevice::default_compiled()?;
//! let grid = Grid::<2>::per_unit(128, 1.25)?;
//! let params = FlowParams {
//!     eps: 2.0 * grid.spacing(),
//!     mcf_step: grid.spacing().powi(2),
//!     newton: NewtonParams::default(),
//!     calibration: Factors::PAPER,
//! };
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
//! # The step
//!
//! One time step minimizes `e[u_k, u] = eps |u - u_k|^2 + tau eps / tautilde^2 |v[u] - u|^2` over `u`
//! (eq:discrete_willmore_flow_energy of Rumpf, Sassen and Smoch; v after Franken, Rumpf and Wirth). [`MinimizingMovement`] is
//! that energy, scaled, as a Burn graph: the gradient is Burn's autodiff, the Hessian-vector product its linearization
//! ([`linearize`]), forward over reverse.
//!
//! # Calibration
//!
//! Minimizing relaxes the profile of the interface, so that what is left of the energy is `c` times the Willmore energy, with
//! a factor `c` near 1 that belongs to the step of mean curvature flow ([`model::calibration`]). With [`Factors::PAPER`] the
//! flow is the paper's; with the factors of the step, `network.calibration()?.factors`, it is Willmore flow to first order in
//! the curvature, and the Willmore energies in the records are those of the interface.
//!
//! # The minimization
//!
//! Plain Newton-CG with Armijo's rule ([`Method::Paper`]) spends most of its work on two things that are cheap to avoid:
//! a straight update leaves the interface profile, so that steps are cut to pieces; and the profile modes make the Hessian
//! stiff. [`Method::Preconditioned`] therefore
//! 1. starts from the same step on the grid of half as many cells, and so on down ([`WillmoreFlow::begin_on`]), or else from an
//!    extrapolation in `atanh u`, the distance to the interface ([`extrapolate`]),
//! 2. updates in that variable too ([`retract`]),
//! 3. cleans the profile with a few linear iterations after every update, before energies are compared,
//! 4. preconditions with the Hessian of the pure phases, diagonal in Fourier space, plus the Hessian of the geometric problem
//!    for displacements of the interface, on a coarse lattice ([`Preconditioner`]),
//! 5. uses the full Hessian and stops at negative curvature (Steihaug),
//! 6. computes Hessian-vector products and vectors of the linear solves in single precision where the step allows it ([`Precision`]),
//! 7. stops when the Newton decrement is a small fraction of the motion, a test that no scaling of the energy changes and that
//!    `u = u_k` does not pass unless it is stationary.
//!
//! # Constraints
//!
//! [`WillmoreFlow::constrain`] holds the perimeter and the volume of the zero set, or one of them, at targets, without penalties: steps minimize
//! among the phase fields that have them. The multipliers are the tension and the pressure in the records. Two constraints leave a ball no
//! freedom at all, and a shape near one little; a target far from the present value is reached best by small changes in small steps.
//!
//! # Spontaneous curvature, tension and pressure
//!
//! [`WillmoreFlow::set_energy`] makes the energy `1/2 int (h - c0)^2 + sigma A + p V` ([`Helfrich`]), by terms of the same traced function.
//!
//! # Conventions
//!
//! Grids, norms and signs are those of [`geometry`]. Energies in [`StepRecord`] are in the paper's units with true L2 norms.
//! Energies and gradients have the precision of the device, `f64` on CPUs. On a GPU in `f32` the energy of a step is known to about
//! seven digits, so that a minimization can end with [`Exit::Precision`] before a tight tolerance.

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
mod nodes;
mod preconditioner;
mod region;
mod samples;
mod sparse;
mod stored;
mod times;

pub use constraints::Constraints;
pub use energy::{Accuracy, MeanCurvatureStep, MinimizingMovement, Objective, Precision};
pub use error::{Error, StepFailure};
pub use flow::{
    FlowParams, FlowState, MeanCurvatureFlow, Start, StartKind, StepEstimates, StepRecord,
    WillmoreFlow,
};
pub use helfrich::{Helfrich, HelfrichTerms};
pub use model::Factors;
pub use newton::{Exit, Method, NewtonInfo, NewtonParams, minimize};
pub use operators::{extrapolate, retract};
pub use preconditioner::{PhaseInverse, Preconditioner};
pub use region::Region;
pub use stored::Stored;
pub use times::PhaseTimes;
