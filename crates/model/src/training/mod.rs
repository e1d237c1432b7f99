//! Learning the operator from shrinking spheres (alg:mcf_training), in three ways.
//!
//! [`adam`] is the paper's: mini-batches of whole grids, refined progressively. [`levenberg_marquardt`] solves the same
//! least-squares problem on sampled points and gets to its floor in a minute. [`least_squares`] has another goal, the
//! same relative accuracy at every curvature, which the calibrated Willmore scheme needs.
//!
//! Each is a [`Recipe`]; a [`Training`] runs any of them.

pub mod adam;
mod distillation;
pub mod least_squares;
pub mod levenberg_marquardt;
mod recipe;
mod spheres;
mod symmetry;

pub use distillation::Distillation;
pub use recipe::{Checkpoint, CurvePoint, Recipe, Trained, Training};
pub use spheres::{BandSamples, SphereData};
pub use symmetry::Orbits;

use crate::Error;

/// The progress of a training after an iteration or epoch, for displays and learning curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Number of finished iterations.
    pub iteration: usize,
    /// Number of planned iterations.
    pub of: usize,
    /// Loss (eq:mcf_scheme_optimization_discrete) on the training data; of a perceptron that imitates a function its residual.
    pub training_loss: f64,
    /// The same on held-out data, if there are any.
    pub held_out_loss: f64,
}

impl Progress {
    /// Tells an observer, who may end the training.
    fn tell<State>(&self, observer: &mut Observer<'_, State>, state: &State) -> Result<(), Error> {
        if observer(self, state)? {
            return Ok(());
        }
        Err(Error::Interrupted {
            iteration: self.iteration,
        })
    }
}

/// Called after every iteration of a training: `Ok(false)` stops it with [`Error::Interrupted`], and an error, such as that of storing
/// a checkpoint, ends it.
pub type Observer<'a, State> = dyn FnMut(&Progress, &State) -> Result<bool, Error> + Send + 'a;
