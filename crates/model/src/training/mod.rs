//! Learning the operator from shrinking spheres, in three ways.
//!
//! [`adam`] is the paper's: mini-batches of whole grids, refined progressively. [`levenberg_marquardt`] solves the same
//! least-squares problem on sampled points and gets to its floor in half a minute. [`least_squares`] has another goal, the
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
pub struct TrainingProgress {
    /// Number of finished iterations.
    pub iteration: usize,
    /// Number of planned iterations.
    pub of: usize,
    /// Loss of the paper on the training data; of a perceptron that imitates a function its residual.
    pub training_loss: f64,
    /// The same on held-out data, if there are any.
    pub held_out_loss: f64,
}

impl TrainingProgress {
    /// Tells an observer, who may end the training.
    fn tell<State>(
        &self,
        observer: &mut TrainingObserver<'_, State>,
        state: &State,
    ) -> Result<(), Error> {
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
pub type TrainingObserver<'a, State> =
    dyn FnMut(&TrainingProgress, &State) -> Result<bool, Error> + Send + 'a;

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use operators::ComputeDevice;

    use super::*;
    use crate::Ratios;

    /// The ratios for `eps = 2h` and `tautilde = h^2`.
    pub(super) fn ratios(dimension: usize, width: usize) -> Ratios {
        Ratios {
            dimension,
            width,
            eps_over_h: 2.0,
            step_over_h2: 1.0,
        }
    }

    /// Checks that a training which is stopped in this iteration goes on with the same bytes, and returns its held-out losses.
    pub(super) fn resumes_with_the_same_bytes<R: Recipe>(
        recipe: &R,
        data: &SphereData,
        seed: u64,
        stop: usize,
    ) -> Vec<f64>
    where
        R::State: PartialEq + Debug,
    {
        let device = ComputeDevice::default_compiled().unwrap();
        let run = |state: Option<R::State>, observer: &mut TrainingObserver<'_, R::State>| {
            recipe.train(data, seed, state, &device, observer)
        };
        let (mut losses, mut last) = (Vec::new(), None);
        let whole = run(None, &mut |p: &TrainingProgress, s: &R::State| {
            losses.push(p.held_out_loss);
            last = Some(s.clone());
            Ok(true)
        });
        let mut half = None;
        let stopped = run(None, &mut |p: &TrainingProgress, s: &R::State| {
            half = Some(s.clone());
            Ok(p.iteration < stop)
        });
        assert!(matches!(stopped, Err(Error::Interrupted { iteration }) if iteration == stop));
        let mut resumed_last = None;
        let resumed = run(half, &mut |_: &TrainingProgress, s: &R::State| {
            resumed_last = Some(s.clone());
            Ok(true)
        });
        assert_eq!((resumed.unwrap(), resumed_last), (whole.unwrap(), last));
        losses
    }
}
