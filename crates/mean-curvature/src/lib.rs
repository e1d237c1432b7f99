//! Steps of mean curvature flow `v[u]`: their trait, and their effect on the Willmore energy.
//!
//! Learned operators, finite elements and your own steps implement the trait [`MeanCurvatureStep`]. With any of them the solver of Willmore
//! flow measures curvature: the Willmore energy of the zero set of $`u`$ is about
//!
//! ```math
//! w[u] = \frac{\varepsilon}{2 c \tilde\tau^2} \int |v[u] - u|^2
//! ```
//!
//! with the size $`\tilde\tau`$ of the step, the width $`\varepsilon`$ of the interface, and a factor $`c`$ near 1. (It is 1 for an exact step
//! with a symmetric derivative.) [`calibration`] explains this factor. A step may implement nothing but $`v[u]`$. Then [`measured`] computes
//! $`c`$. For the preconditioner of the solver, it also computes the inverse of a Hessian: that of the energy of a time step in the pure phases,
//! where $`u`$ is constant.

pub mod calibration;
mod error;
pub mod measured;
mod planar;
mod step;

pub use calibration::{Calibration, Factors, PlanarStep, calibrate, normals};
pub use error::Error;
pub use step::{
    Accuracy, Coarser, Identity, MeanCurvatureStep, PhaseInverse, PhaseInverses, StepFailure,
    StepScales,
};
