//! What the tests share: networks, discs and small objectives on the host.
pub mod flow;

use burn::tensor::Tensor;
use geometry::{Field, Grid, phase_field, shapes::Ball};
use model::training::levenberg_marquardt::heat_kernel;
use model::{Network, Ratios, Shipped};
use operators::ComputeDevice;
use solver::{DomainScales, Error, FlowParams, Objective};

pub fn device() -> ComputeDevice {
    ComputeDevice::default_compiled().unwrap()
}

pub fn ratios(dimension: usize) -> Ratios {
    Ratios::of_run(dimension, 17, 1.0, 2.0, 1.0)
}

/// The shipped network with `n_K = 17`, `eps = 2h`, `tautilde = h^2`.
pub fn network() -> Network {
    Shipped::Paper.find(ratios(2)).unwrap()
}

/// The accurate network for the same scales.
pub fn accurate(dimension: usize) -> Network {
    Shipped::Accurate.find(ratios(dimension)).unwrap()
}

/// A 3D operator that depends on no training in 3D: the heat kernel, with the activation of the 2D network.
pub fn network_3d() -> Network {
    let flat = network();
    let kernel = heat_kernel(ratios(3));
    let activation = flat.activation().clone();
    Network::new(ratios(3), kernel, activation, flat.provenance.clone()).unwrap()
}

/// The scales that fit the networks here.
pub fn params<const D: usize>(grid: &Grid<D>) -> FlowParams {
    FlowParams::paper(2.0 * grid.spacing(), grid.spacing().powi(2))
}

/// The same for formulas, with an exact step of mean curvature flow.
pub fn scales<const D: usize>(grid: &Grid<D>) -> DomainScales {
    let FlowParams { eps, mcf_step, .. } = params(grid);
    DomainScales {
        eps,
        mcf_step,
        response: 1.0,
    }
}

pub fn ball<const D: usize>(grid: Grid<D>, radius: f64) -> Field<D> {
    let ball = Ball::new([0.0; D], radius).unwrap();
    phase_field(grid, &ball, 2.0 * grid.spacing()).unwrap()
}

/// Root of the sum of squares of a difference.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

pub fn values<const D: usize>(u: &Tensor<D>) -> Vec<f64> {
    device().values(u.clone()).unwrap()
}

/// Reproducible numbers in `[-1, 1)`. Along those of another generator a third derivative may nearly vanish, and with it what Taylor tests measure.
pub fn noise(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            2.0 * (state >> 11) as f64 / (1_u64 << 53) as f64 - 1.0
        })
        .collect()
}

/// An objective times a number: units of energy must not matter.
pub struct Scaled<O>(pub O, pub f64);

impl<const D: usize, O: Objective<D>> Objective<D> for Scaled<O> {
    fn value(&mut self, u: &Tensor<D>) -> Result<f64, Error> {
        Ok(self.0.value(u)? * self.1)
    }

    fn evaluate(&mut self, u: &Tensor<D>) -> Result<(f64, Tensor<D>), Error> {
        let (value, gradient) = self.0.evaluate(u)?;
        Ok((value * self.1, gradient * self.1))
    }

    fn hessian_vector_product(&mut self, p: &Tensor<D>) -> Result<Tensor<D>, Error> {
        Ok(self.0.hessian_vector_product(p)? * self.1)
    }

    fn unit(&self) -> f64 {
        self.0.unit() * self.1
    }
}

/// Side of the grids of the host objectives.
pub const SIDE: usize = 6;
const N: usize = SIDE * SIDE;

/// `1/2 |u - a|^2 + 1/2 |B u - d|^2` with a dense matrix.
pub struct Quadratic {
    pub a: Vec<f64>,
    pub matrix: Vec<Vec<f64>>,
    pub d: Vec<f64>,
}

impl Quadratic {
    /// `size` scales the second term, whose matrix is random.
    pub fn random(size: f64) -> Self {
        let entries = noise(N * N, 3);
        let row = |i: usize| entries[i * N..][..N].iter().map(|x| size * x).collect();
        Self {
            a: noise(N, 1).iter().map(|x| 0.5 * x).collect(),
            matrix: (0..N).map(row).collect(),
            d: noise(N, 2).iter().map(|x| 0.5 * size * x).collect(),
        }
    }

    fn residual(&self, u: &[f64]) -> Vec<f64> {
        let rows = self.matrix.iter().zip(&self.d);
        rows.map(|(row, d)| dot(row, u) - d).collect()
    }

    fn transposed(&self, v: &[f64]) -> Vec<f64> {
        (0..N)
            .map(|j| self.matrix.iter().zip(v).map(|(row, v)| row[j] * v).sum())
            .collect()
    }

