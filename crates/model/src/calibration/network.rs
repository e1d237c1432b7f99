//! The learned operator on planes of grid nodes.

use faer::{Col, Mat};

use super::PlanarStep;
use crate::{Error, Mlp, Network};

/// `V` for functions of `a . x` with an integer normal `a`: the kernel is summed over the planes `a . b = m`.
pub(crate) struct NetworkOnPlanes<'a> {
    activation: &'a Mlp,
    /// `K_m`, the sum of the kernel over each plane, from `m = -reach` to `reach`.
    kernel: Vec<f64>,
    /// `1/2 sum K_b |b_t|^2 / (D - 1)` over each plane, `b_t` the part of `b` in the plane.
    moments: Vec<f64>,
    spacing: f64,
    eps: f64,
    time_step: f64,
}

impl<'a> NetworkOnPlanes<'a> {
    pub(crate) fn new(network: &'a Network, normal: &[isize]) -> Self {
        let ratios = network.ratios();
        let (dimension, width) = (ratios.dimension, ratios.width);
        let middle = (width / 2).cast_signed();
        let square = normal.iter().map(|a| a * a).sum::<isize>() as f64;
        let reach = middle * normal.iter().map(|a| a.abs()).sum::<isize>();
        let mut kernel = vec![0.0; 2 * reach as usize + 1];
        let mut moments = kernel.clone();
        for (i, value) in network.kernel().iter().enumerate() {
            let (mut index, mut plane, mut length) = (i, 0, 0);
            for axis in (0..dimension).rev() {
                let offset = (index % width).cast_signed() - middle;
                index /= width;
                plane += normal[axis] * offset;
                length += offset * offset;
            }
            let tangential = length as f64 - (plane * plane) as f64 / square;
            kernel[(plane + reach) as usize] += value;
            moments[(plane + reach) as usize] += 0.5 * value * tangential / (dimension - 1) as f64;
        }
        Self {
            activation: network.activation(),
            kernel,
            moments,
            spacing: 1.0 / square.sqrt(),
            eps: ratios.eps_over_h,
            time_step: ratios.step_over_h2,
        }
    }

    /// The row of a correlation with `weights`, as pairs of plane and weight.
    fn row<'w>(
        &self,
        weights: &'w [f64],
        i: usize,
        planes: usize,
    ) -> impl Iterator<Item = (usize, f64)> + 'w {
        let reach = self.kernel.len() / 2;
        weights.iter().enumerate().map(move |(j, &weight)| {
            let plane = (i + j).saturating_sub(reach).min(planes - 1);
            (plane, weight)
        })
    }

    fn smoothed(&self, weights: &[f64], w: &Col<f64>) -> Col<f64> {
        let planes = w.nrows();
        Col::from_fn(planes, |i| {
            let row = self.row(weights, i, planes);
            row.map(|(plane, weight)| weight * w[plane]).sum()
        })
    }
}

impl PlanarStep for NetworkOnPlanes<'_> {
    fn eps(&self) -> f64 {
        self.eps
    }

    fn time_step(&self) -> f64 {
        self.time_step
    }

    fn spacing(&self) -> f64 {
        self.spacing
    }

    fn linearize(&self, w: &Col<f64>) -> Result<(Col<f64>, Mat<f64>), Error> {
        let planes = w.nrows();
        let smoothed = self.smoothed(&self.kernel, w);
        let jets: Vec<_> = smoothed.iter().map(|&z| self.activation.jet(z)).collect();
        let mut jacobian = Mat::zeros(planes, planes);
        for (i, jet) in jets.iter().enumerate() {
            for (plane, weight) in self.row(&self.kernel, i, planes) {
                jacobian[(i, plane)] += jet[1] * weight;
            }
        }
        Ok((Col::from_fn(planes, |i| jets[i][0]), jacobian))
    }

    /// At the offset `b` the signed distance of a sphere is `x + b_n - kappa |b_t|^2 / (2 (D - 1))` to first order.
    fn bending(&self, w: &Col<f64>, slope: &Col<f64>) -> Col<f64> {
        let smoothed = self.smoothed(&self.kernel, w);
        let bent = self.smoothed(&self.moments, slope);
        Col::from_fn(w.nrows(), |i| {
            -self.activation.jet(smoothed[i])[1] * bent[i]
        })
    }
}
