//! The Rosenbrock method RODAS of order four for stiff equations (Hairer, Wanner, Solving Ordinary Differential Equations II, 1996,
//! section IV.7): linearly implicit, L-stable, one matrix in each step.

use crate::dense::{Factors, jacobian};

const STAGES: usize = 6;
const GAMMA: f64 = 0.25;
/// Where the stages are evaluated, in terms of the stages before; so are the two solutions, of which the last stage is the
/// difference.
const AT: [&[f64]; STAGES] = [
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
const COUPLING: [&[f64]; STAGES] = [
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

/// The Jacobian matrix at the start of a step, for attempts with several lengths.
pub(crate) struct Step<'a, F> {
    f: &'a F,
    start: &'a [f64],
    jacobian: Vec<Vec<f64>>,
}

impl<'a, F: Fn(&[f64]) -> Vec<f64>> Step<'a, F> {
    pub(crate) fn new(f: &'a F, start: &'a [f64]) -> Self {
        Self {
            f,
            start,
            jacobian: jacobian(f, start, &f(start)),
        }
    }

    /// The solution of order four after a step, and its difference to one of order three.
    pub(crate) fn take(&self, length: f64) -> (Vec<f64>, Vec<f64>) {
        let mut matrix = self.jacobian.clone();
        for (i, row) in matrix.iter_mut().enumerate() {
            for a in row.iter_mut() {
                *a = -*a;
            }
            row[i] += 1.0 / (GAMMA * length);
        }
        let factors = Factors::new(matrix);
        let mut stages: Vec<Vec<f64>> = Vec::with_capacity(STAGES);
        let mut at = self.start.to_vec();
        for (places, couplings) in AT.iter().zip(COUPLING) {
            at = combined(self.start, places, &stages, 1.0);
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
                u = Step::new(&f, &u).take(1.0 / f64::from(steps)).0;
            }
            (u[0] - 1.0_f64.cos()).hypot(u[1] - 1.0_f64.sin())
        };
        let order = (error(8) / error(16)).log2();
        assert!((order - 4.0).abs() < 0.3, "order {order}");
    }
}
