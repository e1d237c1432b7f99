//! The paper's training: Adam on mini-batches of whole grids, refined progressively.

use burn::optim::{Adam, AdamConfig, AdamState as BurnState, AdaptiveMomentumState, Optimizer};
use burn::tensor::Tensor;
use chacha20::ChaCha8Rng;
use operators::{ComputeDevice, circular_convolution};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use super::{Recipe, SphereData, TrainingObserver, TrainingProgress};
use crate::mlp::forward;
use crate::{Error, Mlp, Network};

/// Settings of the training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AdamParams {
    /// Number of passes over all radii.
    pub epochs: usize,
    /// Radii per mini-batch, 10 in the paper.
    pub batch: usize,
    /// Learning rate of the first epoch.
    pub learning_rate: f64,
    /// Learning rate of the last epoch; geometric in between.
    pub final_learning_rate: f64,
    /// Number of held-out radii for the learning curve.
    pub held_out: usize,
    /// Kernel and activation to start from; `None` is [`paper_start`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<(Vec<f64>, Mlp)>,
}

impl Default for AdamParams {
    fn default() -> Self {
        Self {
            epochs: 200,
            batch: 10,
            learning_rate: 2e-2,
            final_learning_rate: 1e-3,
            held_out: 10,
            start: None,
        }
    }
}

/// State between epochs; what a checkpoint holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdamState {
    /// Kernel entries, then activation parameters.
    pub parameters: Vec<f64>,
    /// First and second moment of the gradient.
    pub moments: [Vec<f64>; 2],
    /// Number of updates so far.
    pub updates: usize,
    /// Number of finished epochs.
    pub epoch: usize,
}

/// Loss of the paper of a mini-batch as a Burn graph.
///
/// `parameters`: kernel then activation, flat; `spheres`, `targets`: `[batch, n, .., n]`.
pub fn loss<const D: usize, const R: usize>(
    parameters: &Tensor<1>,
    width: usize,
    layers: &[usize],
    spheres: Tensor<R>,
    targets: Tensor<R>,
) -> Tensor<1> {
    let kernel_len = width.pow(D as u32);
    let total = parameters.dims()[0];
    let kernel: Tensor<D> = parameters
        .clone()
        .slice([0..kernel_len])
        .reshape([width; D]);
    let activation = parameters.clone().slice([kernel_len..total]);
    let smoothed = circular_convolution(spheres, kernel, false);
    let points: usize = smoothed.dims().iter().product();
    let result = forward(layers, &activation, smoothed.reshape([points, 1]));
    let error = result - targets.reshape([points, 1]);
    (error.clone() * error).mean()
}

impl AdamParams {
    /// The next stage of the progressive training, on a grid of half the spacing: from the refined kernel and the activation
    /// of `coarse`, with a quarter of the epochs. The entries of a refined kernel are `2^-D` times as large, and Adam's steps
    /// do not scale with them, so the learning rates do.
    #[must_use]
    pub fn refined(&self, coarse: &Network) -> Self {
        let ratios = coarse.ratios();
        let (kernel, _) = refine_kernel(coarse.kernel(), ratios.dimension, ratios.width);
        let shrinkage = 0.5_f64.powi(ratios.dimension as i32);
        Self {
            epochs: self.epochs.div_ceil(4),
            learning_rate: self.learning_rate * shrinkage,
            final_learning_rate: self.final_learning_rate * shrinkage,
            start: Some((kernel, coarse.activation().clone())),
            ..self.clone()
        }
    }

