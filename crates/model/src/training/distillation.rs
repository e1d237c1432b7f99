//! Perceptrons of the paper's form that imitate a given odd function with its first two derivatives.

use faer::Mat;
use operators::ComputeDevice;
use serde::{Deserialize, Serialize};

use super::levenberg_marquardt::{Problem, best_start};
use super::{BandSamples, TrainingObserver, TrainingProgress};
use crate::{Error, Mlp, PAPER_LAYERS};

/// Settings of the fit of a perceptron to a function.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distillation {
    /// Random starts; the first that is good enough is taken.
    pub starts: usize,
    /// Iterations of each start at each of four ridges.
    pub start_iterations: usize,
    /// Iterations at each of the last three ridges.
    pub iterations: usize,
}

impl Default for Distillation {
    fn default() -> Self {
        Self {
            starts: 12,
            start_iterations: 25,
            iterations: 150,
        }
    }
}

/// Nodes at which a function is imitated: `[0, 1.3]`, beyond what `K * u` reaches.
const IMITATED: usize = 105;
/// Their distance.
const NODE_DISTANCE: f64 = 0.0125;
/// Weights of first and second differences against values.
const SOBOLEV: [f64; 2] = [0.03, 0.002];
/// Fits a perceptron `N` of the paper's layers such that `(N(z) - N(-z)) / 2` is the odd function `target`, together with its
/// first two derivatives (a Sobolev norm on a fine grid), and returns that odd part.
///
/// # Errors
/// [`Error::Operators`] if the device fails, [`Error::Interrupted`] if the observer says so.
pub(super) fn distill_odd(
    target: &dyn Fn(f64) -> f64,
    settings: &Distillation,
    seed: u64,
    device: &ComputeDevice,
    observer: &mut TrainingObserver<'_, ()>,
) -> Result<Mlp, Error> {
    let nodes: Vec<f64> = (0..IMITATED).map(|i| i as f64 * NODE_DISTANCE).collect();
    let design: Vec<f64> = nodes
        .iter()
        .copied()
        .chain(nodes.iter().map(|z| -z))
        .collect();
    let samples = BandSamples {
        target: design
            .iter()
            .map(|&z| z.signum() * target(z.abs()))
            .collect(),
        weight: vec![1.0; design.len()],
        identity_loss: 1.0,
        design,
    };
    let of = 4 * settings.starts.max(1) * settings.start_iterations + 3 * settings.iterations;
    let mut iteration = 0;
    let mut fit = |x: Vec<f64>, ridge: f64, iterations: usize| -> Result<(f64, Vec<f64>), Error> {
        let mut problem = Problem::of_activation(&samples, ridge, device);
        problem.mix = Some(odd_sobolev_rows());
        problem.fit_activation(x, iterations, |all| {
            iteration += 1;
            let (loss, _) = problem.value(all)?;
            let progress = TrainingProgress {
                iteration,
                of,
                training_loss: loss,
                held_out_loss: loss,
            };
            progress.tell(observer, &())
        })
    };
    let mut parameters = best_start(settings.starts, seed, |x| {
        let mut found = (f64::INFINITY, x);
        for ridge in [1e-6, 1e-7, 1e-8, 1e-9] {
            found = fit(found.1, ridge, settings.start_iterations)?;
        }
        Ok(found)
    })?;
    for ridge in [1e-10, 1e-11, 1e-12] {
        (_, parameters) = fit(parameters, ridge, settings.iterations)?;
    }
    Ok(Mlp::new(PAPER_LAYERS.to_vec(), parameters)?.odd_part())
}

/// Values, first and second differences of `(N(z) - N(-z)) / 2` from values of `N` at the nodes and their negatives.
fn odd_sobolev_rows() -> Mat<f64> {
    let (n, h) = (IMITATED, NODE_DISTANCE);
    let scale = 0.5 / (n as f64).sqrt();
    let mut rows = Mat::zeros(3 * n - 3, 2 * n);
    let mut put = |row: usize, node: usize, value: f64| {
        rows[(row, node)] += scale * value;
        rows[(row, n + node)] -= scale * value;
    };
    for i in 0..n {
        put(i, i, 1.0);
    }
    let [first, second] = [SOBOLEV[0] / (2.0 * h), SOBOLEV[1] / (h * h)];
    // The node before the first is minus the one after it.
    put(n, 1, 2.0 * first);
    for i in 1..n - 1 {
        put(n + i, i + 1, first);
        put(n + i, i - 1, -first);
        put(2 * n - 2 + i, i + 1, second);
        put(2 * n - 2 + i, i, -2.0 * second);
        put(2 * n - 2 + i, i - 1, second);
    }
    rows
}
