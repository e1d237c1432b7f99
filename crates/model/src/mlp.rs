//! The scalar activation `F`: a small multilayer perceptron with `exp(-s^2)` hidden layers and a linear last layer.
//!
//! The paper's formula applies `exp(-s^2)` to the last layer too, but its range `(0, 1]` cannot contain the phase `-1`;
//! as in the networks of Bretin, Denis, Masnou and Terii, the last layer is linear here.

use burn::tensor::Tensor;
use operators::{HermiteTable, TableRange};
use serde::Serialize;

use crate::Error;

/// Layer widths of the paper: `F: R -> R` through 32, 16, 8, 4, 2 neurons.
pub const PAPER_LAYERS: [usize; 7] = [1, 32, 16, 8, 4, 2, 1];

/// Where `F` is tabulated for the solver where `K*u` stays within about `[-1, 1]`, see [`crate::Network::table`].
pub(crate) const TABLE: TableRange = TableRange {
    low: -2.0,
    high: 2.0,
    cells: 1024,
};

/// A scalar perceptron with its parameters in one flat vector.
///
/// Layer after layer: the weights `[inputs, outputs]` row-major, then the biases.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mlp {
    layers: Vec<usize>,
    parameters: Vec<f64>,
}

/// Position of one layer's parameters in the flat vector.
pub(crate) struct Layer {
    pub inputs: usize,
    pub outputs: usize,
    pub weights: usize,
    pub biases: usize,
}

/// The layers of a perceptron of these widths, in order.
pub(crate) fn layout(widths: &[usize]) -> Vec<Layer> {
    let mut start = 0;
    widths
        .windows(2)
        .map(|pair| {
            let (inputs, outputs) = (pair[0], pair[1]);
            let weights = start;
            let biases = weights + inputs * outputs;
            start = biases + outputs;
            Layer {
                inputs,
                outputs,
                weights,
                biases,
            }
        })
        .collect()
}

/// Number of parameters of a perceptron of these widths.
pub fn parameter_count(widths: &[usize]) -> usize {
    widths.windows(2).map(|w| (w[0] + 1) * w[1]).sum()
}

impl Mlp {
    /// A perceptron from its widths (first and last 1) and flat parameters.
    ///
    /// # Errors
    /// [`Error::Shape`] if the widths do not describe a scalar function or the count is off,
    /// [`Error::NonFinite`] if a parameter is not finite.
    pub fn new(layers: Vec<usize>, parameters: Vec<f64>) -> Result<Self, Error> {
        if layers.len() < 2
            || layers[0] != 1
            || layers[layers.len() - 1] != 1
            || layers.contains(&0)
        {
            return Err(Error::Shape {
                what: "activation layers",
                expected: "1, .., 1 without zeros".to_owned(),
                found: format!("{layers:?}"),
            });
        }
        let what = "activation parameters";
        Error::check_count(what, parameter_count(&layers), parameters.len())?;
        Error::check_finite(what, &parameters)?;
        Ok(Self { layers, parameters })
    }

    /// Layer widths, from the input to the output.
    pub fn layers(&self) -> &[usize] {
        &self.layers
    }

    /// All parameters, flat.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// `F(w)`.
    pub fn value(&self, w: f64) -> f64 {
        self.jet(w)[0]
    }

    /// `[F, F', F'', F''']` at `w`, by propagating truncated Taylor series through the layers.
    pub fn jet(&self, w: f64) -> [f64; 4] {
        let widest = self.layers.iter().max().copied().unwrap_or(1);
        let mut x = vec![[0.0; 4]; widest];
        let mut y = vec![[0.0; 4]; widest];
        x[0] = [w, 1.0, 0.0, 0.0];
        let layout = layout(&self.layers);
        for (l, layer) in layout.iter().enumerate() {
            for (o, out) in y[..layer.outputs].iter_mut().enumerate() {
                *out = [self.parameters[layer.biases + o], 0.0, 0.0, 0.0];
            }
            for (i, input) in x[..layer.inputs].iter().enumerate() {
                let row = &self.parameters[layer.weights + i * layer.outputs..][..layer.outputs];
                for (weight, out) in row.iter().zip(&mut y) {
                    for (out, input) in out.iter_mut().zip(input) {
                        *out += weight * input;
                    }
                }
            }
            if l + 1 < layout.len() {
                for value in &mut y[..layer.outputs] {
                    *value = gaussian_series(*value);
                }
            }
            std::mem::swap(&mut x, &mut y);
        }
        // Taylor coefficients to derivatives.
        [x[0][0], x[0][1], 2.0 * x[0][2], 6.0 * x[0][3]]
    }

    /// `(F(w) - F(-w)) / 2` as one perceptron: two copies side by side, so its hidden layers are twice as wide.
    #[must_use]
    pub fn odd_part(&self) -> Self {
        let last = self.layers.len() - 1;
        let width = |l: usize| if l == 0 || l == last { 1 } else { 2 };
        let layers: Vec<usize> = (self.layers.iter().enumerate())
            .map(|(l, neurons)| width(l) * neurons)
            .collect();
        let mut parameters = Vec::with_capacity(parameter_count(&layers));
        for (l, layer) in layout(&self.layers).iter().enumerate() {
            let (first, final_one) = (l == 0, l + 1 == last);
            // The weights from one copy to another: the second copy sees the input with the other sign.
            let factor = |from: usize, to: usize| match (first, final_one) {
                (true, true) => 1.0,
                (true, false) => [1.0, -1.0][to],
                (false, true) => [0.5, -0.5][from],
                (false, false) => f64::from(u8::from(from == to)),
            };
            for from in 0..width(l) {
                for input in 0..layer.inputs {
                    let row = &self.parameters[layer.weights + input * layer.outputs..];
                    for to in 0..width(l + 1) {
                        let weights = row[..layer.outputs].iter();
                        parameters.extend(weights.map(|weight| factor(from, to) * weight));
                    }
                }
            }
            for _ in 0..width(l + 1) {
                let biases = self.parameters[layer.biases..][..layer.outputs].iter();
                // Those of the last layer cancel.
                parameters.extend(biases.map(|bias| if final_one { 0.0 } else { *bias }));
            }
        }
        Self { layers, parameters }
    }

