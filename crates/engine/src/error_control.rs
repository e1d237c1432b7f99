//! Sizes of second-order time steps by their errors.

use geometry::positive;
use serde::{Deserialize, Serialize};
use solver::{StepEstimates, StepRecord};

use crate::record::ESTIMATES_MISS;
use crate::{Error, Record};

/// What limits the size of controlled steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorControl {
    /// The estimated time error of a step over how far the interface moves in it.
    pub relative: f64,
    /// Instead, the [time error of the run](crate::estimated_time_error), a length: a step that ends at the time `t` may be off by `tau / t` of it.
    /// Errors counted as delays then add up to about that while the interface slows down. Steps up to half as bad again are kept, and the
    /// shortest ones whatever their error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// The longest displacement of a stage over the interface width `eps`.
    pub longest: f64,
    /// Size of the first step; `16 eps^4`, in which a corner gets a radius of about `2 eps`, if it is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first: Option<f64>,
}

impl Default for ErrorControl {
    fn default() -> Self {
        Self {
            relative: 0.015,
            length: None,
            longest: 1.0,
            first: None,
        }
    }
}

/// A step that is this much worse than it may be is made again, shorter.
const WORSE: f64 = 1.5;
/// Steps aim at this part of what they may be.
const AIM: f64 = 0.9;
/// The next step is at most this times as long.
const GROWTH: f64 = 2.0;
/// For the sake of its error alone no step is shorter than this part of the time reached: from a corner the rates of the first steps
/// mean nothing.
const LEAST: f64 = 0.1;

/// The size of the next controlled step. It depends on nothing but the records so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ControlledSteps {
    control: ErrorControl,
    eps: f64,
    largest: f64,
    size: f64,
    time: f64,
}

impl ControlledSteps {
    pub(crate) fn new(control: ErrorControl, eps: f64, largest: f64) -> Result<Self, Error> {
        let size = control.first.unwrap_or(16.0 * eps.powi(4));
        positive("relative error of a step", control.relative)?;
        positive("time error", control.length.unwrap_or(1.0))?;
        positive("longest displacement of a stage", control.longest)?;
        positive("first step", size)?;
        Ok(Self {
            control,
            eps,
            largest,
            size,
            time: 0.0,
        })
    }

    /// The size of the next step where so much time is left: the last two before the end share it.
    pub(crate) fn size(&self, left: f64) -> f64 {
        if self.size >= left * (1.0 - 1e-9) {
            left
        } else {
            self.size.min(0.5 * left)
        }
    }

    /// By which factors a step of size `tau` that ends at the time `end` could have been longer: for its error, which is of third order and counts
    /// against what is allowed, of first order, and for its displacement.
    fn room(&self, estimates: &StepEstimates, tau: f64, end: f64) -> (f64, f64) {
        let allowed = match self.control.length {
            Some(length) => length / ESTIMATES_MISS * tau / end,
            None => self.control.relative * estimates.motion,
        };
        let by_error = match estimates.error {
            Some(error) if error > 0.0 => (allowed / error).sqrt(),
            Some(_) => f64::INFINITY,
            None => GROWTH / AIM,
        };
        let displacement = estimates.displacement.max(f64::MIN_POSITIVE);
        (by_error, self.control.longest * self.eps / displacement)
    }

    /// The size with which a step is made again, if it was too long.
    pub(crate) fn shorter(&self, record: &StepRecord) -> Option<f64> {
        let estimates = record.estimates?;
        let (by_error, by_displacement) = self.room(&estimates, record.tau, record.time);
        let least = LEAST * self.time;
        let too_far = WORSE * by_displacement < AIM;
        let too_wrong = WORSE * by_error * by_error < 1.0 && record.tau > 1.2 * least;
        if !(too_far || too_wrong) {
            return None;
        }
        let shorter = record.tau * (0.85 * by_error.min(by_displacement)).clamp(0.25, 0.85);
        Some(if too_far { shorter } else { shorter.max(least) })
    }