    fn train_in<const D: usize, const R: usize>(
        &self,
        data: &SphereData,
        seed: u64,
        state: Option<AdamState>,
        device: &ComputeDevice,
        observer: &mut TrainingObserver<'_, AdamState>,
    ) -> Result<(Vec<f64>, Mlp), Error> {
        data.validate()?;
        if self.batch == 0 || self.epochs == 0 {
            return Err(Error::Training(
                "Adam needs at least one epoch and one radius per batch".to_owned(),
            ));
        }
        let (kernel, activation) = match &self.start {
            Some(start) => start.clone(),
            None => paper_start(data, seed),
        };
        let kernel_len = data.ratios.kernel_len();
        Error::check_count("kernel to start from", kernel_len, kernel.len())?;
        let layers = activation.layers().to_vec();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let radii = data.draw_radii(data.count, &mut rng);
        let held_out = data.draw_radii(self.held_out.max(1), &mut rng);
        let (held_spheres, held_targets) = data.pairs::<R>(&held_out, device);

        let mut state = match state {
            Some(state) => state,
            None => {
                let parameters = [&kernel[..], activation.parameters()].concat();
                let zeros = vec![0.0; parameters.len()];
                AdamState {
                    moments: [zeros.clone(), zeros],
                    parameters,
                    updates: 0,
                    epoch: 0,
                }
            }
        };
        let n = kernel.len() + activation.parameters().len();
        for part in state.moments.iter().chain([&state.parameters]) {
            Error::check_count("training checkpoint", n, part.len())?;
        }
        let adam: Adam = AdamConfig::new().with_epsilon(1e-10).build();
        let upload = |values: &[f64]| device.tensor::<1>(values, [n]);
        let mut parameters = upload(&state.parameters);
        let mut momentum = (state.updates > 0).then(|| {
            let [first, second] = &state.moments;
            BurnState::new(AdaptiveMomentumState::new(
                state.updates,
                upload(first),
                upload(second),
            ))
        });
        let width = data.ratios.width;
        while state.epoch < self.epochs {
            // Every epoch has its own stream, so that a resumed training draws what an uninterrupted one would.
            let mut order: Vec<usize> = (0..radii.len()).collect();
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(1 + state.epoch as u64);
            order.shuffle(&mut rng);
            let progress = state.epoch as f64 / (self.epochs.max(2) - 1) as f64;
            let rate =
                self.learning_rate * (self.final_learning_rate / self.learning_rate).powf(progress);
            let mut sum = 0.0;
            let mut batches = 0.0;
            for chunk in order.chunks(self.batch) {
                let chosen: Vec<f64> = chunk.iter().map(|&i| radii[i]).collect();
                let (spheres, targets) = data.pairs::<R>(&chosen, device);
                let variable = parameters.clone().autodiff().require_grad();
                let value = loss::<D, R>(&variable, width, &layers, spheres, targets);
                let gradients = value.clone().backward();
                let gradient = variable
                    .grad(&gradients)
                    .ok_or_else(|| Error::Training("autodiff returned no gradient".to_owned()))?;
                sum += device.scalar(value.inner())?;
                batches += 1.0;
                let (next, next_momentum) = adam.step(rate, parameters, gradient, momentum);
                (parameters, momentum) = (next, next_momentum);
                state.updates += 1;
            }
            state.epoch += 1;
            state.parameters = device.values(parameters.clone())?;
            if let Some(m) = &momentum {
                state.moments = [
                    device.values(m.momentum.moment_1.clone())?,
                    device.values(m.momentum.moment_2.clone())?,
                ];
            }
            if state.parameters.iter().any(|p| !p.is_finite()) {
                return Err(Error::Diverged {
                    iteration: state.epoch,
                    what: "a parameter",
                });
            }
            let held = loss::<D, R>(
                &parameters,
                width,
                &layers,
                held_spheres.clone(),
                held_targets.clone(),
            );
            let progress = TrainingProgress {
                iteration: state.epoch,
                of: self.epochs,
                training_loss: sum / batches,
                held_out_loss: device.scalar(held)?,
            };
            progress.tell(observer, &state)?;
        }
        let (kernel, activation) = state.parameters.split_at(kernel.len());
        let activation = Mlp::new(layers, activation.to_vec())?;
        Ok((kernel.to_vec(), activation))
    }
}

impl Recipe for AdamParams {
    type State = AdamState;

    fn train(
        &self,
        data: &SphereData,
        seed: u64,
        state: Option<AdamState>,
        device: &ComputeDevice,
        observer: &mut TrainingObserver<'_, AdamState>,
    ) -> Result<(Vec<f64>, Mlp), Error> {
        if data.ratios.dimension == 2 {
            self.train_in::<2, 3>(data, seed, state, device, observer)
        } else {
            self.train_in::<3, 4>(data, seed, state, device, observer)
        }
    }

