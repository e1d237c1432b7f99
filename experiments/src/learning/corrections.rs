//! Corrections of direct steps: small networks of what a step knows at a node.

use burn::tensor::Tensor;
use chacha20::ChaCha8Rng;
use direct::{DirectSteps, HeatKernel};
use geometry::{LevelPoint, Redistanced};
use rand::{RngExt, SeedableRng};

use crate::prelude::libraries::*;

/// Neurons of the hidden layer.
const HIDDEN: usize = 24;
/// Distances from the interface, in spacings, up to which steps are corrected: what lies beyond does not matter to the next step,
const BY_GEOMETRY: f64 = 7.0;
/// or to the spline through what the filters give.
const BY_FILTERS: f64 = 5.0;
/// Filters are read as distances up to this one, in spacings.
const READ: f64 = 8.0;

/// What a correction is a function of. With `s` and `s'` the distances before and after the derived step, `d = s' - s`, and `kappa` the curvature at
/// the foot of the node:
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `s' - tau kappa^3 N(tau kappa^4)`.
    Curvature,
    /// `s' - tau kappa^3 N_1 - d N_2` of `tau kappa^4` and `d kappa`.
    Geometry,
    /// `W = K * q - 2 l N(e)` with `l = tau^(1/4)`: a pointwise function of the four heat kernels alone, before redistancing. The network is odd, so that
    /// inside and outside are alike. `e` are the distances which a flat interface has where the filters have their values: the new distance by the
    /// derived kernel, and their divided differences over the times of the kernels, all without a unit.
    Filters,
}

impl Form {
    const fn inputs(self) -> usize {
        match self {
            Self::Curvature => 1,
            Self::Geometry => 2,
            Self::Filters => 4,
        }
    }

    const fn outputs(self) -> usize {
        match self {
            Self::Geometry => 2,
            Self::Curvature | Self::Filters => 1,
        }
    }

    /// Inputs and factors of the outputs at nodes, after a derived step from these distances.
    pub fn rows(
        self,
        steps: &DirectSteps<2>,
        before: &[f64],
        derived: &Redistanced<2>,
        tau: f64,
        nodes: &[usize],
    ) -> Rows {
        let mut rows = Rows::default();
        if self == Self::Filters {
            let kernel = steps.kernel(tau);
            let (unit, filters) = (tau.powf(0.25), steps.smoothed(before, tau));
            let limit = READ * steps.grid().spacing();
            for &node in nodes {
                let values = [0, 1, 2, 3].map(|i| filters[i][node]);
                let shape = filter_inputs(kernel.heat_kernels(), values, limit, unit);
                rows.inputs.extend(shape);
                rows.factors.push(unit);
            }
            return rows;
        }
        for &node in nodes {
            let point = derived.points.get(derived.nearest[node] as usize);
            let curvature = point.map_or(0.0, LevelPoint::mean_curvature);
            let moved = derived.distances[node] - before[node];
            rows.inputs.push(tau * curvature.powi(4));
            rows.factors.push(tau * curvature.powi(3));
            if self == Self::Geometry {
                rows.inputs.push(moved * curvature);
                rows.factors.push(moved);
            }
        }
        rows
    }
}

/// Newton's divided differences, over the times, of the distances that a flat interface has where the filters have these values; in place of the first
/// the new distance. In lengths of `unit`.
fn filter_inputs(
    heat_kernels: &[HeatKernel; 4],
    values: [f64; 4],
    limit: f64,
    unit: f64,
) -> [f64; 4] {
    let mut table = [0, 1, 2, 3].map(|i| flat_distance(&heat_kernels[i], values[i], limit) / unit);
    let weights = heat_kernels.iter().zip(table);
    let sum = weights.map(|(heat, distance)| heat.weight * distance).sum();
    for order in 1..4 {
        for i in (order..4).rev() {
            let gap = (heat_kernels[i].time - heat_kernels[i - order].time) / (unit * unit);
            table[i] = (table[i] - table[i - 1]) / gap;
        }
    }
    [sum, table[1], table[2], table[3]]
}

