//! Direct steps of Willmore flow: a convolution and a redistancing, without a minimization and without a network.
//!
//! The phase field stands for the signed distance $`s`$ to its zero level. A step of size $`\tau`$ convolves a profile $`q(s)`$ with a
//! [`Kernel`] that is matched to the size and to the spacing of the grid. The zero level of $`K * q(s)`$ is that of $`s`$, displaced by
//! $`\tau`$ times the velocity of Willmore flow,
//!
//! ```math
//! V = \partial_s^2 \kappa + \tfrac12 \kappa^3 \text{ in the plane}, \qquad
//! V = \Delta H + \tfrac12 H (k_1 - k_2)^2 \text{ in space},
//! ```
//!
//! up to terms of second order in $`\tau`$. The mean curvature $`H`$ is the sum of the principal curvatures $`k_1`$ and $`k_2`$. The step ends with the signed distance to that level ([`geometry::Redistanced`]). `docs/direct.md` has
//! the theory. Grzhibovskis and Heintz (Interfaces Free Bound. 10, 2008) do the same with indicator functions.
//!
//! [`DirectSteps`] makes single steps of first order; [`Direct`] is a [`Scheme`](solver::Scheme) of second order:
//!
//! ```
//! use direct::Direct;
//! use geometry::{Grid, exact::willmore_radius, measure::l2_distance, phase_field, shapes::Ball};
//! use model::{MeanCurvatureOperator, Shipped};
//! use operators::ComputeDevice;
//! use solver::{FlowParams, Problem, Stepper};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A disc of radius 0.3 grows: R(t) = (r^4 + 2 t)^(1/4).
//! let device = ComputeDevice::default_compiled()?;
//! let grid = Grid::<2>::per_unit(64, 1.25)?;
//! let params = FlowParams::paper(2.0 * grid.spacing(), grid.spacing().powi(2));
//! let network = Shipped::Paper.find(params.ratios(&grid, 17))?;
//! let disc = |radius| phase_field(grid, &Ball::<2>::new([0.0, 0.0], radius)?, params.eps);
//!
//! // A problem has a step of mean curvature flow, which direct steps do not use.
//! let problem = Problem::new(MeanCurvatureOperator::new(&network, &device)?, &grid, params, &device)?;
//! let start = problem.start(&disc(0.3)?)?;
//! let mut flow = Stepper::by(Direct::new(), problem, start);
//! let step = flow.step(1e-4)?;
//! let direct = step.direct.expect("the step is direct");
//! println!("w = {:.3} after {} convolutions", step.willmore_energy, direct.convolutions);
//! let exact = disc(willmore_radius(0.3, flow.state.time, 2))?;
//! assert!(l2_distance(&flow.field()?, &exact)? < 1e-4);
//! # Ok(())
//! # }
//! ```

mod kernel;
mod profile;
mod scheme;
mod step;

pub use kernel::{HeatKernel, Kernel};
pub use scheme::{Direct, DirectParams};
pub use step::DirectSteps;
