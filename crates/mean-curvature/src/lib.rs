//! Steps of mean curvature flow `v[u]`: their trait, and their effect on the Willmore energy.
//!
//! Learned operators, finite elements and your own steps implement the trait [`MeanCurvatureStep`]. With any of them the solver of Willmore
//! flow measures curvature: the Willmore energy of the zero set of $`u`$ is about
//!
//! ```math
//! w[u] = \frac{\varepsilon}{2 c \tilde\tau^2} \int |v[u] - u|^2
//! ```
//!
//! with the size $`\tilde\tau`$ of the step, the width $`\varepsilon`$ of the interface, and a factor $`c`$, which is 1 for an exact step.
//! [`calibration`] explains this factor. For a step that gives $`v[u]`$ alone, [`measured`] computes it, and the inverse in the pure phases.

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
