//! The Rosenbrock method RODAS of order four for stiff equations (Hairer, Wanner, Solving Ordinary Differential Equations II, 1996,
//! section IV.7): linearly implicit, L-stable, one matrix in each step.

use crate::dense::{Factors, jacobian};
use crate::flow::{Nodes, Rates};
use crate::spectral::{odd, sines};
use crate::stepping::{Attempts, Integrator};
use crate::{Curve, Flow};

/// Flows of the profiles of surfaces that meet their axis.
pub(crate) struct Rosenbrock(pub(crate) Flow);

impl Integrator for Rosenbrock {
    const ORDER: f64 = 4.0;

    fn attempts<'a>(&'a self, curve: &'a Curve) -> Attempts<'a> {
        let scalars = [curve.scale.ln(), curve.centre[1], curve.time];
        let start: Vec<f64> = sines(&curve.angle).chain(scalars).collect();
        let step = Step::new(move |state: &[f64]| self.rates(curve, state), start);
        Box::new(move |length| {
            let (end, difference) = step.take(length);
            let (angle, scalars) = end.split_at(end.len() - 3);
            let late = difference[angle.len() + 2] / curve.clock(self.0);
            let squares: f64 = difference[..=angle.len()].iter().map(|d| d * d).sum();
            let end = Curve {
                grid: curve.grid.clone(),
                angle: odd(angle),
                scale: scalars[0].exp(),
                centre: [0.0, scalars[1]],
                time: scalars[2],
            };
            (end, (squares / 2.0 + late * late).sqrt())
        })
    }
}

impl Rosenbrock {
    /// The state is the sines of the tangent angle, then the logarithm of the scale, the height of the centre and the time.
    fn rates(&self, curve: &Curve, state: &[f64]) -> Vec<f64> {
        let (angle, scalars) = state.split_at(state.len() - 3);
        let nodes = Nodes::new(&curve.grid, &odd(angle), Some(0.0));
        let rates = Rates::new(self.0, &curve.grid, &nodes);
        let scale = scalars[0].exp();
        let height = scale * rates.centre[1];
        let scalars = [rates.log_scale, height, scale.powi(self.0.order())];
        sines(&rates.angle).chain(scalars).collect()
    }
}

const GAMMA: f64 = 0.25;
/// Where the stages are evaluated, in terms of the stages before; the last is the embedded solution of order three, to which its
/// stage is added.
const AT: [&[f64]; 6] = [
    &[],
    &[1.544],
    &[0.9466785280815826, 0.2557011698983284],
    &[3.314825187068521, 2.896124015972201, 0.9986419139977817],
    &[
        1.221224509226641,
        6.019134481288629,
        12.53708332932087,
        -0.687886036105895,
    ],
    &[
        1.221224509226641,
        6.019134481288629,
        12.53708332932087,
        -0.687886036105895,
        1.0,
    ],
];
const COUPLING: [&[f64]; 6] = [
    &[],
    &[-5.6688],
    &[-2.430093356833875, -0.2063599157091915],
    &[-0.1073529058151375, -9.594562251023355, -20.47028614809616],
    &[
        7.496443313967647,
        -10.24680431464352,
        -33.99990352819905,
        11.7089089320616,
    ],
    &[
        8.083246795921522,
        -7.981132988064893,
        -31.52159432874371,
        16.31930543123136,
        -6.058818238834054,
    ],
];

/// A step, for several lengths.
struct Step<F> {
    f: F,
    start: Vec<f64>,
    jacobian: Vec<Vec<f64>>,
}

impl<F: Fn(&[f64]) -> Vec<f64>> Step<F> {
    fn new(f: F, start: Vec<f64>) -> Self {
        Self {
            jacobian: jacobian(&f, &start, &f(&start)),
            f,
            start,
        }
    }

    /// The solution of order four, and its difference to one of order three.
    fn take(&self, length: f64) -> (Vec<f64>, Vec<f64>) {
        let mut matrix = self.jacobian.clone();
        for (i, row) in matrix.iter_mut().enumerate() {
            for a in row.iter_mut() {
                *a = -*a;
            }
            row[i] += 1.0 / (GAMMA * length);
        }
        let factors = Factors::new(matrix);
        let mut stages: Vec<Vec<f64>> = Vec::new();
        let mut at = self.start.clone();
        for (places, couplings) in AT.into_iter().zip(COUPLING) {
            at = combined(&self.start, places, &stages, 1.0);
            let right = combined(&(self.f)(&at), couplings, &stages, 1.0 / length);
            stages.push(factors.solve(&right));
        }
        let last = stages.pop().expect("there are six stages");
        (at.iter().zip(&last).map(|(a, b)| a + b).collect(), last)
    }
}

/// `start + scale sum_j weights_j stages_j`.
fn combined(start: &[f64], weights: &[f64], stages: &[Vec<f64>], scale: f64) -> Vec<f64> {
    let mut sum = start.to_vec();
    for (weight, stage) in weights.iter().zip(stages) {
        for (s, k) in sum.iter_mut().zip(stage) {
            *s += weight * scale * k;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x' = -y - x (x^2 + y^2 - 1)`, `y' = x - y (x^2 + y^2 - 1)` keeps to the unit circle.
    #[test]
    fn order_is_four() {
        let f = |u: &[f64]| {
            let excess = u[0] * u[0] + u[1] * u[1] - 1.0;
            vec![-u[1] - u[0] * excess, u[0] - u[1] * excess]
        };
        let error = |steps: u32| {
            let mut u = vec![1.0, 0.0];
            for _ in 0..steps {
                u = Step::new(f, u).take(1.0 / f64::from(steps)).0;
            }
            (u[0] - 1.0_f64.cos()).hypot(u[1] - 1.0_f64.sin())
        };
        let order = (error(8) / error(16)).log2();
        assert!((order - 4.0).abs() < 0.3, "order {order}");
    }
}
