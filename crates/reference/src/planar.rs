//! Flows of plane curves, spectral in the tangent angle.
//!
//! The curve is given by its tangent angle over the arc length, and its points stay equally spaced (Hou, Lowengrub, Shelley, J.
//! Comput. Phys. 114, 1994). In the time `tau` of the curve scaled to length `2 pi`, `dt = (length / 2 pi)^m dtau` with `m = 4` for
//! Willmore flow and `m = 2` for curve shortening, the stiff part is exactly `theta_tau = -(-d^2/dalpha^2)^(m/2) theta`; it is
//! integrated by exponential time differencing of order four, two half steps against one whole step choose the length of the
//! step, and their difference is extrapolated. A polygon starts with the self-similar solutions of its corners.

use realfft::num_complex::Complex;

use crate::exponential::Step;
use crate::flow::{Nodes, Rates};
use crate::shape::MOST_ROUNDING;
use crate::spectral::Coefficients;
use crate::{Accuracy, Curve, Error, Flow, Shape};

/// The accuracy of plane curves: errors of about 1e-8 of their size.
pub const ACCURACY: Accuracy = Accuracy {
    rounding: MOST_ROUNDING,
    tolerance: 1e-10,
};

/// The curve at increasing times.
///
/// ```
/// use reference::{Flow, Shape, planar};
///
/// let circle = Shape::circle([0.0, 0.0], 0.5)?;
/// let curves = planar::evolve(&circle, Flow::Willmore, &[0.01, 0.02], &planar::ACCURACY)?;
/// let radius = (0.5_f64.powi(4) + 2.0 * 0.02).powf(0.25);
/// assert!((curves[1].length() / std::f64::consts::TAU - radius).abs() < 1e-9);
/// # Ok::<(), reference::Error>(())
/// ```
///
/// # Errors
/// Times must increase from zero, for polygons from the first time that the points resolve; see [`Error`] for singularities.
pub fn evolve(
    shape: &Shape,
    flow: Flow,
    times: &[f64],
    accuracy: &Accuracy,
) -> Result<Vec<Curve>, Error> {
    const MOST_FOLDS: usize = 64;
    let start = shape.curve(flow, accuracy.rounding, MOST_FOLDS)?;
    Exponential::new(flow, Plane::Flat, accuracy.tolerance, start).run(times)
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Plane {
    Flat,
    /// The half plane of the profiles of surfaces that do not meet their axis.
    Meridian,
}

pub(crate) fn checked(times: &[f64], first: f64) -> Result<(), Error> {
    let mut before = 0.0;
    for &time in times {
        if !(time >= before && time.is_finite()) {
            return Err(Error::TimesNotIncreasing { time, before });
        }
        if time < first {
            return Err(Error::TooEarly { time, first });
        }
        before = time;
    }
    Ok(())
}

/// The state is the coefficients of the tangent angle, then the logarithm of the scale, the centre and the time.
pub(crate) struct Exponential {
    flow: Flow,
    plane: Plane,
    tolerance: f64,
    curve: Curve,
    /// Length of the next step.
    step: f64,
}

impl Exponential {
    pub(crate) fn new(flow: Flow, plane: Plane, tolerance: f64, curve: Curve) -> Self {
        const FIRST_STEP: f64 = 1e-5;
        let passed = curve.time / curve.scale.powi(flow.order());
        Self {
            flow,
            plane,
            tolerance,
            step: if passed > 0.0 {
                passed / 8.0
            } else {
                FIRST_STEP
            },
            curve,
        }
    }

    pub(crate) fn run(mut self, times: &[f64]) -> Result<Vec<Curve>, Error> {
        checked(times, self.curve.time)?;
        let mut curves = Vec::with_capacity(times.len());
        for &time in times {
            self.advance(time)?;
            curves.push(self.curve.clone());
        }
        Ok(curves)
    }

    fn advance(&mut self, time: f64) -> Result<(), Error> {
        /// Of the time, that need not be met.
        const SLACK: f64 = 1e-13;
        while time - self.curve.time > SLACK * time {
            self.curve = self.curve.fitted(self.tolerance)?;
            let proposed = self.step;
            let mut length =
                proposed.min((time - self.curve.time) / self.curve.scale.powi(self.flow.order()));
            loop {
                let (end, error) = self.attempt(length);
                let factor = 0.9 * (self.tolerance / error).powf(0.2);
                // A number that is not finite counts as a large error.
                if !(error <= self.tolerance && end.time.is_finite()) {
                    length *= if factor.is_finite() {
                        factor.clamp(0.1, 0.9)
                    } else {
                        0.1
                    };
                    self.step = length;
                    if length
                        < 1e-13 * self.curve.time.max(1e-30)
                            / self.curve.scale.powi(self.flow.order())
                    {
                        return Err(Error::StepTooShort {
                            time: self.curve.time,
                        });
                    }
                } else if end.time > time * (1.0 + SLACK) {
                    length *= (time - self.curve.time) / (end.time - self.curve.time);
                } else {
                    self.step = (length * factor.min(4.0)).max(if length < proposed {
                        self.step
                    } else {
                        0.0
                    });
                    self.curve = end;
                    break;
                }
            }
        }
        self.curve.time = time;
        Ok(())
    }

    /// The curve after two half steps with extrapolation, and the root mean square of the error that they have without.
    fn attempt(&self, length: f64) -> (Curve, f64) {
        let grid = &self.curve.grid;
        let modes = self.curve.angle.len();
        let wave = |j: usize| -grid.wave(j).powi(self.flow.order());
        let linear: Vec<f64> = (0..modes).map(wave).chain([0.0; 4]).collect();
        let nonlinear = |state: &[Complex<f64>]| self.nonlinear(&linear, state);
        let state = self.state();
        let at_start = nonlinear(&state);
        let once = Step::new(&linear, length).take(&nonlinear, &state, &at_start);
        let half = Step::new(&linear, length / 2.0);
        let middle = half.take(&nonlinear, &state, &at_start);
        let twice = half.take(&nonlinear, &middle, &nonlinear(&middle));
        let corrections: Coefficients = twice
            .iter()
            .zip(&once)
            .map(|(a, b)| (a - b) / 15.0)
            .collect();
        let clock = corrections[modes + 3] / self.curve.scale.powi(self.flow.order());
        let squares = corrections[..=modes]
            .iter()
            .chain([&clock])
            .map(Complex::norm_sqr);
        let end: Coefficients = twice.iter().zip(&corrections).map(|(a, b)| a + b).collect();
        let error = (2.0 * squares.sum::<f64>()).sqrt();
        let scalar = |i: usize| end[modes + i].re;
        let curve = Curve {
            grid: grid.clone(),
            scale: scalar(0).exp(),
            centre: [scalar(1), scalar(2)],
            time: scalar(3),
            angle: end[..modes].to_vec(),
        };
        (curve, error)
    }

    fn state(&self) -> Coefficients {
        let curve = &self.curve;
        let scalars = [
            curve.scale.ln(),
            curve.centre[0],
            curve.centre[1],
            curve.time,
        ];
        curve
            .angle
            .iter()
            .copied()
            .chain(scalars.map(Complex::from))
            .collect()
    }

    fn nonlinear(&self, linear: &[f64], state: &[Complex<f64>]) -> Coefficients {
        let grid = &self.curve.grid;
        let (angle, scalars) = state.split_at(grid.points / 2 + 1);
        let scale = scalars[0].re.exp();
        let axis = (self.plane == Plane::Meridian).then(|| scalars[1].re / scale);
        let nodes = Nodes::new(grid, angle, axis);
        let rates = Rates::new(grid, &nodes, &self.flow.velocity(grid, &nodes));
        let rest = rates
            .angle
            .iter()
            .zip(linear)
            .zip(angle)
            .map(|((rate, l), a)| rate - a * *l);
        let scalars = [
            rates.log_scale,
            scale * rates.centre[0],
            scale * rates.centre[1],
            scale.powi(self.flow.order()),
        ];
        rest.chain(scalars.map(Complex::from)).collect()
    }
}
