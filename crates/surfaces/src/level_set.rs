//! Points on level sets.

use geometry::Stored;

use crate::vector::Vector;

/// Newton steps of a projection, at most,
const STEPS: usize = 10;
/// and the part of the spacing at which they end.
const TOLERANCE: f64 = 1e-6;
/// A gradient below this, where that of a distance is 1, points nowhere.
const FLAT: f64 = 0.1;

/// The point where the [spline](Stored::spline) of a distance has the value `level`, by Newton's method along the gradient from `x`.
/// Where the gradient vanishes on the way, as in the middle of a plate, it ends; it goes no further than `reach` from `x`.
pub(crate) fn project(distance: &Stored<3>, x: [f64; 3], level: f64, reach: f64) -> [f64; 3] {
    let start = Vector::from_array(x);
    let spacing = distance.grid().spacing();
    let mut at = start;
    for _ in 0..STEPS {
        let (value, gradient) = distance.spline(at.to_array());
        let gradient = Vector::from_array(gradient);
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
