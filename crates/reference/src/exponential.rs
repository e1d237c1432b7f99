//! Exponential time differencing of order four (Cox, Matthews, J. Comput. Phys. 176, 2002) for `u' = L u + N(u)`, `L` diagonal.

use realfft::num_complex::Complex;

use crate::flow::{Nodes, Rates};
use crate::spectral::{Coefficients, collect};
use crate::stepping::{Attempts, Integrator};
use crate::{Curve, Flow};

/// Flows of plane curves, and of the profiles of surfaces that do not meet their axis. Two half steps are compared with one whole
/// step, and their difference is extrapolated.
pub(crate) struct Exponential {
    pub(crate) flow: Flow,
    /// Whether the curve is a profile.
    pub(crate) revolution: bool,
}

impl Integrator for Exponential {
    const ORDER: f64 = 5.0;

    fn attempts<'a>(&'a self, curve: &'a Curve) -> Attempts<'a> {
        let modes = curve.angle.len();
        let decay = |j: usize| -curve.grid.wave(j).powi(self.flow.order());
        let linear: Vec<f64> = (0..modes).map(decay).chain([0.0; 4]).collect();
        let [x, y] = curve.centre;
        let scalars = [curve.scale.ln(), x, y, curve.time];
        let start = with_scalars(&curve.angle, scalars);
        let at_start = self.nonlinear(curve, &linear, &start);
        Box::new(move |length| {
            let nonlinear = |state: &[Complex<f64>]| self.nonlinear(curve, &linear, state);
            let once = Step::new(&linear, length).take(&nonlinear, &start, &at_start);
            let half = Step::new(&linear, length / 2.0);
            let middle = half.take(&nonlinear, &start, &at_start);
            let twice = half.take(&nonlinear, &middle, &nonlinear(&middle));
            let difference = |i: usize| (twice[i] - once[i]) / 15.0;
            let squares = (0..=modes).map(|i| difference(i).norm_sqr()).sum::<f64>();
            let late = difference(modes + 3).re / curve.clock(self.flow);
            let end = collect(twice.len(), |i| twice[i] + difference(i));
            let (angle, scalars) = end.split_at(modes);
            let end = Curve {
                grid: curve.grid.clone(),
                angle: angle.to_vec(),
                scale: scalars[0].re.exp(),
                centre: [scalars[1].re, scalars[2].re],
                time: scalars[3].re,
            };
            (end, (2.0 * squares + late * late).sqrt())
        })
    }
}

impl Exponential {
    /// The state is the coefficients of the tangent angle, then the logarithm of the scale, the centre and the time.
    fn nonlinear(&self, curve: &Curve, linear: &[f64], state: &[Complex<f64>]) -> Coefficients {
        let (angle, scalars) = state.split_at(curve.angle.len());
        let scale = scalars[0].re.exp();
        let axis = self.revolution.then(|| scalars[1].re / scale);
        let nodes = Nodes::new(&curve.grid, angle, axis);
        let rates = Rates::new(self.flow, &curve.grid, &nodes);
        let [x, y] = rates.centre;
        let clock = scale.powi(self.flow.order());
        let all = with_scalars(&rates.angle, [rates.log_scale, scale * x, scale * y, clock]);
        collect(all.len(), |i| all[i] - state[i] * linear[i])
    }
}

fn with_scalars(angle: &[Complex<f64>], scalars: [f64; 4]) -> Coefficients {
    let scalars = scalars.map(Complex::from);
    angle.iter().copied().chain(scalars).collect()
}

/// Factors of one step for each entry of `L`.
struct Factors {
    whole: f64,
    half: f64,
    /// Of the inner stages.
    stage: f64,
    /// Of the nonlinear term at the start, in the middle and at the end.
    weights: [f64; 3],
}

/// A step of fixed length; entries with `L = 0` take the step of the classical Runge-Kutta method.
struct Step(Vec<Factors>);

impl Step {
    fn new(linear: &[f64], length: f64) -> Self {
        let factors = |l: &f64| {
            let z = l * length;
            let [p1, p2, p3] = phi(z);
            Factors {
                whole: z.exp(),
                half: (z / 2.0).exp(),
                stage: length / 2.0 * phi(z / 2.0)[0],
                weights: [p1 - 3.0 * p2 + 4.0 * p3, 2.0 * p2 - 4.0 * p3, 4.0 * p3 - p2]
                    .map(|w| w * length),
            }
        };
        Self(linear.iter().map(factors).collect())
    }

    /// The step from `u`, where the nonlinear term is `start`.
    fn take(
        &self,
        nonlinear: &impl Fn(&[Complex<f64>]) -> Coefficients,
        u: &[Complex<f64>],
        start: &[Complex<f64>],
    ) -> Coefficients {
        let stage = |from: &[Complex<f64>], term: &dyn Fn(usize) -> Complex<f64>| {
            let factors = &self.0;
            collect(from.len(), |i| {
                from[i] * factors[i].half + term(i) * factors[i].stage
            })
        };
        let a = stage(u, &|i| start[i]);
        let at_a = nonlinear(&a);
        let b = stage(u, &|i| at_a[i]);
        let at_b = nonlinear(&b);
        let c = stage(&a, &|i| at_b[i] * 2.0 - start[i]);
        let at_c = nonlinear(&c);
        let end = |(i, f): (usize, &Factors)| {
            u[i] * f.whole
                + start[i] * f.weights[0]
                + (at_a[i] + at_b[i]) * f.weights[1]
                + at_c[i] * f.weights[2]
        };
        self.0.iter().enumerate().map(end).collect()
    }
}

/// `phi_1, phi_2, phi_3` at `z <= 0`, `phi_k(z) = (phi_{k-1}(z) - 1 / (k-1)!) / z`, `phi_0 = exp`: by the series for small `z`,
/// where the recursion cancels.
fn phi(z: f64) -> [f64; 3] {
    if z < -1.0 {
        let first = z.exp_m1() / z;
        let second = (first - 1.0) / z;
        [first, second, (second - 0.5) / z]
    } else {
        // Horner's scheme of sum_n 6 z^n / (n + 3)!.
        let factor = |sum: f64, n: i32| 1.0 + sum * z / f64::from(n + 4);
        let third = (0..18).rev().fold(1.0, factor) / 6.0;
        let second = 0.5 + z * third;
        [1.0 + z * second, second, third]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_formulas_of_phi_agree() {
        let (left, right) = (phi(-1.0 - 1e-12), phi(-1.0 + 1e-12));
        for k in 0..3 {
            assert!((left[k] - right[k]).abs() < 2e-12);
        }
        assert!((phi(-2.0)[2] - ((-2.0_f64).exp() - 1.0 + 2.0 - 2.0) / -8.0).abs() < 1e-15);
    }

    /// `u' = -3 u + cos(t) u^2`, `t' = 1`, against a solution with many steps.
    #[test]
    fn order_is_four() {
        let error = |steps: u32| {
            let step = Step::new(&[-3.0, 0.0], 1.0 / f64::from(steps));
            let nonlinear = |u: &[Complex<f64>]| {
                let t = u[1].re;
                vec![
                    Complex::from(t.cos() * u[0].re * u[0].re),
                    Complex::from(1.0),
                ]
            };
            let mut u = vec![Complex::from(2.0), Complex::from(0.0)];
            for _ in 0..steps {
                let start = nonlinear(&u);
                u = step.take(&nonlinear, &u, &start);
            }
            u[0].re
        };
        let exact = error(512);
        let ratio = (error(16) - exact) / (error(32) - exact);
        assert!((ratio.log2() - 4.0).abs() < 0.3, "order {}", ratio.log2());
    }
}
