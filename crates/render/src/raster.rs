//! Triangles on a raster.

use std::ops::Range;

/// Rounding must not leave gaps between triangles that share an edge.
const TOLERANCE: f64 = 1e-9;

/// A triangle in a picture: two coordinates in pixels, and a third number that is linear in the
/// picture and larger for what is nearer.
#[derive(Clone, Copy)]
pub(crate) struct Triangle {
    corners: [[f64; 3]; 3],
    /// Twice the signed area, negative where the triangle is seen from its front.
    pub area: f64,
}

impl Triangle {
    pub fn new(corners: [[f64; 3]; 3]) -> Self {
        let [a, b, c] = corners;
        Self {
            corners,
            area: (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]),
        }
    }

    /// Weights of the corners at a point; negative ones outside.
    pub fn weights(&self, x: f64, y: f64) -> [f64; 3] {
        let [a, b, c] = self.corners;
        let part = |p: [f64; 3], q: [f64; 3]| {
            ((p[0] - x) * (q[1] - y) - (p[1] - y) * (q[0] - x)) / self.area
        };
        let [first, second] = [part(b, c), part(c, a)];
        [first, second, 1.0 - first - second]
    }

    /// The weights in space, where the third number is the reciprocal of a distance.
    pub fn perspective_weights(&self, x: f64, y: f64) -> [f64; 3] {
        let weights = self.weights(x, y);
        let near: [f64; 3] = std::array::from_fn(|k| weights[k] * self.corners[k][2]);
        let sum: f64 = near.iter().sum();
        near.map(|weight| weight / sum)
    }

    /// The rows, of so many, that hold points with half-integer coordinates which may be in the triangle.
    pub fn rows(&self, rows: Range<usize>) -> Range<usize> {
        self.range(1, rows)
    }

    fn range(&self, axis: usize, within: Range<usize>) -> Range<usize> {
        let [a, b, c] = self.corners.map(|corner| corner[axis]);
        let [low, high] = [a.min(b).min(c) - 0.5, a.max(b).max(c) + 0.5];
        // Casts cut off what is behind the point and saturate: what is far outside leaves an empty range.
        let before = low as usize;
        let first = before.saturating_add(usize::from((before as f64) < low));
        first.max(within.start)..(high as usize).min(within.end)
    }

    /// Visits the points with half-integer coordinates in the triangle, in these columns and rows:
    /// column, row, third number.
    pub fn scan(
        &self,
        columns: usize,
        rows: Range<usize>,
        mut visit: impl FnMut(usize, usize, f64),
    ) {
        let (x, y) = (self.range(0, 0..columns), self.rows(rows));
        // Most triangles of a fine mesh are smaller than a pixel.
        if x.is_empty() || y.is_empty() || self.area == 0.0 || !self.area.is_finite() {
            return;
        }
        let [a, b, c] = self.corners;
        let slope = [b[1] - c[1], c[1] - a[1], a[1] - b[1]].map(|v| v / self.area);
        for row in y {
            let mut weights = self.weights(x.start as f64 + 0.5, row as f64 + 0.5);
            for column in x.clone() {
                if weights.iter().all(|&weight| weight >= -TOLERANCE) {
                    let near = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];
                    visit(column, row, near);
                }
                weights = std::array::from_fn(|k| weights[k] + slope[k]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_that_share_edges_cover_a_polygon_without_gaps() {
        const SIDE: usize = 40;
        let centre = [19.3, 21.7, 1.0];
        let rim = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / 17.0;
            [19.3 + 15.0 * angle.cos(), 21.7 + 15.0 * angle.sin(), 2.0]
        };
        let mut seen = vec![0; SIDE * SIDE];
        for k in 0..17 {
            let triangle = Triangle::new([centre, rim(k), rim((k + 1) % 17)]);
            assert!(triangle.area > 0.0);
            triangle.scan(SIDE, 0..SIDE, |x, y, near| {
                seen[y * SIDE + x] += 1;
                // A cone of slope 1/15, and flat sides.
                let radius = (x as f64 + 0.5 - 19.3).hypot(y as f64 + 0.5 - 21.7);
                assert!((near - 1.0 - radius / 15.0).abs() < 0.03, "{near} {radius}");
            });
        }
        let area = 0.5 * 17.0 * 225.0 * (std::f64::consts::TAU / 17.0).sin();
        let covered = seen.iter().filter(|&&count| count > 0).count() as f64;
        assert!((covered - area).abs() < 8.0, "{covered} {area}");
        assert!(seen.iter().all(|&count| count < 2));
    }
}
