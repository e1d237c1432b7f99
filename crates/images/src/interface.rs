//! The distance to the interface of a phase field between its nodes.

use geometry::{Field, SignedDistance, distances_from_phase_field};

use crate::Error;

/// The distance `s = -(4 eps / 3) atanh u` to the interface of a phase field of width `eps`, interpolated by cubics.
///
/// The interpolant is [`geometry::Stored::spline`]. Near the interface of a phase field that keeps its profile it is the signed distance;
/// elsewhere it has the right sign. In the box it is periodic; it ends at the faces, beyond which everything is outside.
///
/// # Errors
/// `eps` must be finite and positive, the values finite.
pub fn interface(u: &Field<2>, eps: f64) -> Result<impl SignedDistance<2> + use<>, Error> {
    let distance = distances_from_phase_field(u, eps)?;
    Ok(move |x: [f64; 2]| {
        let (low, side) = (distance.grid().origin(), distance.grid().side());
        let nearest = std::array::from_fn(|i| x[i].clamp(low[i], low[i] + side));
        // The box is inside its faces.
        let [a, b] = std::array::from_fn(|i| (low[i] - x[i]).max(x[i] - low[i] - side));
        let outside = a.max(0.0).hypot(b.max(0.0));
        let to_box = if a.max(b) > 0.0 { outside } else { a.max(b) };
        if x.iter().any(|v| v.is_nan()) {
            return f64::NAN;
        }
        distance.spline(nearest).0.max(to_box)
    })
}
