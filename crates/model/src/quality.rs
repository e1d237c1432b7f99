//! What a network is worth: losses on whole grids, its transfer function, its activation.

use std::collections::BTreeMap;

use chacha20::ChaCha8Rng;
use operators::{ComputeDevice, Transform, circular_convolution, kernel_symbol};
use rand::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::mlp::TABLE;
use crate::ratios::offsets;
use crate::training::SphereData;
use crate::{Error, Network};

/// A fixed draw of forty radii from `[0.05, 0.4]`, for which other implementations quote their losses.
///
/// Its smallest is 0.064. The loss is dominated by the smallest spheres, so it comes out about half of the mean over the whole
/// range: compare losses only on the same radii.
pub const REFERENCE_RADII: [f64; 40] = [
    0.064199, 0.074139, 0.083317, 0.089595, 0.117788, 0.136060, 0.138216, 0.144595, 0.148205,
    0.150375, 0.154529, 0.158303, 0.170128, 0.172505, 0.182259, 0.186878, 0.202285, 0.208288,
    0.213633, 0.227111, 0.228949, 0.229171, 0.244079, 0.247782, 0.248899, 0.254883, 0.257381,
    0.259696, 0.263520, 0.265216, 0.268246, 0.279490, 0.295907, 0.321127, 0.322247, 0.361450,
    0.375655, 0.377680, 0.387885, 0.390265,
];

/// Measured properties of a network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Loss of the paper on held-out radii spread evenly over the range, whole grids.
    pub held_out_loss: f64,
    /// The same with both phases exchanged.
    pub flipped_loss: f64,
    /// The loss of the identity map on those radii, for scale.
    pub identity_loss: f64,
    /// Loss on [`REFERENCE_RADII`].
    pub reference_loss: f64,
    /// Loss on [`REFERENCE_RADII`] with both phases exchanged.
    pub reference_flipped_loss: f64,
    /// Smallest value of the kernel's transfer function on the reference grid.
    pub transfer_min: f64,
    /// Largest value of the kernel's transfer function.
    pub transfer_max: f64,
    /// Largest imaginary part of the transfer function: zero for a symmetric kernel.
    pub transfer_imaginary: f64,
    /// `max |F(+-m) -+ 1|`, `m` being what the kernel makes of 1: 1 unless the kernel is scaled.
    pub phase_defect: f64,
    /// `max |F'' (w + s) - F''(w)| / max |F''|` on a line finer than any training sample: a spike would show.
    pub activation_roughness: f64,
    /// Spread of kernel values at (nearly) equal distance from the centre, relative to the largest.
    pub radial_asymmetry: f64,
}

impl Quality {
    /// Measures a network at its reference resolution with `count` held-out radii.
    ///
    /// # Errors
    /// [`Error::Operators`] if the device fails; as [`SphereData::validate`].
    pub fn measure(
        network: &Network,
        data: &SphereData,
        count: usize,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        data.validate()?;
        // Not the seed of any training.
        let mut rng = ChaCha8Rng::seed_from_u64(0x0048_454C_444F_5554);
        let held_out = data.draw_radii(count, &mut rng);
        let [held_out_loss, flipped_loss, identity_loss] =
            losses(network, data, &held_out, device)?;
        let [reference_loss, reference_flipped_loss, _] =
            losses(network, data, &REFERENCE_RADII, device)?;
        let n = data.cells;
        let shape = vec![n; network.ratios().dimension];
        let points = Transform::<f64>::of_shape(&shape).len() as f64;
        let symbol = kernel_symbol(&shape, network.kernel(), network.ratios().width);
        let transfer = || symbol.iter().map(|k| k.re * points);
        let (activation, mass) = (network.activation(), network.mass());
        Ok(Self {
            held_out_loss,
            flipped_loss,
            identity_loss,
            reference_loss,
            reference_flipped_loss,
            transfer_min: transfer().fold(f64::INFINITY, f64::min),
            transfer_max: transfer().fold(f64::NEG_INFINITY, f64::max),
            transfer_imaginary: largest(symbol.iter().map(|k| k.im * points)),
            phase_defect: largest([-1.0, 1.0].iter().map(|u| activation.value(mass * u) - u)),
            activation_roughness: roughness(network),
            radial_asymmetry: radial_asymmetry(network),
        })
    }
}

