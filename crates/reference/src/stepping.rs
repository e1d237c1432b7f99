//! Time steps chosen by their errors.

use crate::error::positive;
use crate::{Curve, Error, Flow};

/// Steps of different lengths from one curve: the curve at their end, and the root mean square of the error of its tangent angle.
pub(crate) type Attempts<'a> = Box<dyn Fn(f64) -> (Curve, f64) + 'a>;

/// A method for the flow of a curve in the time `tau` of the curve scaled to length `2 pi`, `dt = scale^m dtau`, `m` the order of
/// the flow.
pub(crate) trait Method {
    /// Order of the error of one step.
    const ORDER: f64;

    fn attempts<'a>(&'a self, curve: &'a Curve) -> Attempts<'a>;
}

/// The curve at increasing times.
pub(crate) fn run(
    method: &impl Method,
    flow: Flow,
    tolerance: f64,
    start: Curve,
    times: &[f64],
) -> Result<Vec<Curve>, Error> {
    const FIRST_STEP: f64 = 1e-5;
    positive("tolerance", tolerance)?;
    let passed = start.time / start.clock(flow);
    let mut run = Run {
        flow,
        tolerance,
        step: if passed > 0.0 {
            passed / 8.0
        } else {
            FIRST_STEP
        },
        curve: start,
    };
    let (first, mut before) = (run.curve.time, 0.0);
    let mut curves = Vec::with_capacity(times.len());
    for &time in times {
        if !(time >= before && time.is_finite()) {
            return Err(Error::TimesNotIncreasing { time, before });
        }
        if time < first {
            return Err(Error::TooEarly { time, first });
        }
        run.advance(method, time)?;
        curves.push(run.curve.clone());
        before = time;
    }
    Ok(curves)
}

struct Run {
    flow: Flow,
    tolerance: f64,
    curve: Curve,
    /// Length of the next step.
    step: f64,
}

impl Run {
    fn advance<M: Method>(&mut self, method: &M, time: f64) -> Result<(), Error> {
        /// Of the time, that need not be met.
        const SLACK: f64 = 1e-13;
        while time - self.curve.time > SLACK * time {
            self.curve = self.curve.fitted(self.tolerance)?;
            let clock = self.curve.clock(self.flow);
            let attempt = method.attempts(&self.curve);
            let mut length = self.step.min((time - self.curve.time) / clock);
            let end = loop {
                let (end, error) = attempt(length);
                let factor = (0.9 * (self.tolerance / error).powf(1.0 / M::ORDER)).clamp(0.1, 4.0);
                if error <= self.tolerance && end.time <= time * (1.0 + SLACK) {
                    // A step that only had to meet the time says nothing about the next one.
                    if length >= self.step {
                        self.step = length * factor;
                    }
                    break end;
                } else if error <= self.tolerance && end.time.is_finite() {
                    length *= (time - self.curve.time) / (end.time - self.curve.time);
                } else {
                    // Numbers that are not finite count as a large error.
                    length *= if error > self.tolerance { factor } else { 0.1 };
                    self.step = length;
                }
                if length * clock < SLACK * self.curve.time.max(f64::MIN_POSITIVE) {
                    return Err(Error::StepTooShort {
                        time: self.curve.time,
                    });
                }
            };
            drop(attempt);
            self.curve = end;
        }
        self.curve.time = time;
        Ok(())
    }
}
