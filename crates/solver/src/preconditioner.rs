//! Preconditioners of the linear solves.

use std::cell::Cell;

use burn::tensor::Tensor;
use geometry::Nodes;
use mean_curvature::PhaseInverse;
use operators::{ComputeDevice, SharedUpdate, update_on_host};

use crate::Error;
use crate::interface::InterfaceModes;
use crate::region::Region;
use crate::times::{PhaseTimes, timed};

/// Which parts of the preconditioner.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    Both,
    Phase,
}

/// A symmetric positive definite approximation of the inverse Hessian: the exact one in the pure phases, which handles
/// everything but displacements of the interface, plus a coarse correction for those that follows the interface.
pub(crate) struct Preconditioner<const D: usize> {
    pub(crate) phase: PhaseInverse<D>,
    pub(crate) nodes: Nodes<D>,
    pub(crate) eps: f64,
    /// The size of the time step.
    pub(crate) tau: f64,
    /// The weight of the curvature in it.
    pub(crate) stiffness: f64,
    /// Where values may move, if not everywhere: it is projected there from both sides, which keeps it symmetric and positive.
    pub(crate) region: Option<Region<D>>,
    /// None before it [follows](Self::follow) the interface.
    pub(crate) interface: Option<SharedUpdate>,
}

impl<const D: usize> Preconditioner<D> {
    /// Moves the coarse correction to the interface of `u`.
    pub(crate) fn follow(
        &mut self,
        u: &Tensor<D>,
        device: &ComputeDevice,
        times: &Cell<PhaseTimes>,
    ) -> Result<(), Error> {
        let u = device.values(u.clone())?;
        let region = self.region.as_ref().map(|region| &*region.marks);
        let find = || InterfaceModes::samples(&self.nodes, &u, self.eps, self.stiffness, region);
        let samples = timed(times, |t| &mut t.samples, find);
        let modes = samples
            .and_then(|samples| InterfaceModes::on(&self.nodes, samples, self.eps, self.tau));
        self.interface = modes.map(SharedUpdate::new);
        Ok(())
    }

    /// Applies it, in the precision of `r`.
    pub(crate) fn apply(&self, r: &Tensor<D>, level: Level, times: &Cell<PhaseTimes>) -> Tensor<D> {
        let z = (self.phase)(r);
        let z = match &self.interface {
            Some(interface) if level == Level::Both => {
                timed(times, |t| &mut t.coarse, || update_on_host(r, z, interface))
            }
            _ => z,
        };
        Region::project(self.region.as_ref(), z)
    }
}
