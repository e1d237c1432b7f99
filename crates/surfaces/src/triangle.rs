//! Triangles and their nearest points.

use crate::vector::{Vector, scaled_normal};

/// Corners, counter-clockwise seen from outside.
pub(crate) type Triangle = [Vector; 3];

/// Where on a triangle a point lies.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    /// Number of the corner.
    Corner(usize),
    /// Between this corner and the next.
    Edge(usize),
    Inside,
}

/// From the point of a triangle nearest to `x` to `x`, and where that point is.
///
/// The regions are those of C. Ericson: Real-Time Collision Detection (2005), section 5.1.5, with the side of an edge
/// on which `x` lies taken from the triple product with the normal, which stays exact for slender triangles.
pub(crate) fn offset(triangle: &Triangle, x: Vector) -> (Vector, Part) {
    let edges: [Vector; 3] = std::array::from_fn(|i| triangle[(i + 1) % 3] - triangle[i]);
    let from = triangle.map(|corner| x - corner);
    for i in 0..3 {
        // Beyond the corner on both of its edges.
        if edges[i].dot(from[i]) <= 0.0 && edges[(i + 2) % 3].dot(from[i]) >= 0.0 {
            return (from[i], Part::Corner(i));
        }
    }
    let normal = scaled_normal(*triangle);
    for i in 0..3 {
        let (begin, end) = (edges[i].dot(from[i]), edges[i].dot(from[(i + 1) % 3]));
        if begin > 0.0 && end < 0.0 && normal.dot(edges[i].cross(from[i])) <= 0.0 {
            let foot = edges[i] * (begin / (begin - end));
            return (from[i] - foot, Part::Edge(i));
        }
    }
    let height = normal.dot(from[0]) / normal.length_squared();
    (normal * height, Part::Inside)
}
