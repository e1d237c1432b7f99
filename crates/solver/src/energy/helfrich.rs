//! Spontaneous curvature, tension and pressure.

use std::sync::Arc;

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::term::{EnergyTerm, EnergyTerms};
use crate::{Domain, Error, Identity};

/// The terms of the energy of Canham and Helfrich, `w = 1/2 int (kappa - c0)^2 + sigma A + p V`, with `kappa` the sum of the principal
/// curvatures, positive where the phase `u = 1` is convex (a ball of radius `R` has `(D - 1) / R`), `A` the perimeter, and `V` the volume of that phase.
///
/// All zero is the Willmore energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Helfrich {
    /// `c0`, one over a length.
    pub spontaneous_curvature: f64,
    /// `sigma`, energy per length (2D) or area (3D); positive draws the interface together.
    pub tension: f64,
    /// `p`, energy per area (2D) or volume (3D); positive makes the inside smaller.
    pub pressure: f64,
}

impl Helfrich {
    /// Whether the energy is that of bending alone, without spontaneous curvature.
    pub fn is_willmore(&self) -> bool {
        *self == Self::default()
    }

    /// Those that are not zero, as terms of an energy.
    ///
    /// # Errors
    /// [`Error::Geometry`] for values that are not finite.
    pub fn terms<const D: usize>(&self) -> Result<EnergyTerms<D>, Error> {
        let Self {
            spontaneous_curvature: c0,
            tension: sigma,
            pressure: p,
        } = *self;
        let all: [(&'static str, f64, Arc<dyn EnergyTerm<D>>); 3] = [
            (
                "spontaneous curvature",
                c0,
                Arc::new(SpontaneousCurvature { c0 }),
            ),
            ("tension", sigma, Arc::new(Tension { sigma })),
            ("pressure", p, Arc::new(Pressure { p })),
        ];
        let mut terms = Vec::new();
        for (name, value, term) in all {
            geometry::require(name, value, "finite", |_| true)?;
            if value != 0.0 {
                terms.push(term);
            }
        }
        Ok(terms)
    }
}

/// Bending with a curvature that costs nothing, `1/2 int (kappa - c0)^2` in place of `1/2 int kappa^2`: the residual is
/// `V[u] - u + g tautilde c0 q'` with the [slope](Domain::slope) `q'`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpontaneousCurvature {
    /// `c0`, one over a length; positive where the phase `u = 1` is convex.
    pub c0: f64,
}

impl<const D: usize> EnergyTerm<D> for SpontaneousCurvature {
    fn shift(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<D>>, Error> {
        let displacement = on.response() * on.mcf_step() * self.c0;
        Ok(Some(on.slope(u) * displacement))
    }

    fn identity(&self) -> Identity {
        Identity::new("spontaneous curvature", json!({ "c0": self.c0 }))
    }
}

/// `sigma A`, with `A = int eps/2 |grad u|^2 + Psi(u)/(2 eps)` and `Psi(u) = 9/16 (1 - u^2)^2`. On the optimal profile its derivative by `u` is the
/// displacement `kappa eps q'`, so that it does not bend it; see `docs/algorithm.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tension {
    /// `sigma`, energy per length (2D) or area (3D); positive draws the interface together.
    pub sigma: f64,
}

impl<const D: usize> EnergyTerm<D> for Tension {
    /// Not by a density: the nodes beside the bricks have their part in the gradients.
    fn energy(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<1>>, Error> {
        let well = (u.clone() * u.clone()).neg() + 1.0;
        let double_well = (well.clone() * well).sum() * (9.0 / 16.0 * on.cell_volume());
        let twice = on.dirichlet(u) * on.eps() + double_well / on.eps();
        Ok(Some(twice * (0.5 * self.sigma)))
    }

    fn identity(&self) -> Identity {
        Identity::new("tension", json!({ "sigma": self.sigma }))
    }
}

/// `p V`, with the volume [inside](Domain::inside) `V = int (2 + 3 u - u^3)/4`, whose derivative by `u` is the displacement `eps q'` on the optimal profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressure {
    /// `p`, energy per area (2D) or volume (3D); positive makes the inside smaller.
    pub p: f64,
}

impl<const D: usize> EnergyTerm<D> for Pressure {
    /// Not by a density: the inside that is not stored needs no evaluation.
    fn energy(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<1>>, Error> {
        let [_, inside] = on.unstored();
        let nodes = on.inside(u).sum() + inside as f64;
        Ok(Some(nodes * (self.p * on.cell_volume())))
    }

    fn identity(&self) -> Identity {
        Identity::new("pressure", json!({ "p": self.p }))
    }
}