    /// The quintic Hermite table on an interval.
    pub(crate) fn table(&self, range: TableRange) -> Result<HermiteTable, Error> {
        Ok(HermiteTable::new(range, |w| {
            let [f, f1, f2, _] = self.jet(w);
            [f, f1, f2]
        })?)
    }
}

/// Taylor coefficients of `exp(-s^2)` for a series `s`.
fn gaussian_series(s: [f64; 4]) -> [f64; 4] {
    let q1 = -2.0 * s[0] * s[1];
    let q2 = -(2.0 * s[0] * s[2] + s[1] * s[1]);
    let q3 = -2.0 * (s[0] * s[3] + s[1] * s[2]);
    // e = exp(q) satisfies e' = q' e.
    let e0 = (-s[0] * s[0]).exp();
    let e1 = q1 * e0;
    let e2 = q2 * e0 + 0.5 * q1 * e1;
    let e3 = (3.0 * q3 * e0 + 2.0 * q2 * e1 + q1 * e2) / 3.0;
    [e0, e1, e2, e3]
}

/// The perceptron as a Burn graph of its flat parameters `[parameter_count]`, for inputs `[rows, 1]`.
pub fn forward(widths: &[usize], parameters: &Tensor<1>, input: Tensor<2>) -> Tensor<2> {
    forward_with(widths, parameters, input, |preactivation| preactivation)
}

/// As [`forward`], with a hook on every layer's pre-activation `[rows, outputs]`.
pub(crate) fn forward_with(
    widths: &[usize],
    parameters: &Tensor<1>,
    input: Tensor<2>,
    mut hook: impl FnMut(Tensor<2>) -> Tensor<2>,
) -> Tensor<2> {
    let layout = layout(widths);
    let last = layout.len() - 1;
    let mut x = input;
    for (l, layer) in layout.iter().enumerate() {
        let weights: Tensor<2> = parameters
            .clone()
            .slice([layer.weights..layer.biases])
            .reshape([layer.inputs, layer.outputs]);
        let biases: Tensor<2> = parameters
            .clone()
            .slice([layer.biases..layer.biases + layer.outputs])
            .reshape([1, layer.outputs]);
        x = hook(x.matmul(weights) + biases);
        if l < last {
            x = (x.clone() * x).neg().exp();
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use operators::ComputeDevice;

    fn sample() -> Mlp {
        let count = parameter_count(&PAPER_LAYERS);
        let parameters = (0..count).map(|i| 0.7 * (1.3 * i as f64).sin()).collect();
        Mlp::new(PAPER_LAYERS.to_vec(), parameters).unwrap()
    }

    #[test]
    fn the_papers_layers_have_777_parameters() {
        assert_eq!(parameter_count(&PAPER_LAYERS), 777);
    }

    #[test]
    fn jets_are_the_derivatives() {
        let f = sample();
        let step = 1e-4;
        for w in [-1.2, -0.3, 0.05, 0.9, 1.7] {
            let [_, d1, d2, d3] = f.jet(w);
            let (a, b) = (f.jet(w - step), f.jet(w + step));
            for (k, exact) in [d1, d2, d3].into_iter().enumerate() {
                let numeric = (b[k] - a[k]) / (2.0 * step);
                assert!(
                    (numeric - exact).abs() < 1e-5 * (1.0 + exact.abs()),
                    "order {}",
                    k + 1
                );
            }
        }
    }

    #[test]
    fn burn_graph_table_and_jet_agree() {
        let f = sample();
        let device = ComputeDevice::default_compiled().unwrap();
        let w: Vec<f64> = (0..200).map(|i| -1.9 + 0.019 * f64::from(i)).collect();
        let parameters = device.tensor::<1>(f.parameters(), [777]);
        let graph = forward(&PAPER_LAYERS, &parameters, device.tensor::<2>(&w, [200, 1]));
        let graph = device.values(graph).unwrap();
        let table = f.table(TABLE).unwrap();
        for (w, graph) in w.iter().zip(graph) {
            assert!((f.value(*w) - graph).abs() < 1e-13);
            let jet = f.jet(*w);
            for order in 0..3 {
                let limit = [1e-13, 1e-10, 1e-7][order];
                assert!(
                    (table.derivative(*w, order) - jet[order]).abs() < limit,
                    "{w} {order}"
                );
            }
        }
    }

    #[test]
    fn refuses_wrong_counts_and_nan() {
        assert!(matches!(
            Mlp::new(vec![1, 2, 1], vec![0.0; 6]),
            Err(Error::Shape { .. })
        ));
        assert!(matches!(
            Mlp::new(vec![1, 2, 2], vec![0.0; 8]),
            Err(Error::Shape { .. })
        ));
        let mut parameters = vec![0.0; 7];
        parameters[3] = f64::NAN;
        let error = Mlp::new(vec![1, 2, 1], parameters).unwrap_err();
        assert!(matches!(error, Error::NonFinite { index: 3, .. }));
    }
}
