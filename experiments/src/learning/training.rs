//! Training of corrections with Adam: on exact steps, and on the energy of the minimizing movement.

use burn::optim::{Adam, AdamConfig, Optimizer};
use burn::tensor::Tensor;
use direct::DirectSteps;
use geometry::parallel;
use model::{MeanCurvatureOperator, Shipped};
use solver::{FlowParams, MinimizingMovement, Objective, Problem};

use super::corrections::{Form, Network, Rows};
use super::curves::Pair;
use crate::prelude::libraries::*;

/// Interface width of the minimizing movement in spacings, and the width of the kernel of its operator in nodes.
const EPS: f64 = 2.0;
const KERNEL: usize = 17;
/// The profile is taken to be pure beyond this distance, in interface widths.
const PURE: f64 = 5.0;

/// Settings of the training.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct AdamParams {
    /// Steps, each with all data.
    pub steps: usize,
    /// Learning rate of the first step, and of the last one; geometric in between.
    pub rates: [f64; 2],
}

/// A network, and its loss before and after the training.
pub type Taught = (Network, [f64; 2]);

/// Rows of a pair at nodes.
fn rows(form: Form, pair: &Pair<'_>, nodes: &[usize]) -> Rows {
    let (steps, before) = (DirectSteps::new(pair.example.grid), &pair.example.distances);
    form.rows(&steps, before, &pair.derived, pair.tau, nodes)
}

/// Roots of the mean squares of columns.
fn sizes(values: &[f64], columns: usize) -> Vec<f64> {
    let mut sums = vec![0.0; columns];
    for (k, value) in values.iter().enumerate() {
        sums[k % columns] += value * value;
    }
    let count = (values.len() / columns).max(1) as f64;
    let root = |sum: f64| (sum / count).sqrt().max(f64::MIN_POSITIVE);
    sums.into_iter().map(root).collect()
}

/// Adam on a loss of the parameters of a network.
fn descend(
    network: &mut Network,
    params: AdamParams,
    device: &ComputeDevice,
    mut loss: impl FnMut(&Network, Tensor<1>) -> Result<(Tensor<1>, f64)>,
) -> Result<[f64; 2]> {
    let adam: Adam = AdamConfig::new().with_epsilon(1e-10).build();
    let count = network.parameters.len();
    let mut parameters = device.tensor::<1>(&network.parameters, [count]);
    let (mut momentum, mut losses): (_, Option<[f64; 2]>) = (None, None);
    let [first, last] = params.rates;
    for step in 0..params.steps {
        let progress = step as f64 / (params.steps.max(2) - 1) as f64;
        let rate = first * (last / first).powf(progress);
        let variable = parameters.clone().autodiff().require_grad();
        let (graph, value) = loss(network, variable.clone())?;
        let gradient = variable.grad(&graph.backward());
        let gradient = gradient.ok_or("the loss does not depend on the parameters")?;
        require(
            value.is_finite(),
            format!("the loss is {value} in step {step} of the training"),
        )?;
        losses = Some([losses.map_or(value, |[before, _]| before), value]);
        (parameters, momentum) = adam.step(rate, parameters, gradient, momentum);
    }
    network.parameters = device.values(parameters)?;
    Ok(losses.ok_or("a training has at least one step")?)
}

/// The same order of sums on every machine.
fn in_order<T: Send>(work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
    pool.map_err(|e| format!("cannot start threads: {e}"))?
        .install(work)
}

/// Teaches a correction what direct steps miss. The loss is the mean over pairs of the squared error over that of the derived step, so that long steps,
/// which miss more, do not outweigh the others. Where the derived step misses less than a hundredth of the motion, it is that hundredth.
///
/// # Errors
/// Without a step or a pair, or if the loss is not finite.
pub fn from_pairs(
    form: Form,
    pairs: &[&Pair<'_>],
    params: AdamParams,
    seed: u64,
    device: &ComputeDevice,
) -> Result<Taught> {
    const LEAST: f64 = 0.01;
    let (mut all, mut missed, mut weights) = (Rows::default(), Vec::new(), Vec::new());
    for &pair in pairs {
        let own = rows(form, pair, &pair.taught);
        all.inputs.extend(own.inputs);
        all.factors.extend(own.factors);
        let nodes = pair.taught.iter().zip(&pair.targets);
        let own: Vec<f64> = nodes
            .map(|(node, exact)| pair.derived.distances[*node] - exact)
            .collect();
        let size = sizes(&own, 1)[0].hypot(LEAST * pair.motion()[0]);
        missed.extend(own);
        let weight = size.recip() / ((pairs.len() * pair.taught.len()) as f64).sqrt();
        weights.resize(missed.len(), weight);
    }
    let scales = scales(&all, &missed);
    let mut network = Network::zero(form, scales, seed);
    let count = missed.len();
    let losses = in_order(|| {
        let [missed, weights] = [&missed, &weights].map(|v| device.tensor::<1>(v, [count]));
        let uploaded = network.upload(&all, device);
        descend(&mut network, params, device, |network, parameters| {
            let error =
                (network.forward(&parameters, &uploaded) - missed.clone()) * weights.clone();
            let loss = (error.clone() * error).sum();
            let value = device.scalar(loss.clone().inner())?;
            Ok((loss, value))
        })
    })?;
    Ok((network, losses))
}

/// Typical inputs, and what the outputs are if each alone makes corrections of the usual size.
fn scales(rows: &Rows, corrections: &[f64]) -> [Vec<f64>; 2] {
    let columns = |values: &[f64]| values.len() / corrections.len();
    let size = sizes(corrections, 1)[0];
    let outputs = sizes(&rows.factors, columns(&rows.factors));
    let inputs = sizes(&rows.inputs, columns(&rows.inputs));
    [
        inputs,
        outputs.into_iter().map(|factor| size / factor).collect(),
    ]
}

/// The minimizing movement from the start of a pair.
struct Movement<'a> {
    pair: &'a Pair<'a>,
    eps: f64,
    energy: MinimizingMovement<2>,
    /// Nodes near the interface, whose feet are corrected.
    nodes: Vec<usize>,
    /// The energy of the derived step, and the part `1/2 |u - a|^2` of it.
    derived: f64,
    motion: f64,
}

