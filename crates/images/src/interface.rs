//! The distance to the interface of a phase field between its nodes.

use geometry::{Field, SignedDistance, distances_from_phase_field};

use crate::Error;

/// The distance `s = -(4 eps / 3) atanh u` to the interface, interpolated by cubics.
///
/// The interpolant is [`Field::spline`]. Near the interface of a phase field that keeps its profile it is the signed distance;
/// elsewhere it has the right sign. In the box it is periodic; it ends at the faces, beyond which everything is outside.
#[derive(Clone, Debug)]
pub struct Interface {
    distance: Field<2>,
}

impl Interface {
    /// Of a phase field with an interface of width `eps`.
    ///
    /// # Errors
    /// `eps` must be finite and positive, the values finite.
    pub fn new(u: &Field<2>, eps: f64) -> Result<Self, Error> {
        let distance = distances_from_phase_field(u, eps)?;
        Ok(Self { distance })
    }
}

impl SignedDistance<2> for Interface {
    fn signed_distance(&self, x: [f64; 2]) -> f64 {
        let (low, side) = (self.distance.grid().origin(), self.distance.grid().side());
        let nearest = std::array::from_fn(|i| x[i].clamp(low[i], low[i] + side));
        // The box is inside its faces.
        let [a, b] = std::array::from_fn(|i| (low[i] - x[i]).max(x[i] - low[i] - side));
        let to_box = if a.max(b) > 0.0 {
            a.max(0.0).hypot(b.max(0.0))
        } else {
            a.max(b)
        };
        if x.iter().any(|v| v.is_nan()) {
            return f64::NAN;
        }
        self.distance.spline(nearest).0.max(to_box)
    }
}
