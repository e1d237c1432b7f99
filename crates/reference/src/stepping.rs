//! Time steps chosen by their errors.

use crate::error::positive;
use crate::{Curve, Error, Flow};

/// Steps of different lengths from one curve: the curve at their end, and the root mean square of the error of its tangent angle.
pub(crate) type Attempts<'a> = Box<dyn Fn(f64) -> (Curve, f64) + 'a>;

/// An integrator of the flow of a curve in the time `tau` of the curve scaled to length `2 pi`, `dt = scale^m dtau`, `m` the order of
/// the flow.
pub(crate) trait Integrator {
    /// Order of the error of one step.
    const ORDER: f64;

    fn attempts<'a>(&'a self, curve: &'a Curve) -> Attempts<'a>;
}

/// The curve at increasing times.
pub(crate) fn run(
    integrator: &impl Integrator,
    flow: Flow,
    tolerance: f64,
    start: Curve,
    times: &[f64],
) -> Result<Vec<Curve>, Error> {
    const FIRST_STEP: f64 = 1e-5;
    positive("tolerance", tolerance)?;
    let passed = start.time / start.clock(flow);
    // Length of the next step.
    let mut step = if passed > 0.0 {
        passed / 8.0
    } else {
        FIRST_STEP
    };
    let (first, mut before, mut curve) = (start.time, 0.0, start);
    let mut curves = Vec::with_capacity(times.len());
    for &time in times {
        if !(time >= before && time.is_finite()) {
            return Err(Error::TimesNotIncreasing { time, before });
        }
        if time < first {
            return Err(Error::TooEarly { time, first });
        }
        while time - curve.time > SLACK * time {
            curve = advanced(
                integrator,
                flow,
                tolerance,
                &curve.fitted(tolerance)?,
                time,
                &mut step,
            )?;
        }
        curve.time = time;
        curves.push(curve.clone());
        before = time;
    }
    Ok(curves)
}

/// Of the time, that need not be met.
const SLACK: f64 = 1e-13;

/// The curve after one step, which ends at the time at the latest.
fn advanced<I: Integrator>(
    integrator: &I,
    flow: Flow,
    tolerance: f64,
    curve: &Curve,
    time: f64,
    step: &mut f64,
) -> Result<Curve, Error> {
    let clock = curve.clock(flow);
    let attempt = integrator.attempts(curve);
    let mut length = step.min((time - curve.time) / clock);
    loop {
        let (end, error) = attempt(length);
        let factor = (0.9 * (tolerance / error).powf(1.0 / I::ORDER)).clamp(0.1, 4.0);
        if error <= tolerance && end.time <= time * (1.0 + SLACK) {
            // A step that only had to meet the time says nothing about the next one.
            if length >= *step {
                *step = length * factor;
            }
            return Ok(end);
        } else if error <= tolerance && end.time.is_finite() {
            length *= (time - curve.time) / (end.time - curve.time);
        } else {
            // Numbers that are not finite count as a large error.
            length *= if error > tolerance { factor } else { 0.1 };
            *step = length;
        }
        if length * clock < SLACK * curve.time.max(f64::MIN_POSITIVE) {
            return Err(Error::StepTooShort { time: curve.time });
        }
    }
}