    fn describe(&self, data: &SphereData, iterations: usize) -> String {
        format!(
            "Adam, {} radii, batches of {}, {iterations} epochs, learning rate {} to {}",
            data.count, self.batch, self.learning_rate, self.final_learning_rate
        )
    }
}

/// The paper's start: the kernel is zero, the activation's parameters are normally distributed. The paper gives no standard deviation; here
/// it is `1/sqrt(inputs of the layer)`, so that the Gaussian units begin neither flat nor saturated.
pub fn paper_start(data: &SphereData, seed: u64) -> (Vec<f64>, Mlp) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let layers = crate::PAPER_LAYERS.to_vec();
    let mut parameters = Vec::with_capacity(crate::parameter_count(&layers));
    for pair in layers.windows(2) {
        let [inputs, outputs] = [pair[0], pair[1]];
        let deviation = 1.0 / (inputs as f64).sqrt();
        parameters.extend((0..(inputs + 1) * outputs).map(|_| {
            // The sum of twelve uniform numbers is normal enough for a start.
            let normal: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
            deviation * normal
        }));
    }
    let activation = Mlp::new(layers, parameters).expect("the paper's layers, finite numbers");
    (vec![0.0; data.ratios.kernel_len()], activation)
}

/// A kernel on a grid of half the spacing: multilinear interpolation, scaled by `2^-D` since it approximates `h^D` times a
/// density. The width goes from `n` to `2 n - 1`.
pub fn refine_kernel(kernel: &[f64], dimension: usize, width: usize) -> (Vec<f64>, usize) {
    let fine = 2 * width - 1;
    let mut values = kernel.to_vec();
    let mut shape = vec![width; dimension];
    for axis in 0..dimension {
        let inner: usize = shape[axis + 1..].iter().product();
        let outer: usize = shape[..axis].iter().product();
        let mut next = vec![0.0; outer * fine * inner];
        for o in 0..outer {
            for i in 0..fine {
                for k in 0..inner {
                    let at = |j: usize| values[(o * width + j) * inner + k];
                    let value = if i.is_multiple_of(2) {
                        at(i / 2)
                    } else {
                        0.5 * (at(i / 2) + at(i / 2 + 1))
                    };
                    next[(o * fine + i) * inner + k] = 0.5 * value;
                }
            }
        }
        values = next;
        shape[axis] = fine;
    }
    (values, fine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::levenberg_marquardt::heat_kernel;
    use crate::training::tests::{ratios, resumes_with_the_same_bytes};

    fn data(dimension: usize) -> SphereData {
        SphereData {
            ratios: ratios(dimension, 9),
            cells: 32,
            radii: [0.2, 0.3],
            count: 4,
        }
    }

    fn params() -> AdamParams {
        AdamParams {
            epochs: 4,
            batch: 2,
            held_out: 2,
            ..AdamParams::default()
        }
    }

    #[test]
    fn resumes_with_the_same_bytes_and_lowers_the_loss() {
        for dimension in [2, 3] {
            let mut data = data(dimension);
            data.cells = if dimension == 2 { 32 } else { 16 };
            // Stopped after two epochs of the same schedule.
            let losses = resumes_with_the_same_bytes(&params(), &data, 3, 2);
            assert!(losses[3] < losses[0], "{dimension}D {losses:?}");
        }
    }

    #[test]
    fn refinement_keeps_mass_and_linear_kernels() {
        for dimension in [2, 3] {
            let kernel = heat_kernel(data(dimension).ratios);
            let (fine, width) = refine_kernel(&kernel, dimension, 9);
            assert_eq!((width, fine.len()), (17, 17_usize.pow(dimension as u32)));
            let (coarse_sum, fine_sum): (f64, f64) = (kernel.iter().sum(), fine.iter().sum());
            // Half of the outermost cells is lost: for this narrow kernel 0.5 % of the mass in 2D and 0.8 % in 3D.
            assert!(
                (coarse_sum - fine_sum).abs() < 1e-2,
                "{coarse_sum} {fine_sum}"
            );
            let middle = fine.len() / 2;
            let expected = kernel[kernel.len() / 2] / 2_f64.powi(dimension as i32);
            assert!((fine[middle] - expected).abs() < 1e-15);
        }
    }
}