/// The scheme with the network of the accurate recipe on a grid.
fn problem(grid: &Grid<2>, device: &ComputeDevice) -> Result<Problem<2>> {
    let h = grid.spacing();
    let mut params = FlowParams::paper(EPS * h, h * h);
    let network = Shipped::Accurate.find(params.ratios(grid, KERNEL))?;
    params.calibration = network.calibration()?.factors;
    let operator = MeanCurvatureOperator::new(&network, device)?;
    Ok(Problem::new(operator, grid, params, device)?)
}

impl<'a> Movement<'a> {
    fn new(pair: &'a Pair<'a>, device: &ComputeDevice) -> Result<Self> {
        let (grid, derived) = (&pair.example.grid, &pair.derived.distances);
        let problem = problem(grid, device)?;
        let (eps, cells) = (problem.params.eps, grid.cells());
        let phase = |distances: &[f64]| -> Vec<f64> {
            let value = |node: usize| optimal_profile(distances[node], eps);
            parallel::values(distances.len(), value)
        };
        let (before, after) = (phase(&pair.example.distances), phase(derived));
        let gaps = before.iter().zip(&after).map(|(a, b)| (a - b).powi(2));
        let motion = 0.5 * gaps.sum::<f64>();
        let stiffness = problem.params.stiffness(pair.tau);
        let mut energy = MinimizingMovement::new(problem.operator, cells, device)?;
        energy.set(&device.tensor(&before, grid.shape()), stiffness)?;
        let derived_energy = energy.value(&device.tensor(&after, grid.shape()))?;
        let nodes = 0..derived.len();
        Ok(Self {
            pair,
            eps,
            energy,
            nodes: nodes
                .filter(|node| derived[*node].abs() < PURE * eps)
                .collect(),
            derived: derived_energy,
            motion,
        })
    }

    /// The nodes next to the feet of the corrected ones.
    fn feet(&self) -> Vec<usize> {
        let made = &self.pair.derived;
        let foot = |node: &usize| made.points[made.nearest[*node] as usize].position;
        let grid = &self.pair.example.grid;
        self.nodes
            .iter()
            .map(|node| grid.nearest(foot(node)))
            .collect()
    }

    /// By how much the energy is above that of the derived step, over that of its motion, and the derivatives by the corrections of the nodes.
    fn evaluate(&mut self, corrections: &[f64], device: &ComputeDevice) -> Result<(f64, Vec<f64>)> {
        let (eps, mut distances) = (self.eps, self.pair.derived.distances.clone());
        for (node, correction) in self.nodes.iter().zip(corrections) {
            distances[*node] -= correction;
        }
        let value = |node: usize| optimal_profile(distances[node], eps);
        let u = parallel::values(distances.len(), value);
        let (energy, gradient) =
            (self.energy).evaluate(&device.tensor(&u, self.pair.example.grid.shape()))?;
        let gradient = device.values(gradient)?;
        // `q' = -3/4 (1 - u^2) / eps`, and a correction lowers the distance.
        let by_correction = |node: &usize| gradient[*node] * 0.75 * (1.0 - u[*node].powi(2)) / eps;
        let derivatives = self
            .nodes
            .iter()
            .map(|node| by_correction(node) / self.motion);
        Ok(((energy - self.derived) / self.motion, derivatives.collect()))
    }
}

