//! Flows of plane curves, spectral in the tangent angle.
//!
//! The curve is given by its tangent angle over the arc length, and its points stay equally spaced (Hou, Lowengrub, Shelley, J.
//! Comput. Phys. 114, 1994). In the time `tau` of the curve scaled to length `2 pi`, `dt = (length / 2 pi)^m dtau` with `m = 4` for
//! Willmore flow and `m = 2` for curve shortening, the stiff part is exactly `theta_tau = -(-d^2/dalpha^2)^(m/2) theta`; it is
//! integrated by exponential time differencing of order four, two half steps against one whole step choose the length of the
//! step, and their difference is extrapolated. A polygon starts with the self-similar solutions of its corners.

use crate::exponential::Exponential;
use crate::shape::MOST_ROUNDING;
use crate::{Accuracy, Curve, Error, Flow, Shape, stepping};

/// The accuracy of plane curves: errors of about 1e-8 of their size.
pub const ACCURACY: Accuracy = Accuracy {
    rounding: MOST_ROUNDING,
    tolerance: 1e-10,
};

/// The curve at increasing times.
///
/// ```
/// use reference::{Flow, Shape, planar};
///
/// let circle = Shape::circle([0.0, 0.0], 0.5)?;
/// let curves = planar::evolve(&circle, Flow::Willmore, &[0.01, 0.02], &planar::ACCURACY)?;
/// let radius = (0.5_f64.powi(4) + 2.0 * 0.02).powf(0.25);
/// assert!((curves[1].length() / std::f64::consts::TAU - radius).abs() < 1e-9);
/// # Ok::<(), reference::Error>(())
/// ```
///
/// # Errors
/// Times must increase from zero, for polygons from the time of the rounding; see [`Error`] for singularities.
pub fn evolve(
    shape: &Shape,
    flow: Flow,
    times: &[f64],
    accuracy: &Accuracy,
) -> Result<Vec<Curve>, Error> {
    const MOST_FOLDS: usize = 64;
    let start = shape.curve(flow, accuracy.rounding, MOST_FOLDS)?;
    let method = Exponential {
        flow,
        revolution: false,
    };
    stepping::run(&method, flow, accuracy.tolerance, start, times)
}