/// Relative error of the motion of spheres, `<V[u] - u, u_R - u> / |u_R - u|^2 - 1` for `u_R` the exact one after the step, and the same
/// with both phases exchanged: how much too fast an interface of that curvature moves, towards either phase.
pub fn displacement_errors(
    network: &Network,
    data: &SphereData,
    radius: f64,
    device: &ComputeDevice,
) -> Result<[f64; 2], Error> {
    data.validate()?;
    let u = data.sphere(radius);
    let target = data.sphere(data.shrunk(radius));
    let values = applied(network, data, &u, device)?;
    let [mut products, mut square] = [[0.0; 2], [0.0; 2]];
    for (i, (u, target)) in u.iter().zip(&target).enumerate() {
        let exact = target - u;
        for (phase, sign) in [1.0, -1.0].into_iter().enumerate() {
            products[phase] += (sign * values[phase][i] - u) * exact;
            square[phase] += exact * exact;
        }
    }
    Ok([0, 1].map(|phase| products[phase] / square[phase] - 1.0))
}

/// Losses of the network, of the network on `-u`, and of the identity.
fn losses(
    network: &Network,
    data: &SphereData,
    radii: &[f64],
    device: &ComputeDevice,
) -> Result<[f64; 3], Error> {
    let points = (data.cells as f64).powi(data.ratios.dimension as i32);
    let mut sums = [0.0; 3];
    for &radius in radii {
        let u = data.sphere(radius);
        let target = data.sphere(data.shrunk(radius));
        let [value, flipped] = applied(network, data, &u, device)?;
        for (i, target) in target.iter().enumerate() {
            sums[0] += (value[i] - target).powi(2) / points;
            sums[1] += (flipped[i] + target).powi(2) / points;
            sums[2] += (u[i] - target).powi(2) / points;
        }
    }
    Ok(sums.map(|sum| sum / radii.len() as f64))
}

/// `K * u`.
fn smoothed<const D: usize>(
    network: &Network,
    data: &SphereData,
    u: &[f64],
    device: &ComputeDevice,
) -> Result<Vec<f64>, Error> {
    let kernel = device.tensor::<D>(network.kernel(), [network.ratios().width; D]);
    let u = device.tensor::<D>(u, [data.cells; D]);
    Ok(device.values(circular_convolution(u, kernel, false))?)
}

/// `V[u]` and `V[-u]`: by the table where it reaches, exactly beyond, where kernels without regularization go.
fn applied(
    network: &Network,
    data: &SphereData,
    u: &[f64],
    device: &ComputeDevice,
) -> Result<[Vec<f64>; 2], Error> {
    let smoothed = match network.ratios().dimension {
        2 => smoothed::<2>(network, data, u, device)?,
        _ => smoothed::<3>(network, data, u, device)?,
    };
    let activation = network.activation();
    let table = activation.table(TABLE)?;
    let range = table.range();
    Ok([1.0, -1.0].map(|sign| {
        let smoothed: Vec<f64> = smoothed.iter().map(|w| sign * w).collect();
        let mut values = table.derivatives(&smoothed, 0);
        for (value, &w) in values.iter_mut().zip(&smoothed) {
            if !(range.low..=range.high).contains(&w) {
                *value = activation.value(w);
            }
        }
        values
    }))
}