/// Where a flat interface has this value under a heat kernel, at most so far away.
fn flat_distance(heat: &HeatKernel, value: f64, limit: f64) -> f64 {
    const MOST: usize = 50;
    let (mut low, mut high) = (-limit, limit);
    let mut distance = (0.5 * value).clamp(low, high);
    for _ in 0..MOST {
        let [found, slope] = heat.flat(distance);
        let gap = found - value;
        if gap > 0.0 {
            high = distance;
        } else {
            low = distance;
        }
        let next = distance - gap / slope;
        let next = if next > low && next < high {
            next
        } else {
            0.5 * (low + high)
        };
        let step = (next - distance).abs();
        distance = next;
        if step < 1e-14 * limit {
            break;
        }
    }
    distance
}

/// What a network gets at nodes, row by row, and by what its outputs are multiplied.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    pub inputs: Vec<f64>,
    pub factors: Vec<f64>,
}

/// A perceptron of one hidden layer, `tanh`. That of filters has no constants, and is odd.
#[derive(Clone, Debug)]
pub struct Network {
    pub form: Form,
    /// Typical sizes of the inputs, and of what the outputs are to be.
    pub scales: [Vec<f64>; 2],
    /// Weights of the hidden layer, row by row, and of the outputs; then, unless it is odd, the constants of both.
    pub parameters: Vec<f64>,
}

impl Network {
    /// Zero, with random weights of the hidden layer.
    pub fn zero(form: Form, scales: [Vec<f64>; 2], seed: u64) -> Self {
        let (inputs, outputs) = (form.inputs(), form.outputs());
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let weights = (0..inputs * HIDDEN).map(|_| rng.random_range(-1.0..1.0));
        let mut parameters: Vec<f64> = weights.collect();
        parameters.resize(parameters.len() + HIDDEN * outputs, 0.0);
        if form != Form::Filters {
            parameters.extend((0..HIDDEN).map(|_| rng.random_range(-1.0..1.0)));
            parameters.resize(parameters.len() + outputs, 0.0);
        }
        Self {
            form,
            scales,
            parameters,
        }
    }

    /// The rows on a device: inputs and factors over their scales.
    pub fn upload(&self, rows: &Rows, device: &ComputeDevice) -> [Tensor<2>; 2] {
        let scaled = |values: &[f64], by: &dyn Fn(usize) -> f64, columns: usize| {
            let scaled: Vec<f64> = values
                .iter()
                .enumerate()
                .map(|(k, value)| value * by(k % columns))
                .collect();
            device.tensor::<2>(&scaled, [values.len() / columns, columns])
        };
        let [inputs, outputs] = &self.scales;
        [
            scaled(&rows.inputs, &|k| inputs[k].recip(), inputs.len()),
            scaled(&rows.factors, &|k| outputs[k], outputs.len()),
        ]
    }

    /// The corrections of uploaded rows, as a function of the parameters.
    pub fn forward(&self, parameters: &Tensor<1>, [inputs, factors]: &[Tensor<2>; 2]) -> Tensor<1> {
        let (m, n) = (self.form.inputs(), self.form.outputs());
        let mut start = 0;
        let mut next = |rows: usize, columns: usize| {
            let part = parameters.clone().slice([start..start + rows * columns]);
            start += rows * columns;
            part.reshape([rows, columns])
        };
        let (first, second) = (next(m, HIDDEN), next(HIDDEN, n));
        let (mut hidden, has_constants) =
            (inputs.clone().matmul(first), self.form != Form::Filters);
        if has_constants {
            hidden = hidden + next(1, HIDDEN);
        }
        let mut outputs = hidden.tanh().matmul(second);
        if has_constants {
            outputs = outputs + next(1, n);
        }
        (outputs * factors.clone()).sum_dim(1).flatten(0, 1)
    }