    /// The minimizer, by elimination in `(1 + B^T B) u = a + B^T d`.
    pub fn minimizer(&self) -> Vec<f64> {
        let mut system: Vec<Vec<f64>> = (0..N)
            .map(|i| {
                let row = |j: usize| self.matrix.iter().map(|b| b[i] * b[j]).sum::<f64>();
                (0..N)
                    .map(|j| row(j) + if i == j { 1.0 } else { 0.0 })
                    .collect()
            })
            .collect();
        let right = self.transposed(&self.d);
        let mut x: Vec<f64> = self.a.iter().zip(right).map(|(a, b)| a + b).collect();
        for i in 0..N {
            let pivot = system[i].clone();
            for k in i + 1..N {
                let factor = system[k][i] / pivot[i];
                for (entry, p) in system[k].iter_mut().zip(&pivot) {
                    *entry -= factor * p;
                }
                x[k] -= factor * x[i];
            }
        }
        for i in (0..N).rev() {
            let known: f64 = (i + 1..N).map(|j| system[i][j] * x[j]).sum();
            x[i] = (x[i] - known) / system[i][i];
        }
        x
    }
}

/// The remainders of an energy along a direction fall with the orders that these derivatives promise.
#[track_caller]
pub fn passes_taylor_tests(
    mut value: impl FnMut(f64) -> f64,
    [first, second]: [f64; 2],
    steps: &[f64],
) {
    for (derivatives, expected) in [(vec![first], 2.0), (vec![first, second], 3.0)] {
        let rate = linearize::taylor::remainder(&mut value, &derivatives, steps, 1e-14).rate();
        let rate = rate.unwrap();
        assert!((rate - expected).abs() < 0.1, "{expected}: {rate}");
    }
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub fn grid_tensor(values: &[f64]) -> Tensor<2> {
    device().tensor(values, [SIDE, SIDE])
}

impl Objective<2> for Quadratic {
    fn value(&mut self, u: &Tensor<2>) -> Result<f64, Error> {
        let u = values(u);
        let residual = self.residual(&u);
        Ok(0.5 * (distance(&u, &self.a).powi(2) + dot(&residual, &residual)))
    }

    fn evaluate(&mut self, u: &Tensor<2>) -> Result<(f64, Tensor<2>), Error> {
        let host = values(u);
        let back = self.transposed(&self.residual(&host));
        let gradient: Vec<f64> = (0..N).map(|i| host[i] - self.a[i] + back[i]).collect();
        Ok((self.value(u)?, grid_tensor(&gradient)))
    }

    fn hessian_vector_product(&mut self, p: &Tensor<2>) -> Result<Tensor<2>, Error> {
        let p = values(p);
        let image: Vec<f64> = self.matrix.iter().map(|row| dot(row, &p)).collect();
        let back = self.transposed(&image);
        Ok(grid_tensor(
            &p.iter().zip(back).map(|(p, b)| p + b).collect::<Vec<_>>(),
        ))
    }

    fn unit(&self) -> f64 {
        1.0
    }
}

/// `1/2 |u - a|^2 + k/4 sum (u^2 - 1)^2`: concave about zero if `k > 1`.
pub struct DoubleWell {
    pub a: Vec<f64>,
    pub k: f64,
    pub at: Vec<f64>,
}

impl DoubleWell {
    pub fn new(a: Vec<f64>, k: f64) -> Self {
        let at = a.clone();
        Self { a, k, at }
    }
}

impl Objective<2> for DoubleWell {
    fn value(&mut self, u: &Tensor<2>) -> Result<f64, Error> {
        let u = values(u);
        let wells: f64 = u.iter().map(|u| (u * u - 1.0).powi(2)).sum();
        Ok(0.5 * distance(&u, &self.a).powi(2) + 0.25 * self.k * wells)
    }

    fn evaluate(&mut self, u: &Tensor<2>) -> Result<(f64, Tensor<2>), Error> {
        self.at = values(u);
        let pairs = self.at.iter().zip(&self.a);
        let gradient: Vec<f64> = pairs
            .map(|(u, a)| u - a + self.k * u * (u * u - 1.0))
            .collect();
        Ok((self.value(u)?, grid_tensor(&gradient)))
    }

    fn hessian_vector_product(&mut self, p: &Tensor<2>) -> Result<Tensor<2>, Error> {
        let curvature = |u: &f64| 1.0 + self.k * (3.0 * u * u - 1.0);
        let product: Vec<f64> = (self.at.iter().zip(values(p)))
            .map(|(u, p)| curvature(u) * p)
            .collect();
        Ok(grid_tensor(&product))
    }

    fn unit(&self) -> f64 {
        1.0
    }
}
