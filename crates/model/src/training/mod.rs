//! Learning the operator from shrinking spheres (alg:mcf_training), in three ways.
//!
//! [`adam`] is the paper's: mini-batches of whole grids, refined progressively. [`levenberg_marquardt`] solves the same
//! least-squares problem on sampled points and gets to its floor in a minute. [`least_squares`] asks for another thing, the
//! same relative accuracy at every curvature, which is what the calibrated Willmore scheme needs.
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

/// One iteration or epoch of a training, for progress displays and learning curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Finished iterations.
    pub iteration: usize,
    /// Planned iterations.
    pub of: usize,
    /// Loss (eq:mcf_scheme_optimization_discrete) on the training data.
    pub training_loss: f64,
    /// Loss on held-out data.
    pub held_out_loss: f64,
}

/// Watches a training.
pub trait Observer<State> {
    /// Called after every iteration; `Ok(false)` stops the training with [`Error::Interrupted`].
    ///
    /// # Errors
    /// Whatever storing a checkpoint can raise; it ends the training.
    fn observe(&mut self, progress: &Progress, state: &State) -> Result<bool, Error>;
}

impl<State, F: FnMut(&Progress, &State) -> Result<bool, Error>> Observer<State> for F {
    fn observe(&mut self, progress: &Progress, state: &State) -> Result<bool, Error> {
        self(progress, state)
    }
}
