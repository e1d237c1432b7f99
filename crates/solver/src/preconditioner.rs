//! Preconditioners of the linear solves.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::Grid;
use model::Smoother;
use operators::{Bricks, ComputeDevice, SpectralFilter, spectral_filter, update_on_host};

use crate::interface::InterfaceModes;
use crate::{Error, Region};

/// An approximate inverse of the Hessian in the pure phases.
#[derive(Clone, Debug)]
pub enum PhaseInverse {
    /// Diagonal in Fourier space.
    Spectral(SpectralFilter),
    /// A polynomial of the convolution on active bricks.
    Bricks(Box<Smoother>),
}

impl From<SpectralFilter> for PhaseInverse {
    fn from(filter: SpectralFilter) -> Self {
        Self::Spectral(filter)
    }
}

impl PhaseInverse {
    fn apply<const D: usize>(&self, r: &Tensor<D>) -> Tensor<D> {
        match self {
            Self::Spectral(filter) => spectral_filter(r.clone(), filter),
            Self::Bricks(smoother) => smoother.apply(r),
        }
    }
}

/// A symmetric positive definite approximation of the inverse Hessian: the exact one in the pure phases, which handles
/// everything but displacements of the interface, plus a coarse correction for those that follows the interface.
pub struct Preconditioner<const D: usize> {
    phase: PhaseInverse,
    scales: Option<Scales<D>>,
    interface: Option<Arc<InterfaceModes<D>>>,
    region: Option<Region<D>>,
}

/// What the coarse correction needs to know of a step.
struct Scales<const D: usize> {
    grid: Grid<D>,
    eps: f64,
    tau: f64,
    /// The active bricks, where values are stored on such.
    bricks: Option<Arc<Bricks<D>>>,
}

impl<const D: usize> From<SpectralFilter> for Preconditioner<D> {
    /// The approximation in the pure phases alone.
    fn from(filter: SpectralFilter) -> Self {
        Self {
            phase: filter.into(),
            scales: None,
            interface: None,
            region: None,
        }
    }
}

impl<const D: usize> Preconditioner<D> {
    /// With the coarse correction, for phase fields with interface width `eps` and a step of size `tau`.
    pub fn two_level(phase: PhaseInverse, grid: &Grid<D>, eps: f64, tau: f64) -> Self {
        let scales = Scales {
            grid: *grid,
            eps,
            tau,
            bricks: None,
        };
        Self {
            phase,
            scales: Some(scales),
            interface: None,
            region: None,
        }
    }

    /// The same for values on active bricks, if there are such.
    #[must_use]
    pub(crate) fn on(mut self, bricks: Option<&Arc<Bricks<D>>>) -> Self {
        if let Some(scales) = &mut self.scales {
            scales.bricks = bricks.cloned();
        }
        self
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
        if let Some(scales) = &self.scales {
            let Scales { grid, eps, tau, .. } = scales;
            let u = device.values(u.clone())?;
            let region = self.region.as_ref().map(Region::nodes);
            self.interface = match &scales.bricks {
                None => InterfaceModes::new(grid, grid, &u, *eps, *tau, region),
                Some(bricks) => InterfaceModes::new(grid, &**bricks, &u, *eps, *tau, region),
            }
            .map(Arc::new);
        }
        Ok(())
    }

    /// Applies it, in the precision of `r`.
    pub(crate) fn apply(&self, r: &Tensor<D>) -> Tensor<D> {
        let z = self.phase.apply(r);
        self.projected(match &self.interface {
            Some(interface) => update_on_host(r, z, interface),
            None => z,
        })
    }

    /// Applies the approximation in the pure phases alone.
    pub(crate) fn apply_phase(&self, r: &Tensor<D>) -> Tensor<D> {
        self.projected(self.phase.apply(r))
    }

    fn projected(&self, z: Tensor<D>) -> Tensor<D> {
        Region::project(self.region.as_ref(), z)
    }
}
