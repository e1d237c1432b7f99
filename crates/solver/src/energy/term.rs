//! What an energy can have besides bending.

use std::sync::Arc;

use burn::tensor::Tensor;

use crate::{Domain, Error, Identity};

/// A term of the energy of a flow, besides that of bending, as a Burn graph of the phase field.
///
/// Most terms are a [`density`](Self::density) and an [`identity`](Self::identity). Made of tensor operations and of those of the [`Domain`], they
/// hold on the whole grid, on bricks and on the coarser grids on which steps begin; what is not stored counts with the density of
/// the pure phases. Derivatives are those of the graph.
///
/// ```
/// use burn::tensor::Tensor;
/// use geometry::Field;
/// use serde_json::json;
/// use solver::{Domain, EnergyTerm, Error, Identity};
///
/// /// `g int height`, over the inside: it weighs `g` per volume.
/// struct Gravity {
///     height: Field<3>,
///     g: f64,
/// }
///
/// impl EnergyTerm<3> for Gravity {
///     fn density(&self, u: &Tensor<3>, on: &Domain<3>) -> Result<Option<Tensor<3>>, Error> {
///         Ok(Some(on.inside(u) * on.field(&self.height)? * self.g))
///     }
///
///     fn identity(&self) -> Identity {
///         Identity::new("gravity", json!({ "g": self.g }))
///     }
/// }
/// ```
///
/// # Errors
/// Whatever the operations of the domain raise stops the flow that takes the term.
pub trait EnergyTerm<const D: usize>: Send + Sync {
    /// The energy per area (2D) or volume (3D) at every stored node, in the shape of `u`; none for a term that has no such.
    ///
    /// Where the derivative by `u` is a multiple of the [slope](Domain::slope), the term moves the interface and does not bend its profile.
    fn density(&self, _u: &Tensor<D>, _on: &Domain<D>) -> Result<Option<Tensor<D>>, Error> {
        Ok(None)
    }

    /// The integral of the density over what is not stored, so that energies do not jump when bricks change: by default
    /// [evaluated](Domain::integral_of_unstored) in the pure phases, which takes as much work as the grid has nodes.
    fn unstored(&self, on: &Domain<D>) -> Result<f64, Error> {
        on.integral_of_unstored(|u, on| self.density(u, on))
    }

    /// The energy, a single number: the integral of the density unless it is told in another way.
    fn energy(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<1>>, Error> {
        let Some(density) = self.density(u, on)? else {
            return Ok(None);
        };
        let stored = density.sum() * on.cell_volume();
        Ok(Some(stored + self.unstored(on)?))
    }

    /// What is added to `V[u] - u` before it is squared, in the shape of `u`: `g tautilde kappa_0 q'`, with the [response](Domain::response) `g`, the
    /// [inner step](Domain::mcf_step) `tautilde` and the [slope](Domain::slope) `q'`, makes `kappa_0` the curvature that costs nothing. It has to
    /// vanish in the pure phases.
    fn shift(&self, _u: &Tensor<D>, _on: &Domain<D>) -> Result<Option<Tensor<D>>, Error> {
        Ok(None)
    }

    /// The name and the parameters: what a flow that is resumed compares.
    fn identity(&self) -> Identity;
}

/// Terms of an energy, which add up.
pub type EnergyTerms<const D: usize> = Vec<Arc<dyn EnergyTerm<D>>>;

/// The sum of their energies at `u`, where there are such.
pub(crate) fn energies<const D: usize>(
    terms: &[Arc<dyn EnergyTerm<D>>],
    u: &Tensor<D>,
    on: &Domain<D>,
) -> Result<Option<Tensor<1>>, Error> {
    let found = terms.iter().map(|term| term.energy(u, on));
    let found: Vec<_> = found.collect::<Result<_, _>>()?;
    Ok(found
        .into_iter()
        .flatten()
        .reduce(|sum, energy| sum + energy))
}

/// The residual with their shifts.
pub(crate) fn shifted<const D: usize>(
    residual: Tensor<D>,
    terms: &[Arc<dyn EnergyTerm<D>>],
    u: &Tensor<D>,
    on: &Domain<D>,
) -> Result<Tensor<D>, Error> {
    terms.iter().try_fold(residual, |residual, term| {
        Ok(match term.shift(u, on)? {
            Some(shift) => residual + shift,
            None => residual,
        })
    })
}
