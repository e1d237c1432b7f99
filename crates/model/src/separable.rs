//! The operator on active bricks, for kernels that are products of functions of one variable.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Bricks, Nodes};
use mean_curvature::{
    Calibration, Error as StepError, Identity, MeanCurvatureStep, PhaseInverse, PhaseInverses,
    StepFailure, StepScales,
};
use operators::{
    COEFFICIENTS, ComputeDevice, HermiteTable, TableRange, brick_convolution, combined,
    convolution_of_outside, scaled, tabulated,
};

use crate::operator::identity;
use crate::{Error, Network};

/// A kernel may differ from a product by this part of its largest value: networks of the accurate recipe, whose kernels are Gaussian, do
/// by rounding.
const SEPARABLE: f64 = 1e-12;
/// Smallest side of a brick, in two and in three dimensions.
const SIDES: [usize; 2] = [16, 8];

/// An operator `V[u] = F(K * u)` with `K = t x .. x t`, to be put on [`Bricks`] of any grid that it fits.
///
/// Where `u` is constant, at the values near -1 and 1 that `V` keeps, nothing needs to be stored.
#[derive(Clone, Debug)]
pub struct SeparableOperator<const D: usize> {
    taps: Vec<f64>,
    table: Tensor<2>,
    range: TableRange,
    phase_values: [f64; 2],
    slope: f64,
    network: Arc<Network>,
    device: ComputeDevice,
}

impl<const D: usize> SeparableOperator<D> {
    /// Takes the kernel of a network apart and uploads the rest.
    ///
    /// # Errors
    /// [`Error::NotSeparable`], [`Error::NoRest`], and as [`crate::MeanCurvatureOperator::new`].
    pub fn new(network: &Network, device: &ComputeDevice) -> Result<Self, Error> {
        network.ratios_in(D)?;
        let table = network.table()?;
        let size = [table.range().cells, COEFFICIENTS];
        let coefficients = device.tensor(table.coefficients(), size);
        let network = Arc::new(network.clone());
        Self::with_table(network, &table, &coefficients, device)
    }

    /// The same with the network's table, which is on the device already.
    pub(crate) fn with_table(
        network: Arc<Network>,
        table: &HermiteTable,
        coefficients: &Tensor<2>,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let taps = factor::<D>(network.kernel(), network.ratios().width)?;
        let mass = taps.iter().sum::<f64>().powi(D as i32);
        let [negative, positive] = [-1.0, 1.0].map(|phase| rest(table, mass, phase));
        let phase_values = [negative?, positive?];
        let slope = phase_values.map(|rest| mass * table.derivative(mass * rest, 1));
        Ok(Self {
            taps,
            table: coefficients.clone(),
            range: table.range(),
            phase_values,
            slope: 0.5 * (slope[0] + slope[1]),
            network,
            device: device.clone(),
        })
    }

    /// The values in the negative and in the positive phase that the operator keeps: `V[z] = z`.
    pub fn phase_values(&self) -> [f64; 2] {
        self.phase_values
    }

    /// Cells along each axis of a brick: a power of two that is no less than what the kernel reaches.
    pub fn brick_side(&self) -> usize {
        let least = SIDES[usize::from(D > 2)];
        least.max((self.taps.len() / 2).next_power_of_two())
    }

    /// What stands for the inverse of the energy's Hessian in the pure phases, `1 / (1 + c |1 - F'(1) k|^2)` with `k` between 0 and 1 and
    /// `c = tau / tautilde^2`: `[x, y]` of the polynomial `x + y k` with the least squares of relative errors. In the plane, where a
    /// convolution would cost more than it saves, the geometric mean of the largest and the smallest value for large `c`.
    fn phase_polynomial(&self, stiffness: f64) -> [f64; 2] {
        const SAMPLES: usize = 256;
        if D == 2 {
            return [1.0 / (1.0 + stiffness * (1.0 - self.slope).abs()), 0.0];
        }
        let inverse = |k: f64| 1.0 + stiffness * (1.0 - self.slope * k).powi(2);
        let ks = (0..SAMPLES).map(|i| (i as f64 + 0.5) / SAMPLES as f64);
        let [mut a, mut b, mut c, mut p, mut q] = [0.0; 5];
        for k in ks {
            let w = inverse(k);
            a += w * w;
            b += w * w * k;
            c += w * w * k * k;
            p += w;
            q += w * k;
        }
        let determinant = a * c - b * b;
        [(p * c - q * b) / determinant, (q * a - p * b) / determinant]
    }

    /// The operator on some bricks.
    pub fn on(&self, bricks: &Bricks<D>, device: &ComputeDevice) -> BrickOperator<D> {
        let (side, neighbours) = (bricks.side(), bricks.neighbours());
        let outside = convolution_of_outside::<D>(side, &neighbours, &self.taps, self.phase_values);
        let count = bricks.places().len();
        BrickOperator {
            operator: self.clone(),
            taps: device.tensor(&self.taps, [self.taps.len()]),
            neighbours: device.tensor(&neighbours, [count, 2 * D]),
            outside: device.tensor(&outside, bricks.shape()),
        }
    }
}

