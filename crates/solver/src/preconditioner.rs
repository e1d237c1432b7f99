//! Preconditioners of the linear solves.

use burn::tensor::Tensor;
use geometry::Grid;
use operators::{ComputeDevice, SpectralFilter, spectral_filter};

use crate::Error;
use crate::interface::InterfaceModes;

/// A symmetric positive definite approximation of the inverse Hessian: the exact one in the pure phases, which handles
/// everything but displacements of the interface, plus a coarse correction for those.
pub struct Preconditioner {
    phase: SpectralFilter,
    interface: Option<InterfaceModes>,
}

impl From<SpectralFilter> for Preconditioner {
    /// The part for the pure phases alone.
    fn from(phase: SpectralFilter) -> Self {
        Self {
            phase,
            interface: None,
        }
    }
}

impl Preconditioner {
    /// Both parts, at the phase field `u` with interface width `eps`, for a step of size `tau`.
    pub fn two_level<const D: usize>(
        phase: SpectralFilter,
        grid: &Grid<D>,
        u: &[f64],
        eps: f64,
        tau: f64,
    ) -> Self {
        Self {
            phase,
            interface: InterfaceModes::new(grid, u, eps, tau),
        }
    }

    /// Applies it.
    pub(crate) fn apply<const D: usize>(
        &self,
        r: &Tensor<D>,
        device: &ComputeDevice,
    ) -> Result<Tensor<D>, Error> {
        let z = spectral_filter(r.clone(), &self.phase);
        let Some(interface) = &self.interface else {
            return Ok(z);
        };
        let mut values = device.values(z)?;
        interface.correct(&device.values(r.clone())?, &mut values);
        Ok(device.tensor(&values, r.dims()))
    }

    /// The part for the pure phases.
    pub(crate) fn phase(&self) -> &SpectralFilter {
        &self.phase
    }
}
