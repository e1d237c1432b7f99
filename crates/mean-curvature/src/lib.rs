//! Steps of mean curvature flow `v[u]`: what a solver asks of one, and what one makes of the Willmore energy.
//!
//! [`MeanCurvatureStep`] is the trait that learned operators, finite elements and a person's own steps implement. The solver of Willmore
//! flow measures curvature with any of them: the Willmore energy of the zero set of $`u`$ is about
//!
//! ```math
//! w[u] = \frac{\varepsilon}{2 c \tilde\tau^2} \int |v[u] - u|^2
//! ```
//!
//! with the size $`\tilde\tau`$ of the step, the width $`\varepsilon`$ of the interface, and a factor $`c`$, which is 1 for an exact step. [`calibration`] says what that makes of the Willmore energy,
//! [`measured`] finds it, and the inverse in the pure phases, for steps that only say what `v[u]` is.

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