/// Teaches a correction without exact flows: it lowers the energies of the minimizing movements from the starts of the pairs, each over that of its motion.
/// The phase field is that of the distances after the step; the correction at a node is the one at its foot.
///
/// # Errors
/// As [`from_pairs`]; those of the energy.
pub fn from_energy(
    form: Form,
    pairs: &[&Pair<'_>],
    params: AdamParams,
    seed: u64,
    device: &ComputeDevice,
) -> Result<Taught> {
    /// Corrections are expected to be this part of the motion.
    const EXPECTED: f64 = 0.03;
    let movements = pairs.iter().map(|pair| Movement::new(pair, device));
    let mut movements = movements.collect::<Result<Vec<_>>>()?;
    let (mut all, mut moved) = (Rows::default(), Vec::new());
    for movement in &movements {
        let (pair, feet) = (movement.pair, movement.feet());
        let own = rows(form, pair, &feet);
        all.inputs.extend(own.inputs);
        all.factors.extend(own.factors);
        let gaps = feet
            .iter()
            .map(|node| pair.derived.distances[*node] - pair.example.distances[*node]);
        moved.extend(gaps.map(|gap| EXPECTED * gap));
    }
    let scales = scales(&all, &moved);
    let mut network = Network::zero(form, scales, seed);
    let losses = in_order(|| {
        let uploaded = network.upload(&all, device);
        descend(&mut network, params, device, |network, parameters| {
            let graph = network.forward(&parameters, &uploaded);
            let corrections = device.values(graph.clone().inner())?;
            let (mut rest, mut loss, mut derivatives) = (&corrections[..], 0.0, Vec::new());
            for movement in &mut movements {
                let (own, others) = rest.split_at(movement.nodes.len());
                let (energy, by_correction) = movement.evaluate(own, device)?;
                (rest, loss) = (others, loss + energy);
                derivatives.extend(by_correction);
            }
            // Its gradient is that of the sum of the energies.
            let derivatives = device.tensor::<1>(&derivatives, [derivatives.len()]);
            Ok(((graph * derivatives).sum(), loss / pairs.len() as f64))
        })
    })?;
    Ok((network, losses))
}

/// What the loss of [`from_energy`] is for the exact steps: above zero, they have more energy than the derived ones.
///
/// # Errors
/// Those of the exact flow and of the energy.
pub fn energy_of_exact_steps(pairs: &[&Pair<'_>], device: &ComputeDevice) -> Result<f64> {
    let mut sum = 0.0;
    for &pair in pairs {
        let (example, mut movement) = (pair.example, Movement::new(pair, device)?);
        let exact = example.exact(&[pair.tau])?.remove(0).signed_distance();
        let missed = |node: &usize| pair.derived.distances[*node] - exact(example.grid.node(*node));
        let corrections: Vec<f64> = movement.feet().iter().map(missed).collect();
        sum += movement.evaluate(&corrections, device)?.0;
    }
    Ok(sum / pairs.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::{Correction, Curves};

    #[test]
    fn the_energy_has_the_derivatives_of_its_differences() {
        let device = ComputeDevice::default_compiled().unwrap();
        let circle = Curves::new(2, 0).circle("circle").unwrap();
        let pair = circle.pair(1e-3).unwrap();
        let mut movement = Movement::new(&pair, &device).unwrap();
        let bend = |node: &usize| 1e-5 * (3.0 * circle.grid.node(*node)[0]).sin();
        let way: Vec<f64> = movement.nodes.iter().map(bend).collect();
        let mut energy = |size: f64| {
            let corrections: Vec<f64> = way.iter().map(|part| size * part).collect();
            movement.evaluate(&corrections, &device).unwrap()
        };
        let (derivatives, [ahead, behind]) =
            (energy(0.0).1, [1.0, -1.0].map(|size| energy(size).0));
        let derivative: f64 = derivatives.iter().zip(&way).map(|(a, b)| a * b).sum();
        let difference = 0.5 * (ahead - behind);
        assert!(
            (derivative / difference - 1.0).abs() < 1e-3,
            "{derivative} {difference}"
        );
    }

    #[test]
    fn circles_teach_the_curvature_what_steps_miss_of_circles() {
        let device = ComputeDevice::default_compiled().unwrap();
        let mut curves = Curves::new(4, 0);
        let [taught, other] = ["taught", "other"].map(|name| curves.circle(name).unwrap());
        let (taught, other) = (taught.pair(1e-3).unwrap(), other.pair(1e-3).unwrap());
        let params = AdamParams {
            steps: 300,
            rates: [1e-2, 1e-3],
        };
        let (network, [before, after]) =
            from_pairs(Form::Curvature, &[&taught], params, 1, &device).unwrap();
        assert!(after < 0.1 * before, "{before} {after}");
        let mut steps = DirectSteps::new(other.example.grid);
        let correction = Correction::Learned(network);
        let start = &other.example.distances;
        let learned = correction
            .step(&mut steps, start, other.tau, &device)
            .unwrap();
        let [learned, derived] = [&learned, &other.derived.distances].map(|d| other.errors(d)[0]);
        assert!(learned < 0.5 * derived, "{learned} {derived}");
    }
}
