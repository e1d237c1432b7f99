//! Levenberg-Marquardt training: all parameters at once, from a good start.
//!
//! The residuals `F(K * u_r) - u_R` of 25 000 sampled points depend on about a thousand parameters, so that the full
//! Gauss-Newton matrix is affordable and converges where Adam crawls. The Jacobian comes from Burn's autodiff: one backward
//! pass of `sum F` yields, on leaves added to every layer's pre-activation, the derivative of each row's output; the rows
//! of the Jacobian are products of those with the layers' inputs.

use burn::tensor::{DType, Tensor};
use chacha20::ChaCha8Rng;
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Side};
use operators::ComputeDevice;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use super::{BandSamples, Orbits, Recipe, SphereData, TrainingObserver, TrainingProgress};
use crate::mlp::{forward, forward_with, layout, parameter_count};
use crate::ratios::offsets;
use crate::{Error, Mlp, PAPER_LAYERS, Ratios};

/// Rows of the Jacobian assembled at once.
const CHUNK: usize = 2048;

/// Settings of the training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LmParams {
    /// Number of strata across the interface band, per radius.
    pub shells: usize,
    /// Number of random points per stratum.
    pub directions: usize,
    /// Weight of the exchanged phases `-u` in the loss.
    pub flipped: f64,
    /// Ridge of the kernel toward the heat kernel; keeps its transfer function in `[0, 1]` where the data do not determine it.
    pub kernel_ridge: f64,
    /// Ridge of the activation's parameters.
    pub activation_ridge: f64,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Number of random starts of the activation.
    pub starts: usize,
    /// Stop when the held-out loss has not improved by one percent over this many iterations.
    pub patience: usize,
}

impl Default for LmParams {
    fn default() -> Self {
        Self {
            shells: 32,
            directions: 4,
            flipped: 0.25,
            kernel_ridge: 1e-4,
            activation_ridge: 1e-9,
            iterations: 300,
            starts: 2,
            patience: 40,
        }
    }
}

/// State between iterations; what a checkpoint holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LmState {
    /// Kernel (one value per orbit), then activation parameters.
    pub parameters: Vec<f64>,
    /// Damping of the next step: the diagonal of the Gauss-Newton matrix is multiplied by one plus this.
    pub damping: f64,
    /// Finished iterations.
    pub iteration: usize,
    /// Best parameters on the held-out samples and their loss.
    pub best: Vec<f64>,
    /// Held-out loss of [`Self::best`].
    pub best_loss: f64,
    /// Iteration of the last improvement by one percent.
    pub improved_at: usize,
    /// Held-out loss at that iteration.
    pub improved_to: f64,
}

/// `residual_i = sqrt(weight_i) (F(design k)_i - target_i)`, or combinations of these, with ridges.
pub(super) struct Problem<'a> {
    design: Tensor<2>,
    target: Tensor<1>,
    root_weight: Tensor<1>,
    rows: usize,
    orbits: usize,
    /// Ridge per parameter and the values it pulls to.
    ridge: Vec<f64>,
    centre: Vec<f64>,
    /// Gradient of the kernel's sum, which is held at 1 so that `F(+-1) = +-1`.
    sum: Vec<f64>,
    /// A matrix by which the residuals are multiplied. The rows then make a single chunk.
    pub(super) mix: Option<Mat<f64>>,
    device: &'a ComputeDevice,
}

/// Weight of `(sum K - 1)^2`, relative to the loss of the identity map.
const SUM_WEIGHT: f64 = 1e3;

