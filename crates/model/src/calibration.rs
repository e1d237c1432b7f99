//! The calibration of the learned operator: what it does on planes of grid nodes.

use faer::{Col, Mat};
use mean_curvature::calibration::{PlanarScales, spectrum};
use mean_curvature::{Calibration, PlanarStep, calibrate, normals};

use crate::ratios::offsets;
use crate::{Error, Mlp, Network};

/// `V` for functions of `a . x` with an integer normal `a`: the kernel is summed over the planes `a . b = m`.
struct NetworkOnPlanes<'a> {
    activation: &'a Mlp,
    /// `K_m`, the sum of the kernel over each plane, from `m = -reach` to `reach`.
    kernel: Vec<f64>,
    /// `1/2 sum K_b |b_t|^2 / (D - 1)` over each plane, `b_t` the component of `b` in the plane.
    moments: Vec<f64>,
    scales: PlanarScales,
}

impl<'a> NetworkOnPlanes<'a> {
    fn new(network: &'a Network, normal: &[isize]) -> Self {
        let ratios = network.ratios();
        let (dimension, width) = (ratios.dimension, ratios.width);
        let middle = (width / 2).cast_signed();
        let square = normal.iter().map(|a| a * a).sum::<isize>() as f64;
        let reach = middle * normal.iter().map(|a| a.abs()).sum::<isize>();
        let mut kernel = vec![0.0; 2 * reach as usize + 1];
        let mut moments = kernel.clone();
        for (offset, value) in offsets(dimension, width).zip(network.kernel()) {
            let plane: isize = offset.iter().zip(normal).map(|(b, axis)| axis * b).sum();
            let length: isize = offset.iter().map(|b| b * b).sum();
            let tangential = length as f64 - (plane * plane) as f64 / square;
            kernel[(plane + reach) as usize] += value;
            moments[(plane + reach) as usize] += 0.5 * value * tangential / (dimension - 1) as f64;
        }
        Self {
            activation: network.activation(),
            kernel,
            moments,
            scales: PlanarScales {
                eps: ratios.eps_over_h,
                mcf_step: ratios.step_over_h2,
                spacing: 1.0 / square.sqrt(),
            },
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
    fn scales(&self) -> PlanarScales {
        self.scales
    }

    fn linearize(&self, w: &Col<f64>) -> Result<(Col<f64>, Mat<f64>), mean_curvature::Error> {
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

impl Network {
    /// The calibration of the operator, computed anew (a tenth of a second at `eps = 2h`, seconds at `8h`).
    ///
    /// ```
    /// use model::{Ratios, Shipped};
    ///
    /// # fn main() -> Result<(), model::Error> {
    /// let ratios = Ratios { dimension: 2, width: 17, eps_over_h: 2.0, step_over_h2: 1.0 };
    /// let calibration = Shipped::Paper.find(ratios)?.calibrate()?;
    /// println!("c = {:.4}, m = {:.4}", calibration.factors.energy, calibration.factors.metric);
    /// assert!((calibration.factors.energy - 0.932).abs() < 0.002);
    /// // The left null vector is not the interface's translation, as it would be for a gradient flow.
    /// assert!(calibration.alignment < 0.985);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`mean_curvature::Error::Calibration`] if the operator has no flat interface at rest, as after too little training.
    pub fn calibrate(&self) -> Result<Calibration, Error> {
        let step = |normal: &[isize]| NetworkOnPlanes::new(self, normal);
        Ok(calibrate(normals(self.ratios().dimension), step)?)
    }

    /// Eigenvalues of `J`, the derivative of the operator at its flat interface normal to an axis, largest real part first. The
    /// first belongs to translations and is 1, the second says how fast disturbed profiles recover, and the rest are between
    /// the transfer function's values in the pure phases.
    pub fn flat_spectrum(&self) -> Result<Vec<[f64; 2]>, Error> {
        let (normal, _) = normals(self.ratios().dimension)[0];
        let step = NetworkOnPlanes::new(self, normal);
        Ok(spectrum(&step)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Shipped;
    use mean_curvature::calibration::{flat_interface, optimal_interface, solve};

    fn dot(a: &Col<f64>, b: &Col<f64>) -> f64 {
        a.iter().zip(b.iter()).map(|(a, b)| a * b).sum()
    }

    /// For a symmetric kernel `psi = K * w'` and `<A, psi> = -<T * w', w'>`, without an eigenvalue problem.
    #[test]
    fn factors_have_a_closed_form_for_symmetric_kernels() {
        for (name, network) in Shipped::Paper.all().unwrap() {
            if network.ratios().width > 17 {
                continue; // the same code path, many times the time
            }
            for &(normal, _) in normals(network.ratios().dimension) {
                let step = NetworkOnPlanes::new(&network, normal);
                let found = solve(&step, 0.25).unwrap();
                let (start, optimal_slope) = optimal_interface(&step, 0.25);
                let w = flat_interface(&step, &start, &optimal_slope).unwrap();
                let (_, jacobian) = step.linearize(&w).unwrap();
                let mut slope = optimal_slope.clone();
                for _ in 0..100 {
                    slope = &jacobian * &slope;
                }
                let jump = w[w.nrows() - 1] - w[0];
                slope *= faer::Scale(jump / (slope.sum() * step.scales.spacing));
                let psi = step.smoothed(&step.kernel, &slope);
                let response = dot(&slope, &step.smoothed(&step.moments, &slope));
                let scale = step.scales.mcf_step.powi(2) * dot(&optimal_slope, &optimal_slope);
                let energy = response.powi(2) / (dot(&psi, &psi) * scale);
                assert!(
                    (energy / found.energy - 1.0).abs() < 1e-5,
                    "{name} {normal:?}: {energy} {found:?}"
                );
                let alignment = dot(&psi, &slope).powi(2) / (dot(&psi, &psi) * dot(&slope, &slope));
                assert!((alignment - found.alignment).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn planes_keep_the_sums_of_the_kernel_and_see_half_its_variance() {
        for (name, network) in Shipped::Paper.all().unwrap() {
            let dimension = network.ratios().dimension;
            for &(normal, _) in normals(dimension) {
                let step = NetworkOnPlanes::new(&network, normal);
                let sum: f64 = network.kernel().iter().sum();
                assert!(
                    (step.kernel.iter().sum::<f64>() - sum).abs() < 1e-12,
                    "{name}"
                );
                // The variance per axis of a symmetric kernel does not depend on the direction.
                let reach = (step.kernel.len() / 2) as f64;
                let variance: f64 = (step.kernel.iter().enumerate())
                    .map(|(m, k)| k * ((m as f64 - reach) * step.scales.spacing).powi(2))
                    .sum();
                let moment: f64 = step.moments.iter().sum();
                assert!(
                    (moment - 0.5 * variance).abs() < 1e-10 * variance,
                    "{name} {normal:?}"
                );
            }
        }
    }
}
