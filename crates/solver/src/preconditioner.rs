//! Preconditioners of the linear solves.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::Grid;
use operators::{ComputeDevice, SpectralFilter, spectral_filter, update_on_host};

use crate::interface::InterfaceModes;
use crate::{Error, Region};

/// A symmetric positive definite approximation of the inverse Hessian: the exact one in the pure phases, which handles
/// everything but displacements of the interface, plus a coarse correction for those that follows the interface.
pub struct Preconditioner<const D: usize> {
    phase: SpectralFilter,
    scales: Option<Scales<D>>,
    interface: Option<Arc<InterfaceModes<D>>>,
    region: Option<Region<D>>,
}

/// What the coarse correction needs to know of a step.
struct Scales<const D: usize> {
    grid: Grid<D>,
    eps: f64,
    tau: f64,
}

impl<const D: usize> From<SpectralFilter> for Preconditioner<D> {
    /// The approximation in the pure phases alone.
    fn from(phase: SpectralFilter) -> Self {
        Self {
            phase,
            scales: None,
            interface: None,
            region: None,
        }
    }
}

impl<const D: usize> Preconditioner<D> {
    /// With the coarse correction, for phase fields with interface width `eps` and a step of size `tau`.
    pub fn two_level(phase: SpectralFilter, grid: &Grid<D>, eps: f64, tau: f64) -> Self {
        let grid = *grid;
        Self {
            phase,
            scales: Some(Scales { grid, eps, tau }),
            interface: None,
            region: None,
        }
    }

    /// The same for the values in a region, if there is one: projected from both sides, which keeps it symmetric and positive.
    #[must_use]
    pub fn within(self, region: Option<Region<D>>) -> Self {
        Self { region, ..self }
    }

    /// Moves the coarse correction to the interface of `u`.
    ///
    /// # Errors
    /// [`Error::Operators`] if the device fails.
    pub(crate) fn follow(&mut self, u: &Tensor<D>, device: &ComputeDevice) -> Result<(), Error> {
        if let Some(Scales { grid, eps, tau }) = &self.scales {
            let u = device.values(u.clone())?;
            let region = self.region.as_ref().map(Region::nodes);
            self.interface = InterfaceModes::new(grid, &u, *eps, *tau, region).map(Arc::new);
        }
        Ok(())
    }

    /// Applies it, in the precision of `r`.
    pub(crate) fn apply(&self, r: &Tensor<D>) -> Tensor<D> {
        let z = spectral_filter(r.clone(), &self.phase);
        self.projected(match &self.interface {
            Some(interface) => update_on_host(r, z, interface),
            None => z,
        })
    }

    /// Applies the approximation in the pure phases alone.
    pub(crate) fn apply_phase(&self, r: &Tensor<D>) -> Tensor<D> {
        self.projected(spectral_filter(r.clone(), &self.phase))
    }

    fn projected(&self, z: Tensor<D>) -> Tensor<D> {
        match &self.region {
            Some(region) => region.project(z),
            None => z,
        }
    }
}