/// Value, gradient and Gauss-Newton matrix of half the squared residual norm.
struct Normal {
    value: f64,
    gradient: Vec<f64>,
    matrix: Mat<f64>,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        samples: &BandSamples,
        sizes: &[usize],
        ridge: Vec<f64>,
        centre: Vec<f64>,
        device: &'a ComputeDevice,
    ) -> Self {
        let (rows, orbits) = (samples.target.len(), sizes.len());
        // Relative to the identity map, so that ridges mean the same for every network.
        let scale = 1.0 / samples.identity_loss;
        let root: Vec<f64> = samples.weight.iter().map(|w| (w * scale).sqrt()).collect();
        Self {
            design: device.tensor(&samples.design, [rows, orbits]),
            target: device.tensor(&samples.target, [rows]),
            root_weight: device.tensor(&root, [rows]),
            rows,
            orbits,
            ridge,
            centre,
            sum: sizes.iter().map(|&s| s as f64).collect(),
            mix: None,
            device,
        }
    }

    /// The activation of the paper's layers alone, with this ridge toward 0.
    pub(super) fn of_activation(
        samples: &BandSamples,
        ridge: f64,
        device: &'a ComputeDevice,
    ) -> Self {
        let n = parameter_count(&PAPER_LAYERS);
        // One "orbit" whose value is frozen at 1 by an overwhelming ridge.
        let (mut weights, mut centre) = (vec![ridge; n + 1], vec![0.0; n + 1]);
        (weights[0], centre[0]) = (1e12, 1.0);
        Self::new(samples, &[1], weights, centre, device)
    }

    /// Loss and parameters after so many steps from `x`, fewer if none lowers the value; `observe` is told the parameters, the first one being
    /// the orbit, after each.
    pub(super) fn fit_activation(
        &self,
        x: Vec<f64>,
        iterations: usize,
        mut observe: impl FnMut(&[f64]) -> Result<(), Error>,
    ) -> Result<(f64, Vec<f64>), Error> {
        let mut all = [vec![1.0], x].concat();
        let mut damping = 1e-3;
        for _ in 0..iterations {
            let Some(next) = self.step(&all, &mut damping)? else {
                break;
            };
            all = next;
            observe(&all)?;
        }
        let (loss, _) = self.value(&all)?;
        Ok((loss, all.split_off(1)))
    }

    fn ridge_value(&self, x: &[f64]) -> f64 {
        let terms = x.iter().zip(&self.centre).zip(&self.ridge);
        let ridge: f64 = terms.map(|((x, c), r)| r * (x - c) * (x - c)).sum();
        ridge + SUM_WEIGHT * self.sum_defect(x).powi(2)
    }

    fn sum_defect(&self, x: &[f64]) -> f64 {
        self.sum.iter().zip(x).map(|(s, x)| s * x).sum::<f64>() - 1.0
    }

    /// Squared norm of the residual without and with the ridge.
    pub(super) fn value(&self, x: &[f64]) -> Result<(f64, f64), Error> {
        let (kernel, activation) = self.split(x);
        let z = self.design.clone().matmul(kernel);
        let f = forward(&PAPER_LAYERS, &activation, z);
        let residual = (f.reshape([self.rows]) - self.target.clone()) * self.root_weight.clone();
        let loss = match &self.mix {
            None => self.device.scalar((residual.clone() * residual).sum())?,
            Some(mix) => {
                let residual = self.device.values(residual)?;
                let residual = MatRef::from_column_major_slice(&residual, self.rows, 1);
                (mix * residual).squared_norm_l2()
            }
        };
        Ok((loss, loss + self.ridge_value(x)))
    }

    fn split(&self, x: &[f64]) -> (Tensor<2>, Tensor<1>) {
        let (kernel, activation) = x.split_at(self.orbits);
        (
            self.device.tensor(kernel, [self.orbits, 1]),
            self.device.tensor(activation, [activation.len()]),
        )
    }

    /// Weighted Jacobian `[rows, parameters]` and residual of a block of rows.
    fn block(&self, x: &[f64], start: usize, end: usize) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let rows = end - start;
        let (kernel, activation) = self.split(x);
        let design = self.design.clone().slice([start..end, 0..self.orbits]);
        let root = self
            .root_weight
            .clone()
            .slice([start..end])
            .reshape([rows, 1]);

        let z = design.clone().matmul(kernel).autodiff().require_grad();
        let activation = activation.autodiff();
        let mut leaves = Vec::new();
        let mut inputs = Vec::new();
        let device = z.device();
        let f = forward_with(&PAPER_LAYERS, &activation, z.clone(), |preactivation| {
            let leaf =
                Tensor::<2>::zeros(preactivation.dims(), (&device, DType::F64)).require_grad();
            leaves.push(leaf.clone());
            let sum = preactivation + leaf;
            inputs.push(sum.clone());
            sum
        });
        let gradients = f.clone().sum().backward();
        let missing = || Error::Training("autodiff returned no gradient for a layer".to_owned());
        let slope = z.grad(&gradients).ok_or_else(missing)?;

        let mut columns = vec![design * slope];
        let mut input = z.inner();
        for (leaf, preactivation) in leaves.iter().zip(inputs) {
            let delta = leaf.grad(&gradients).ok_or_else(missing)?;
            let ([_, outputs], [_, width]) = (delta.dims(), input.dims());
            let outer: Tensor<3> =
                input.reshape([rows, width, 1]) * delta.clone().reshape([rows, 1, outputs]);
            columns.push(outer.reshape([rows, width * outputs]));
            columns.push(delta);
            let a = preactivation.inner();
            input = (a.clone() * a).neg().exp();
        }
        let jacobian = Tensor::cat(columns, 1) * root.clone();
        let target = self.target.clone().slice([start..end]).reshape([rows, 1]);
        let residual = (f.inner() - target) * root;
        Ok((self.device.values(jacobian)?, self.device.values(residual)?))
    }

    fn normal(&self, x: &[f64]) -> Result<Normal, Error> {
        let n = x.len();
        let mut matrix = Mat::<f64>::zeros(n, n);
        let mut gradient = vec![0.0; n];
        let mut value = self.ridge_value(x);
        for start in (0..self.rows).step_by(CHUNK) {
            let end = (start + CHUNK).min(self.rows);
            let (jacobian, residual) = self.block(x, start, end)?;
            let jacobian = MatRef::from_row_major_slice(&jacobian, end - start, n);
            let residual = MatRef::from_column_major_slice(&residual, end - start, 1);
            let mixed = (self.mix.as_ref()).map(|mix| (mix * jacobian, mix * residual));
            let (jacobian, residual) = match &mixed {
                Some((jacobian, residual)) => (jacobian.as_ref(), residual.as_ref()),
                None => (jacobian, residual),
            };
            use faer::linalg::matmul::triangular::{BlockStructure, matmul};
            matmul(
                matrix.as_mut(),
                BlockStructure::TriangularLower,
                faer::Accum::Add,
                jacobian.transpose(),
                BlockStructure::Rectangular,
                jacobian,
                BlockStructure::Rectangular,
                1.0,
                faer::get_global_parallelism(),
            );
            let product = jacobian.transpose() * residual;
            for (g, i) in gradient.iter_mut().zip(0..n) {
                *g += product[(i, 0)];
            }
            value += residual.squared_norm_l2();
        }
        for i in 0..n {
            matrix[(i, i)] += self.ridge[i];
            gradient[i] += self.ridge[i] * (x[i] - self.centre[i]);
        }
        let defect = self.sum_defect(x);
        for (i, a) in self.sum.iter().enumerate() {
            gradient[i] += SUM_WEIGHT * defect * a;
            for (j, b) in self.sum[..=i].iter().enumerate() {
                matrix[(i, j)] += SUM_WEIGHT * a * b;
            }
        }
        Ok(Normal {
            value,
            gradient,
            matrix,
        })
    }

    /// Accepts the first damped step that lowers the value; `None` if none does.
    pub(super) fn step(&self, x: &[f64], damping: &mut f64) -> Result<Option<Vec<f64>>, Error> {
        let normal = self.normal(x)?;
        let n = x.len();
        let largest = (0..n).map(|i| normal.matrix[(i, i)]).fold(0.0, f64::max);
        let right = Mat::from_fn(n, 1, |i, _| -normal.gradient[i]);
        let mut growth = 2.0;
        for _ in 0..14 {
            let mut damped = normal.matrix.clone();
            for i in 0..n {
                damped[(i, i)] += *damping * (normal.matrix[(i, i)] + 1e-12 * largest);
            }
            if let Ok(factor) = damped.llt(Side::Lower) {
                let step = factor.solve(&right);
                let trial: Vec<f64> = (0..n).map(|i| x[i] + step[(i, 0)]).collect();
                let (_, value) = self.value(&trial)?;
                if value.is_finite() && value < normal.value {
                    let slope: f64 = (0..n).map(|i| normal.gradient[i] * step[(i, 0)]).sum();
                    let damping_term: f64 = (0..n)
                        .map(|i| *damping * normal.matrix[(i, i)] * step[(i, 0)] * step[(i, 0)])
                        .sum();
                    // The model predicts a drop of -g.s - s.H.s = -g.s + s.D s, since (H + D) s = -g.
                    let predicted = -slope + damping_term;
                    let ratio = (normal.value - value) / predicted.max(f64::MIN_POSITIVE);
                    let factor = (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(0.2, 3.0);
                    *damping = (*damping * factor).clamp(1e-14, 1e10);
                    return Ok(Some(trial));
                }
            }
            *damping *= growth;
            growth = f64::min(2.0 * growth, 16.0);
        }
        Ok(None)
    }
}