    pub(crate) fn accept(&mut self, record: &Record) {
        let tau = record.tau;
        self.time = record.time;
        let Some(estimates) = record.minimization.and_then(|step| step.estimates) else {
            return;
        };
        let (by_error, by_displacement) = self.room(&estimates, tau, record.time);
        let by_error = (AIM * by_error).max(LEAST * self.time / tau);
        let growth = by_error.min(AIM * by_displacement).clamp(0.3, GROWTH);
        // A step that was cut short to end at a given time says little about the next one.
        let before = if record.halvings == 0 { self.size } else { tau };
        let next = if tau > 0.5 * before {
            tau * growth
        } else {
            (before * growth.min(1.0)).max(tau * growth)
        };
        self.size = next.min(self.largest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::record;

    const EPS: f64 = 0.1;

    fn controlled() -> ControlledSteps {
        ControlledSteps::new(ErrorControl::default(), EPS, 1.0).unwrap()
    }

    fn made(tau: f64, error: Option<f64>, displacement: f64) -> Record {
        let mut made = record(tau, 3);
        let estimates = StepEstimates {
            error,
            motion: 0.1,
            displacement,
        };
        made.time = 4.0 * tau;
        let step = made.minimization.as_mut().unwrap();
        (step.estimates, step.time) = (Some(estimates), made.time);
        made
    }

    #[test]
    fn the_error_of_the_next_step_is_what_it_may_be() {
        let mut steps = controlled();
        assert!((steps.size(1.0) - 16.0 * EPS.powi(4)).abs() < 1e-18);
        // An error four times smaller than it may be allows twice the size, but for caution.
        steps.accept(&made(1e-3, Some(0.25 * 0.015 * 0.1), 0.01 * EPS));
        assert!((steps.size(1.0) / (2.0 * AIM * 1e-3) - 1.0).abs() < 1e-12);
        steps.accept(&made(1e-3, Some(1e-12), 0.01 * EPS));
        assert!((steps.size(1.0) - 2e-3).abs() < 1e-12, "growth is limited");
        steps.accept(&made(2e-3, Some(1e-12), EPS));
        assert!((steps.size(1.0) - AIM * 2e-3).abs() < 1e-12);
    }

    #[test]
    fn a_time_error_is_shared_out_by_the_time() {
        let control = ErrorControl {
            length: Some(1e-4),
            ..ErrorControl::default()
        };
        let mut steps = ControlledSteps::new(control, EPS, 1.0).unwrap();
        // The step is the last quarter of the time.
        let allowed = 0.25 * 1e-4 / ESTIMATES_MISS;
        steps.accept(&made(1e-3, Some(allowed), 0.01 * EPS));
        assert!((steps.size(1.0) / (AIM * 1e-3) - 1.0).abs() < 1e-12);
        let wrong = made(1e-2, Some(4.0 * allowed), 0.01 * EPS);
        let shorter = steps.shorter(&wrong.minimization.unwrap()).unwrap();
        assert!((shorter / (0.5 * 0.85 * 1e-2) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_too_long_is_made_again() {
        let mut steps = controlled();
        let long = |record: &Record| record.minimization.unwrap();
        let far = made(1e-3, None, 3.0 * EPS);
        steps.accept(&made(1e-3, None, 0.1 * EPS));
        let shorter = steps.shorter(&long(&far)).unwrap();
        assert!((shorter / (0.85 / 3.0 * 1e-3) - 1.0).abs() < 1e-12);
        let wrong = made(1e-2, Some(4.0 * 0.015 * 0.1), 0.1 * EPS);
        let shorter = steps.shorter(&long(&wrong)).unwrap();
        assert!((shorter / (0.5 * 0.85 * 1e-2) - 1.0).abs() < 1e-12);
        let good = made(1e-3, Some(0.015 * 0.1), EPS);
        assert_eq!(steps.shorter(&long(&good)), None);
    }

    #[test]
    fn the_end_is_met_and_forgotten() {
        let mut steps = controlled();
        steps.size = 1e-3;
        assert!((steps.size(1.5e-3) - 0.75e-3).abs() < 1e-18);
        assert!((steps.size(0.4e-3) - 0.4e-3).abs() < 1e-18);
        steps.accept(&made(0.1e-3, Some(0.015 * 0.1), 0.1 * EPS));
        assert!(steps.size(1.0) > 0.8e-3);
    }

    #[test]
    fn what_is_no_limit_is_refused() {
        for relative in [0.0, -1.0, f64::NAN] {
            let control = ErrorControl {
                relative,
                ..ErrorControl::default()
            };
            let error = ControlledSteps::new(control, EPS, 1.0).unwrap_err();
            assert!(matches!(error, Error::Geometry(_)), "{error}");
        }
    }
}
