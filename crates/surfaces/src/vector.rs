//! Vectors, and what triangles need of them.

pub(crate) use glam::DVec3 as Vector;

/// Normal whose length is twice the area.
pub(crate) fn scaled_normal([a, b, c]: [Vector; 3]) -> Vector {
    (b - a).cross(c - a)
}

/// Solid angle of an oriented triangle seen from the origin, in `(-2 pi, 2 pi)`.
///
/// A. van Oosterom, J. Strackee: The solid angle of a plane triangle. IEEE Trans. Biomed. Eng. 30
/// (1983).
pub(crate) fn solid_angle([a, b, c]: [Vector; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * numerator.atan2(denominator)
}