/// The heat kernel of variance `2 tautilde` per axis, sampled and normalized: the kernel of the splitting scheme.
pub fn heat_kernel(ratios: Ratios) -> Vec<f64> {
    let mut kernel: Vec<f64> = offsets(ratios.dimension, ratios.width)
        .map(|b| {
            let squared: f64 = b.iter().map(|&b| (b * b) as f64).sum();
            (-squared / (4.0 * ratios.step_over_h2)).exp()
        })
        .collect();
    let sum: f64 = kernel.iter().sum();
    for k in &mut kernel {
        *k /= sum;
    }
    kernel
}

/// The activation of the splitting scheme: the inverse of `phi(v) = v + tautilde / (2 eps^2) Psi'(v)`.
pub fn splitting_activation(step_over_eps2: f64, w: f64) -> f64 {
    let c = 9.0 / 8.0 * step_over_eps2;
    let mut v = w.clamp(-1.5, 1.5);
    for _ in 0..60 {
        let phi = v - c * v * (1.0 - v * v);
        let slope = 1.0 - c * (1.0 - 3.0 * v * v);
        v -= (phi - w) / slope;
    }
    v
}

/// Range over which the start imitates [`splitting_activation`].
const START_RANGE: f64 = 1.4;

/// Fits perceptrons from several random starts to the splitting scheme's activation and returns the best.
pub fn splitting_start(
    step_over_eps2: f64,
    params: &LmParams,
    seed: u64,
    device: &ComputeDevice,
) -> Result<Mlp, Error> {
    let count = 401;
    let w: Vec<f64> = (0..count)
        .map(|i| START_RANGE * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0))
        .collect();
    let samples = BandSamples {
        target: w
            .iter()
            .map(|&w| splitting_activation(step_over_eps2, w))
            .collect(),
        weight: vec![1.0 / f64::from(count); w.len()],
        identity_loss: 1.0,
        design: w,
    };
    let parameters = best_start(params.starts, seed, |mut x| {
        let mut best = (f64::INFINITY, x.clone());
        for ridge in [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10] {
            let problem = Problem::of_activation(&samples, ridge, device);
            let loss;
            (loss, x) = problem.fit_activation(x, 15, |_| Ok(()))?;
            if loss < best.0 {
                best = (loss, x.clone());
            }
        }
        Ok(best)
    })?;
    Mlp::new(PAPER_LAYERS.to_vec(), parameters)
}

