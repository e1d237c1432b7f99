//! The operator on a device, as a Burn graph.

use burn::tensor::Tensor;
use operators::{
    COEFFICIENTS, ComputeDevice, SpectralFilter, TableRange, circular_convolution, tabulated,
};

use crate::{Error, Network};

/// `V[u] = F(K * u)` in `D` dimensions, ready to be applied, differentiated or captured.
///
/// `F` is the quintic Hermite table of the network's activation, so that `F`, `F'` and `F''` belong to one function.
#[derive(Clone, Debug)]
pub struct MeanCurvatureOperator<const D: usize> {
    kernel: Tensor<D>,
    table: Tensor<2>,
    range: TableRange,
    host_kernel: Vec<f64>,
    width: usize,
    slope: f64,
}

impl<const D: usize> MeanCurvatureOperator<D> {
    /// Uploads a network.
    ///
    /// # Errors
    /// [`Error::Shape`] if the network is of another dimension; as [`Network::table`].
    pub fn new(network: &Network, device: &ComputeDevice) -> Result<Self, Error> {
        let ratios = network.ratios_in(D)?;
        let table = network.table()?;
        let (range, mass) = (table.range(), network.mass());
        Ok(Self {
            kernel: device.tensor(network.kernel(), [ratios.width; D]),
            table: device.tensor(table.coefficients(), [range.cells, COEFFICIENTS]),
            range,
            host_kernel: network.kernel().to_vec(),
            width: ratios.width,
            slope: 0.5 * (table.derivative(mass, 1) + table.derivative(-mass, 1)),
        })
    }

    /// `V[u]`, on the device of `u` (which may be Burn's capture device), differentiable in `u`.
    pub fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        let device = u.device();
        let kernel = self.kernel.clone().to_device(&device);
        let table = self.table.clone().to_device(&device);
        let smoothed = circular_convolution(u, kernel, false);
        tabulated(smoothed, table, self.range, 0)
    }

    /// The inverse of the energy's Hessian in the pure phases, `1 / (1 + c |1 - F'(m) k|^2)` with `k` the kernel's
    /// transfer function, `m` its value for constants and `c = tau / tautilde^2`: the preconditioner of a minimizing-movement step.
    pub fn phase_preconditioner(&self, cells: usize, stiffness: f64) -> SpectralFilter {
        let slope = self.slope;
        SpectralFilter::from_kernel(&[cells; D], &self.host_kernel, self.width, |k| {
            let defect = 1.0 - k.scale(slope);
            1.0 / (1.0 + stiffness * defect.norm_sqr())
        })
    }

    /// Refuses a grid that the kernel does not fit on.
    ///
    /// # Errors
    /// [`Error::KernelTooWide`].
    pub fn check_grid(&self, cells: usize) -> Result<(), Error> {
        if self.width > cells {
            return Err(Error::KernelTooWide {
                width: self.width,
                cells,
            });
        }
        Ok(())
    }
}
