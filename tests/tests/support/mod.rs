//! What the test suite of the backends shares: devices with their tolerances, an operator that needs no training, and
//! the definitions of the operations as plain sums.
//!
//! The suite itself is `backends.rs`. It runs on every backend compiled in
//! (`cargo test -p workbench-tests --features ndarray`), and its executable runs on other machines too. A GPU backend
//! that cannot be opened fails its tests, unless the environment variable `WILLMORE_ALLOW_MISSING_GPU` is 1.

use burn::tensor::DType;
use chacha20::ChaCha8Rng;
use model::training::{SphereData, levenberg_marquardt};
use model::{Mlp, Network, Provenance, Ratios};
use operators::{ComputeDevice, DeviceKind};
use rand::{RngExt, SeedableRng};

/// A device under test.
#[derive(Clone, Debug)]
pub struct Backend {
    /// Name for messages, with the precision.
    pub name: String,
    /// The device.
    pub device: ComputeDevice,
}

impl Backend {
    fn new(device: ComputeDevice) -> Self {
        Self {
            name: format!("{} {:?}", device.kind(), device.dtype()),
            device,
        }
    }

    /// Whether it computes in double precision.
    pub fn is_double(&self) -> bool {
        self.device.epsilon() < 1e-10
    }

    /// One of two tolerances, by precision.
    pub fn tolerance(&self, double: f64, single: f64) -> f64 {
        if self.is_double() { double } else { single }
    }
}

/// Every device of this build in its own precision, the first one and GPUs in the other one too, where they have it.
///
/// # Panics
/// If one does not open, with the exception above.
pub fn backends() -> Vec<Backend> {
    let allowed = std::env::var("WILLMORE_ALLOW_MISSING_GPU").is_ok_and(|value| value == "1");
    let mut backends: Vec<Backend> = Vec::new();
    for kind in DeviceKind::compiled() {
        match ComputeDevice::open(kind) {
            Ok(device) => backends.push(Backend::new(device)),
            Err(error) if allowed && matches!(kind, DeviceKind::Wgpu | DeviceKind::Cuda) => {
                eprintln!("not tested: {error}");
            }
            Err(error) => panic!("{error}; set WILLMORE_ALLOW_MISSING_GPU=1 to leave a GPU out"),
        }
    }
    let compared = backends.iter().enumerate();
    let compared = compared.filter(|(k, backend)| *k == 0 || !backend.device.kind().is_cpu());
    let others = compared.filter_map(|(_, backend)| {
        let dtype = if backend.is_double() {
            DType::F32
        } else {
            DType::F64
        };
        match backend.device.clone().with_dtype(dtype) {
            Ok(device) => Some(device),
            Err(operators::Error::Unavailable { .. }) => None,
            Err(error) => panic!("{error}"),
        }
    });
    let others: Vec<_> = others.collect();
    backends.extend(others.into_iter().map(Backend::new));
    backends
}

/// The operator of the splitting scheme with `eps = 2h` and `tautilde = h^2`: heat kernel, then the inverse of
/// `v + tautilde / (2 eps^2) Psi'(v)`, the latter as a sum of Gaussians.
///
/// # Errors
/// If the width is not that of a kernel.
pub fn splitting_network(dimension: usize, width: usize) -> Result<Network, model::Error> {
    let ratios = Ratios {
        dimension,
        width,
        eps_over_h: 2.0,
        step_over_h2: 1.0,
    };
    let data = SphereData::new(ratios, 64)?;
    let provenance = Provenance {
        recipe: "splitting scheme".to_owned(),
        reference_cells: data.cells,
        seed: 0,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        training_loss: f64::NAN,
        held_out_loss: f64::NAN,
        flipped_loss: f64::NAN,
    };
    let kernel = levenberg_marquardt::heat_kernel(data.ratios);
    Network::new(ratios, kernel, splitting_activation()?, provenance)
}