/// `V[u] = F(K * u)` on active bricks, where `u` is constant outside.
#[derive(Clone, Debug)]
pub struct BrickOperator<const D: usize> {
    operator: SeparableOperator<D>,
    taps: Tensor<1>,
    neighbours: Tensor<2>,
    /// What the values outside add to the convolution.
    outside: Tensor<D>,
}

impl<const D: usize> BrickOperator<D> {
    /// `V[u]`, on the device of `u` (which may be Burn's capture device), differentiable in `u`.
    pub fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        let device = u.device();
        let taps = self.taps.clone().to_device(&device);
        let neighbours = self.neighbours.clone().to_device(&device);
        let outside = self.outside.clone().to_device(&device);
        let table = self.operator.table.clone().to_device(&device);
        let smoothed = brick_convolution(u, taps, neighbours, false) + outside;
        tabulated(smoothed, table, self.operator.range, 0)
    }

    /// An approximate inverse of the energy's Hessian in the pure phases, for `c = tau / tautilde^2`: it applies `x + y K`, in the
    /// precision of the field. Up to what passes over the bricks lose at their edge it is symmetric.
    pub fn phase_preconditioner(
        &self,
        stiffness: f64,
    ) -> impl Fn(&Tensor<D>) -> Tensor<D> + Send + Sync + use<D> {
        let [x, y] = self.operator.phase_polynomial(stiffness);
        let y = y / self.operator.taps.iter().sum::<f64>().powi(D as i32);
        let (taps, neighbours) = (self.taps.clone(), self.neighbours.clone());
        move |r| {
            if y == 0.0 {
                return scaled(r, x);
            }
            let (taps, neighbours) = (
                taps.clone().cast(r.dtype()),
                neighbours.clone().cast(r.dtype()),
            );
            let smoothed = brick_convolution(r.clone(), taps, neighbours, false);
            combined(smoothed, y, r, x)
        }
    }
}

impl<const D: usize> MeanCurvatureStep<D> for BrickOperator<D> {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        BrickOperator::apply(self, u)
    }

    fn identity(&self) -> Identity {
        identity(&self.operator.network)
    }

    fn allows_single_precision(&self) -> bool {
        true
    }

    fn phase_values(&self) -> [f64; 2] {
        self.operator.phase_values()
    }

    fn brick_side(&self) -> Option<usize> {
        Some(self.operator.brick_side())
    }

    fn on(&self, nodes: &Nodes<D>) -> Result<Arc<dyn MeanCurvatureStep<D>>, StepFailure> {
        let Some(bricks) = nodes.bricks() else {
            let step = self.identity().name;
            return Err(Box::new(StepError::BricksOnly { step }));
        };
        let operator = &self.operator;
        Ok(Arc::new(operator.on(bricks, &operator.device)))
    }

    fn phase_inverses(
        &self,
        _nodes: &Nodes<D>,
        _device: &ComputeDevice,
    ) -> Result<PhaseInverses<D>, StepFailure> {
        let step = self.clone();
        Ok(Arc::new(move |stiffness| {
            Arc::new(BrickOperator::phase_preconditioner(&step, stiffness)) as PhaseInverse<D>
        }))
    }

    fn calibrate(
        &self,
        _scales: &StepScales,
        _device: &ComputeDevice,
    ) -> Result<Calibration, StepFailure> {
        Ok(self.operator.network.calibration()?)
    }
}

/// The function of one variable whose product with itself along all axes is the kernel.
fn factor<const D: usize>(kernel: &[f64], width: usize) -> Result<Vec<f64>, Error> {
    let total: f64 = kernel.iter().sum();
    let rows = kernel.chunks_exact(kernel.len() / width);
    let scale = total.abs().powf(1.0 - 1.0 / D as f64);
    let taps: Vec<f64> = rows.map(|row| row.iter().sum::<f64>() / scale).collect();
    let product = |place: usize| -> f64 {
        (0..D)
            .map(|axis| taps[place / width.pow(axis as u32) % width])
            .product()
    };
    let largest = kernel.iter().fold(0.0, |most: f64, k| most.max(k.abs()));
    let error = (kernel.iter().enumerate())
        .map(|(place, value)| (value - product(place)).abs() / largest)
        .fold(0.0, f64::max);
    if error <= SEPARABLE {
        Ok(taps)
    } else {
        Err(Error::NotSeparable { error })
    }
}

/// The solution of `F(m z) = z` near a phase, by Newton's method.
fn rest(table: &HermiteTable, mass: f64, phase: f64) -> Result<f64, Error> {
    const ITERATIONS: usize = 30;
    const NEAR: f64 = 0.1;
    let mut z = phase;
    for _ in 0..ITERATIONS {
        let slope = mass * table.derivative(mass * z, 1) - 1.0;
        z -= (table.derivative(mass * z, 0) - z) / slope;
    }
    if (z - phase).abs() < NEAR {
        Ok(z)
    } else {
        Err(Error::NoRest { phase })
    }
}