    /// The corrections of rows.
    pub fn corrections(&self, rows: &Rows, device: &ComputeDevice) -> Result<Vec<f64>> {
        let parameters = device.tensor::<1>(&self.parameters, [self.parameters.len()]);
        Ok(device.values(self.forward(&parameters, &self.upload(rows, device)))?)
    }
}

/// A direct step with or without a learned correction.
#[derive(Clone, Debug)]
pub enum Correction {
    None,
    Learned(Network),
}

impl Correction {
    /// The distances after a step.
    pub fn step(
        &self,
        steps: &mut DirectSteps<2>,
        before: &[f64],
        tau: f64,
        device: &ComputeDevice,
    ) -> Result<Vec<f64>> {
        let mut values = steps.convolved(before, tau);
        let derived = steps.finished(values.clone(), tau);
        let Self::Learned(network) = self else {
            return Ok(derived.distances);
        };
        let is_by_filters = network.form == Form::Filters;
        let limit = if is_by_filters {
            BY_FILTERS
        } else {
            BY_GEOMETRY
        } * steps.grid().spacing();
        let nodes = (0..before.len())
            .filter(|node| derived.distances[*node].abs() <= limit && before[*node].is_finite());
        let nodes: Vec<usize> = nodes.collect();
        let rows = network.form.rows(steps, before, &derived, tau, &nodes);
        let corrections = network.corrections(&rows, device)?;
        let mut distances = derived.distances;
        for (node, correction) in nodes.into_iter().zip(corrections) {
            values[node] -= 2.0 * correction;
            distances[node] -= correction;
        }
        if is_by_filters {
            distances = steps.finished(values, tau).distances;
        }
        Ok(distances)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::Curves;

    #[test]
    fn flat_interfaces_are_read_from_every_filter() {
        let steps = DirectSteps::new(Grid::<2>::centred(16, 1.6).unwrap());
        let kernel = steps.kernel(2e-3);
        for s in [-0.4, 0.0, 0.07] {
            let values = kernel.heat_kernels().map(|heat| heat.flat(s)[0]);
            let [distance, differences @ ..] =
                filter_inputs(kernel.heat_kernels(), values, 0.8, 0.2);
            assert!((0.2 * distance - s).abs() < 1e-9, "{distance}");
            assert!(
                differences.iter().all(|d| d.abs() < 1e-8),
                "{differences:?}"
            );
        }
        let far = flat_distance(&kernel.heat_kernels()[0], 1e9, 0.8);
        assert!((far - 0.8).abs() < 1e-9, "{far}");
    }

    /// Of the derived step, which adds nothing.
    #[test]
    fn a_network_that_is_zero_changes_nothing_and_others_do() {
        let device = ComputeDevice::default_compiled().unwrap();
        let circle = Curves::new(1, 0).circle("circle").unwrap();
        let (tau, mut steps) = (circle.tau(1e-3), DirectSteps::new(circle.grid));
        let derived = steps.step(&circle.distances, tau).distances;
        for form in [Form::Curvature, Form::Geometry, Form::Filters] {
            let scales = [vec![1.0; form.inputs()], vec![1e-2; form.outputs()]];
            let mut network = Network::zero(form, scales, 1);
            let step = |network: &Network, steps: &mut DirectSteps<2>| {
                let correction = Correction::Learned(network.clone());
                correction
                    .step(steps, &circle.distances, tau, &device)
                    .unwrap()
            };
            let same = step(&network, &mut steps);
            let near = (0..same.len()).filter(|node| derived[*node].abs() < circle.grid.spacing());
            let near: Vec<usize> = near.collect();
            let apart = |other: &[f64]| {
                let gaps = near
                    .iter()
                    .map(|node| (other[*node] - derived[*node]).abs());
                gaps.fold(0.0, f64::max)
            };
            assert!(apart(&same) < 1e-15, "{form:?}");
            network.parameters.fill(0.5);
            assert!(apart(&step(&network, &mut steps)) > 1e-9, "{form:?}");
        }
    }
}