/// The parameters with the smallest loss that `fit` finds from several random starts; the first that are good enough are taken.
pub(super) fn best_start(
    starts: usize,
    seed: u64,
    mut fit: impl FnMut(Vec<f64>) -> Result<(f64, Vec<f64>), Error>,
) -> Result<Vec<f64>, Error> {
    const GOOD: f64 = 1e-9;
    let mut best = (f64::INFINITY, Vec::new());
    for start in 0..starts.max(1) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(start as u64));
        let found = fit(random_activation(&mut rng))?;
        if start == 0 || found.0 < best.0 {
            best = found;
        }
        if best.0 < GOOD {
            break;
        }
    }
    Ok(best.1)
}

/// Parameters whose neurons cover the interval of interest.
fn random_activation(rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut normal = || {
        // Box-Muller
        let (a, b): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random_range(0.0..1.0));
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    };
    let mut parameters = Vec::with_capacity(parameter_count(&PAPER_LAYERS));
    for (l, layer) in layout(&PAPER_LAYERS).iter().enumerate() {
        let spread = if l == 0 {
            2.0
        } else {
            1.5 / (layer.inputs as f64).sqrt()
        };
        parameters.extend((0..layer.inputs * layer.outputs).map(|_| spread * normal()));
        let spread = if l == 0 { 1.2 } else { 0.3 };
        parameters.extend((0..layer.outputs).map(|_| spread * normal()));
    }
    parameters
}

