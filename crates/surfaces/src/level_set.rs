//! Points on level sets.

use geometry::{Field, Grid, distances_from_phase_field};
use rayon::prelude::*;

use crate::Error;
use crate::vector::Vector;

/// The distances `-(4 eps/3) atanh u` of a phase field as a function with a continuous gradient, [`Field::spline`].
#[derive(Clone, Debug)]
pub(crate) struct LevelSet {
    distance: Field<3>,
}

/// Newton steps of a projection, at most,
const STEPS: usize = 10;
/// and the part of the spacing at which they end.
const TOLERANCE: f64 = 1e-6;
/// A gradient below this, where that of a distance is 1, points nowhere.
const FLAT: f64 = 0.1;

impl LevelSet {
    /// Of a phase field.
    ///
    /// # Errors
    /// `eps` must be finite and positive, the values finite.
    pub(crate) fn new(u: &Field<3>, eps: f64) -> Result<Self, Error> {
        let distance = distances_from_phase_field(u, eps)?;
        Ok(Self { distance })
    }

    /// The distances at the nodes.
    pub(crate) fn distance(&self) -> &Field<3> {
        &self.distance
    }

    /// The grid.
    pub(crate) fn grid(&self) -> &Grid<3> {
        self.distance.grid()
    }

    /// The distance at `x`, negative inside.
    pub(crate) fn value(&self, x: [f64; 3]) -> f64 {
        self.value_and_gradient(Vector::from_array(x)).0
    }

    /// The point where the distance has the value `level`, by Newton's method along the gradient from `x`. Where the gradient
    /// vanishes on the way, as in the middle of a plate, it ends; it goes no further than `reach` from `x`.
    pub(crate) fn project(&self, x: [f64; 3], level: f64, reach: f64) -> [f64; 3] {
        let start = Vector::from_array(x);
        let spacing = self.grid().spacing();
        let mut at = start;
        for _ in 0..STEPS {
            let (value, gradient) = self.value_and_gradient(at);
            let squared = gradient.length_squared();
            if squared < FLAT * FLAT {
                break;
            }
            let step = gradient * ((level - value) / squared);
            at += step.clamp_length_max(spacing);
            if step.length_squared() < (TOLERANCE * spacing).powi(2) {
                break;
            }
        }
        (start + (at - start).clamp_length_max(reach)).to_array()
    }

    /// Many points at once, in parallel.
    pub(crate) fn values(&self, points: &[[f64; 3]]) -> Vec<f64> {
        points.par_iter().map(|&x| self.value(x)).collect()
    }

    /// The distance at `x` and its gradient.
    pub(crate) fn value_and_gradient(&self, x: Vector) -> (f64, Vector) {
        let (value, gradient) = self.distance.spline(x.to_array());
        (value, gradient.into())
    }
}
