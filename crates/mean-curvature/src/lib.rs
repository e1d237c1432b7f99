//! Steps of mean curvature flow `v[u]`: their trait, and their effect on the Willmore energy.
//!
<<<<<<< HEAD
//! [`MeanCurvatureStep`] is the trait that learned operators, finite elements and a person's own steps implement. The solver of Willmore
//! flow measures curvature with any of them: the Willmore energy of the zero set of $`u`$ is about
//!
//! ```math
//! w[u] = \frac{\varepsilon}{2 c \tilde\tau^2} \int |v[u] - u|^2
//! ```
//!
//! with the size $`\tilde\tau`$ of the step, the width $`\varepsilon`$ of the interface, and a factor $`c`$, which is 1 for an exact step. [`calibration`] says what that makes of the Willmore energy,
//! [`measured`] finds it, and the inverse in the pure phases, for steps that only say what `v[u]` is.
=======
//! Learned operators, finite elements and your own steps implement the trait [`MeanCurvatureStep`]. With any of them, and their size
//! `tautilde`, the solver of Willmore flow measures curvature as `|v[u] - u|^2 / tautilde^2`. The resulting energy differs from the Willmore energy
//! by the factors of [`calibration`]. For a step that gives `v[u]` alone, [`measured`] computes these factors, and the inverse in the pure phases.
>>>>>>> 0a878c10 (Front pages of the crates in sentences of one thought)

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