impl LmParams {
    /// The settings of the shipped networks, or of a smoke test of seconds.
    pub fn new(quick: bool) -> Self {
        let mut params = Self::default();
        if quick {
            (params.iterations, params.directions, params.starts) = (8, 1, 1);
        }
        params
    }

    /// The splitting scheme: the given kernel, one value per orbit, and [`splitting_start`].
    fn start(
        &self,
        data: &SphereData,
        heat: &[f64],
        seed: u64,
        device: &ComputeDevice,
    ) -> Result<LmState, Error> {
        let activation = splitting_start(data.ratios.step_over_eps2(), self, seed, device)?;
        let parameters = [heat, activation.parameters()].concat();
        Ok(LmState {
            best: parameters.clone(),
            parameters,
            damping: 1e-3,
            iteration: 0,
            best_loss: f64::INFINITY,
            improved_at: 0,
            improved_to: f64::INFINITY,
        })
    }
}

impl Recipe for LmParams {
    type State = LmState;

    /// Kernel and activation are those that are best on held-out samples.
    fn train(
        &self,
        data: &SphereData,
        seed: u64,
        state: Option<LmState>,
        device: &ComputeDevice,
        observer: &mut TrainingObserver<'_, LmState>,
    ) -> Result<(Vec<f64>, Mlp), Error> {
        data.validate()?;
        let orbits = Orbits::new(data.ratios.dimension, data.ratios.width);
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5EED);
        let samples = |rng: &mut ChaCha8Rng, flipped: f64| {
            BandSamples::draw(data, &orbits, self.shells, self.directions, flipped, rng)
        };
        let (training, held_out) = (samples(&mut rng, self.flipped), samples(&mut rng, 0.0));
        let heat = orbits.average(&heat_kernel(data.ratios));
        let activation_len = parameter_count(&PAPER_LAYERS);
        let mut ridge: Vec<f64> = orbits
            .sizes
            .iter()
            .map(|&s| self.kernel_ridge * s as f64)
            .collect();
        ridge.extend(vec![self.activation_ridge; activation_len]);
        let centre = [heat.clone(), vec![0.0; activation_len]].concat();
        let n = orbits.count();
        let scale = training.identity_loss;
        let held_scale = held_out.identity_loss;
        let sizes = &orbits.sizes;
        let no_ridge = vec![0.0; ridge.len()];
        let held_out = Problem::new(&held_out, sizes, no_ridge, centre.clone(), device);
        let problem = Problem::new(&training, sizes, ridge, centre, device);
        drop(training);