/// `sum_j a_j exp(-((w - c_j) / s)^2)` through the splitting scheme's activation at the centres `c_j`.
fn splitting_activation() -> Result<Mlp, model::Error> {
    const NEURONS: usize = 81;
    const SPACING: f64 = 0.06;
    /// `(s / SPACING)^2`: enough overlap to be flat between the centres.
    const OVERLAP: f64 = 2.0;
    let width = SPACING * OVERLAP.sqrt();
    let centre = |j: usize| SPACING * (j as f64 - 40.0);
    let target: Vec<f64> = (0..NEURONS)
        .map(|j| levenberg_marquardt::splitting_activation(0.25, centre(j)))
        .collect();
    // Quasi-interpolation, and Richardson's iteration for what it misses.
    let height = 1.0 / (std::f64::consts::PI * OVERLAP).sqrt();
    let mut data = target.clone();
    for _ in 0..30 {
        let sums: Vec<f64> = (0..NEURONS)
            .map(|i| {
                let bumps = data.iter().enumerate().map(|(j, a)| {
                    let s = (centre(i) - centre(j)) / width;
                    height * a * (-s * s).exp()
                });
                bumps.sum()
            })
            .collect();
        for ((data, target), sum) in data.iter_mut().zip(&target).zip(sums) {
            *data += target - sum;
        }
    }
    let mut parameters = vec![1.0 / width; NEURONS];
    parameters.extend((0..NEURONS).map(|j| -centre(j) / width));
    parameters.extend(data.iter().map(|a| height * a));
    parameters.push(0.0);
    Mlp::new(vec![1, NEURONS, 1], parameters)
}

/// Reproducible numbers in `[-1, 1)`.
pub fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// Inner product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Euclidean distance relative to the length of `b`.
pub fn relative_distance(a: &[f64], b: &[f64]) -> f64 {
    let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    (dot(&difference, &difference) / dot(b, b)).sqrt()
}

/// Calls `f(a, b, index of a + b in the grid)` for every node `a` and kernel entry `b`, flat indices of row-major
/// arrays; the offset is `b - width / 2` on each axis, and the grid is periodic.
pub fn each_pair(shape: &[usize], width: usize, mut f: impl FnMut(usize, usize, usize)) {
    let unravel = |mut i: usize, extent: &dyn Fn(usize) -> usize| {
        let mut index = vec![0; shape.len()];
        for axis in (0..shape.len()).rev() {
            index[axis] = i % extent(axis);
            i /= extent(axis);
        }
        index
    };
    let nodes: usize = shape.iter().product();
    let entries: Vec<Vec<usize>> = (0..width.pow(shape.len() as u32))
        .map(|b| unravel(b, &|_| width))
        .collect();
    for a in 0..nodes {
        let node = unravel(a, &|axis| shape[axis]);
        for (b, entry) in entries.iter().enumerate() {
            let mut sum = 0;
            for (axis, &n) in shape.iter().enumerate() {
                // A multiple of n added, for kernels wider than the grid.
                let shifted = node[axis] + entry[axis] + n * width - width / 2;
                sum = sum * n + shifted % n;
            }
            f(a, b, sum);
        }
    }
}

/// `y_a = sum_b K_b x_{a+b}`, or its transpose, for one grid or several.
pub fn convolution(
    x: &[f64],
    shape: &[usize],
    kernel: &[f64],
    width: usize,
    adjoint: bool,
) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    let nodes: usize = shape.iter().product();
    for (x, y) in x.chunks(nodes).zip(y.chunks_mut(nodes)) {
        each_pair(shape, width, |a, b, sum| {
            if adjoint {
                y[sum] += kernel[b] * x[a];
            } else {
                y[a] += kernel[b] * x[sum];
            }
        });
    }
    y
}

/// `c_b = sum_a g_a x_{a+b}`, summed over several grids.
pub fn correlation(x: &[f64], g: &[f64], shape: &[usize], width: usize) -> Vec<f64> {
    let mut c = vec![0.0; width.pow(shape.len() as u32)];
    let nodes: usize = shape.iter().product();
    for (x, g) in x.chunks(nodes).zip(g.chunks(nodes)) {
        each_pair(shape, width, |a, b, sum| c[b] += g[a] * x[sum]);
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_of_gaussians_is_the_activation() {
        let activation = splitting_activation().unwrap();
        for i in -120..=120 {
            let w = f64::from(i) / 100.0;
            let exact = levenberg_marquardt::splitting_activation(0.25, w);
            let error = activation.value(w) - exact;
            assert!(error.abs() < 1e-5, "{error:e} at {w}");
        }
    }
}
