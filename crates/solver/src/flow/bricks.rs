//! Flows on active bricks, which follow the interface.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Nodes, Stored};

use super::{Minimum, Movement, WillmoreFlow};
use crate::Error;
use crate::active::Active;
use crate::stored::{stored, tensor};

impl<const D: usize> WillmoreFlow<D> {
    /// Minimizes the energy of a movement from the present phase field. If the interface comes near the edge of the active bricks, these are
    /// made more, and the minimization goes on from there.
    pub(super) fn minimize(&mut self, movement: &Movement<'_, D>) -> Result<Minimum<D>, Error> {
        let mut minimum = self.minimize_here(movement)?;
        let (mut anchor, mut factors) = (movement.anchor.clone(), movement.factors.cloned());
        while let Some((from, to)) = self.enlarge(&minimum.u)? {
            let carried = |x: &Tensor<D>| -> Result<Tensor<D>, Error> {
                let before = stored(x, self.grid, Some(&from), &self.device)?;
                Ok(tensor(&before.on(&to.nodes()), &self.device))
            };
            let start = carried(&minimum.u)?;
            anchor = carried(&anchor)?;
            // Where nothing moves, factors of the motion are near 1 or, which is the same, near -1.
            factors = factors.as_ref().map(carried).transpose()?;
            let again = self.minimize_here(&Movement {
                anchor: &anchor,
                factors: factors.as_ref(),
                start: &start,
                tau: movement.tau,
                constraints: movement.constraints,
            })?;
            minimum = Minimum {
                newton: again.newton.after(&minimum.newton),
                times: minimum.times + again.times,
                ..again
            };
        }
        Ok(minimum)
    }

    /// Goes to the bricks near the interface now.
    pub(super) fn follow(&mut self) -> Result<(), Error> {
        let Some(active) = &self.active else {
            return Ok(());
        };
        let next = active.following(&self.device.values(self.current.clone())?)?;
        next.map_or(Ok(()), |next| self.go_to(next))
    }

    /// Makes the bricks more if the interface of `u` has come near their edge; those before and after.
    fn enlarge(&mut self, u: &Tensor<D>) -> Result<Option<(Active<D>, Active<D>)>, Error> {
        let Some(active) = self.active.clone() else {
            return Ok(None);
        };
        let next = active.enlarged(&self.device.values(u.clone())?)?;
        if let Some(next) = &next {
            self.go_to(next.clone())?;
        }
        Ok(next.map(|next| (active, next)))
    }

    /// Carries everything over to other bricks.
    pub(super) fn go_to(&mut self, next: Active<D>) -> Result<(), Error> {
        let nodes = next.nodes();
        let carried = |u: &Tensor<D>| -> Result<Tensor<D>, Error> {
            Ok(tensor(&self.stored(u)?.on(&nodes), &self.device))
        };
        let current = carried(&self.current)?;
        let previous = match &self.previous {
            Some((u, tau)) => Some((carried(u)?, *tau)),
            None => None,
        };
        self.rate = self.rate.as_ref().map(|rate| rate.on(&nodes));
        let region = self.region.take();
        self.region = region.map(|region| region.on(&next.bricks, &self.device));
        self.current = current;
        self.previous = previous;
        self.mcf = Arc::new(next.step(&self.device));
        self.terms = self.terms.take().map(|terms| terms.on(&next, &self.device));
        self.active = Some(next);
        // What it was prepared for belongs to the step of mean curvature flow.
        (self.phases, self.phase) = (None, None);
        self.energies = [None, None];
        Ok(())
    }

    /// Where the values of the phase field lie.
    pub(super) fn nodes(&self) -> Nodes<D> {
        let whole = || self.grid.into();
        self.active.as_ref().map_or_else(whole, Active::nodes)
    }

    /// A phase field that is stored as the present one is, for arithmetic.
    pub(super) fn stored(&self, u: &Tensor<D>) -> Result<Stored<D>, Error> {
        stored(u, self.grid, self.active.as_ref(), &self.device)
    }
}