/// Fine line over the arguments that occur, `[-1.05, 1.05]` times what the kernel makes of 1.
fn roughness(network: &Network) -> f64 {
    const POINTS: usize = 20_001;
    let mass = network.mass();
    let bends: Vec<f64> = (0..POINTS)
        .map(|i| -1.05 + 2.1 * i as f64 / (POINTS - 1) as f64)
        .map(|w| network.activation().jet(mass * w)[2])
        .collect();
    let jump = largest(bends.windows(2).map(|w| w[1] - w[0]));
    jump / largest(bends.into_iter()).max(f64::MIN_POSITIVE)
}

/// Compares entries of different orbits that lie at the same distance, like offsets (5, 0) and (4, 3).
fn radial_asymmetry(network: &Network) -> f64 {
    let ratios = network.ratios();
    let mut by_distance: BTreeMap<isize, (f64, f64)> = BTreeMap::new();
    for (offset, &value) in offsets(ratios.dimension, ratios.width).zip(network.kernel()) {
        let squared: isize = offset.iter().map(|b| b * b).sum();
        let range = by_distance.entry(squared).or_insert((value, value));
        *range = (range.0.min(value), range.1.max(value));
    }
    let spread = largest(by_distance.values().map(|(low, high)| high - low));
    spread / largest(network.kernel().iter().copied()).max(f64::MIN_POSITIVE)
}

/// The largest size of a value.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.map(f64::abs).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MeanCurvatureOperator, Shipped};

    /// The same operator with another scale of `w`.
    fn scaled(network: &Network, scale: f64) -> Network {
        let kernel = network.kernel().iter().map(|k| scale * k).collect();
        let mut parameters = network.activation().parameters().to_vec();
        // The weights of the first layer come first.
        for weight in &mut parameters[..network.activation().layers()[1]] {
            *weight /= scale;
        }
        let activation =
            crate::Mlp::new(network.activation().layers().to_vec(), parameters).unwrap();
        let provenance = network.provenance.clone();
        Network::new(network.ratios(), kernel, activation, provenance).unwrap()
    }

    /// With `w` forty times as large: beyond the table, but not worse.
    #[test]
    fn losses_hold_beyond_the_table_of_the_activation() {
        let (_, network) = Shipped::Paper.all().unwrap().remove(0);
        let device = ComputeDevice::default_compiled().unwrap();
        let mut data =
            SphereData::new(network.ratios(), network.provenance.reference_cells).unwrap();
        data.count = 4;
        let quality = |network: &Network| Quality::measure(network, &data, 2, &device).unwrap();
        let (expected, found) = (quality(&network), quality(&scaled(&network, 40.0)));
        let ratio = found.held_out_loss / expected.held_out_loss;
        assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
        let difference = found.phase_defect - expected.phase_defect;
        assert!(difference.abs() < 1e-5, "{difference:e}");
    }

    #[test]
    fn operators_do_not_depend_on_the_scale_of_the_kernel_unless_it_is_refused() {
        let ratios = crate::Ratios {
            dimension: 2,
            width: 17,
            eps_over_h: 2.0,
            step_over_h2: 1.0,
        };
        let network = Shipped::Paper.find(ratios).unwrap();
        let device = ComputeDevice::default_compiled().unwrap();
        let u: Vec<f64> = (0..1024).map(|i| (0.37 * f64::from(i)).sin()).collect();
        let results = |network: &Network| {
            let operator = MeanCurvatureOperator::<2>::new(network, &device).unwrap();
            let applied = operator.apply(device.tensor(&u, [32, 32]));
            let filter = operator.phase_preconditioner(32, 10.0);
            [device.values(applied).unwrap(), filter.apply(&u)]
        };
        let (expected, found) = (results(&network), results(&scaled(&network, 40.0)));
        for (k, limit) in [1e-9, 1e-4].into_iter().enumerate() {
            let difference = largest(expected[k].iter().zip(&found[k]).map(|(a, b)| a - b));
            assert!(difference < limit, "{k}: {difference:e}");
        }
        let refused = scaled(&network, 200.0).table();
        assert!(matches!(refused, Err(Error::KernelTooLarge { .. })));
    }
}