        let mut state = match state {
            Some(state) => state,
            None => self.start(data, &heat, seed, device)?,
        };
        for found in [&state.parameters, &state.best] {
            Error::check_count("training checkpoint", n + activation_len, found.len())?;
        }
        while state.iteration < self.iterations
            && state.iteration <= state.improved_at + self.patience
        {
            let Some(next) = problem.step(&state.parameters, &mut state.damping)? else {
                break;
            };
            state.parameters = next;
            state.iteration += 1;
            let (loss, _) = problem.value(&state.parameters)?;
            let (held, _) = held_out.value(&state.parameters)?;
            let held = held * held_scale;
            if !held.is_finite() {
                return Err(Error::Diverged {
                    iteration: state.iteration,
                    what: "held-out loss",
                });
            }
            if held < state.best_loss {
                state.best_loss = held;
                state.best.clone_from(&state.parameters);
            }
            if held < 0.99 * state.improved_to {
                state.improved_to = held;
                state.improved_at = state.iteration;
            }
            let progress = TrainingProgress {
                iteration: state.iteration,
                of: self.iterations,
                training_loss: loss * scale,
                held_out_loss: held,
            };
            progress.tell(observer, &state)?;
        }
        let (kernel, activation) = state.best.split_at(n);
        let activation = Mlp::new(PAPER_LAYERS.to_vec(), activation.to_vec())?;
        Ok((orbits.expand(kernel), activation))
    }

    fn describe(&self, data: &SphereData, iterations: usize) -> String {
        format!(
            "Levenberg-Marquardt, {} radii, {} x {} points each, {iterations} iterations",
            data.count, self.shells, self.directions
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::tests::{ratios, resumes_with_the_same_bytes};

    fn data(dimension: usize) -> SphereData {
        SphereData {
            ratios: ratios(dimension, 9),
            cells: 64,
            radii: [0.1, 0.4],
            count: 8,
        }
    }

    fn params() -> LmParams {
        LmParams {
            shells: 12,
            directions: 2,
            iterations: 10,
            starts: 1,
            ..LmParams::default()
        }
    }

    fn problem<'a>(data: &SphereData, device: &'a ComputeDevice) -> (Problem<'a>, Vec<f64>) {
        let orbits = Orbits::new(data.ratios.dimension, data.ratios.width);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let samples = BandSamples::draw(data, &orbits, 12, 2, 0.25, &mut rng);
        let heat = orbits.average(&heat_kernel(data.ratios));
        let x = [heat, random_activation(&mut rng)].concat();
        let centre = x.iter().map(|x| 0.9 * x).collect();
        let ridge = vec![1e-2; x.len()];
        let problem = Problem::new(&samples, &orbits.sizes, ridge, centre, device);
        (problem, x)
    }

    /// `f(x + t p) - f(x) - 2 t g.p` is of second order in `t`, with the Gauss-Newton form as its main part near a fit.
    #[test]
    fn the_gradient_passes_the_taylor_test() {
        let device = ComputeDevice::default_compiled().unwrap();
        for dimension in [2, 3] {
            let (problem, x) = problem(&data(dimension), &device);
            let normal = problem.normal(&x).unwrap();
            let (_, value) = problem.value(&x).unwrap();
            assert!((value / normal.value - 1.0).abs() < 1e-10);
            let p: Vec<f64> = (0..x.len()).map(|i| 0.1 * (1.7 * i as f64).sin()).collect();
            let slope: f64 = normal.gradient.iter().zip(&p).map(|(g, p)| g * p).sum();
            let remainder = |t: f64| {
                let y: Vec<f64> = x.iter().zip(&p).map(|(x, p)| x + t * p).collect();
                // The value is the squared norm, the gradient that of half of it.
                (problem.value(&y).unwrap().1 - value - 2.0 * t * slope).abs()
            };
            let rate = (remainder(1e-4) / remainder(5e-5)).log2();
            assert!((rate - 2.0).abs() < 0.1, "{dimension}D: rate {rate}");
        }
    }

    #[test]
    fn training_lowers_the_loss_and_resumes_with_the_same_bytes() {
        for dimension in [2, 3] {
            let losses = resumes_with_the_same_bytes(&params(), &data(dimension), 2, 3);
            assert!(
                losses[losses.len() - 1] < 0.7 * losses[0],
                "{dimension}D {losses:?}"
            );
        }
    }

    #[test]
    fn the_splitting_activation_inverts_its_function() {
        for i in -14..=14 {
            let w = f64::from(i) / 10.0;
            let v = splitting_activation(0.25, w);
            let phi = v - 9.0 / 8.0 * 0.25 * v * (1.0 - v * v);
            assert!((phi - w).abs() < 1e-13);
        }
        assert!((splitting_activation(0.25, 1.0) - 1.0).abs() < 1e-14);
    }
}
