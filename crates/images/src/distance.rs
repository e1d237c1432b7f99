//! Signed distances to outlines and to interfaces of phase fields.

use geometry::contour::Polyline;
use geometry::{Field, SignedDistance, distances_from_phase_field};
use rstar::primitives::Line;
use rstar::{AABB, Envelope, RTree};

use crate::{Error, Outline};

/// Coordinates are below this, so that squares of distances are far from overflowing.
const FAR: f64 = 1e100;

impl Outline {
    /// The signed distance to the curves: negative inside, exact to rounding; NaN for coordinates that are not finite, or beyond `1e100`.
    ///
    /// The nearest segment is found in an R-tree. A point is inside if a ray from it crosses
    /// the curves an odd number of times, so that curves which touch or overlap do no harm.
    pub fn distance(&self) -> impl SignedDistance<2> + use<> {
        let segments = self.curves().iter().flat_map(Polyline::segments);
        let segments = RTree::bulk_load(segments.map(|(a, b)| Line::new(a, b)).collect());
        move |x: [f64; 2]| {
            if !x.iter().all(|v| v.abs() < FAR) {
                return f64::NAN;
            }
            let nearest = segments.nearest_neighbor_with_distance_2(x);
            let distance = nearest.map_or(f64::NAN, |(_, squared)| squared.sqrt());
            let sign = if is_inside(&segments, x) { -1.0 } else { 1.0 };
            sign * distance
        }
    }
}

/// Whether a ray to the left or right, to where the bounding box is nearer, crosses the segments an odd number of times.
fn is_inside(segments: &RTree<Line<[f64; 2]>>, [x, y]: [f64; 2]) -> bool {
    let bounds = segments.root().envelope();
    if !bounds.contains_point(&[x, y]) {
        return false;
    }
    let (left, right) = (bounds.lower()[0], bounds.upper()[0]);
    let leftwards = x - left < right - x;
    let end = if leftwards { left } else { right };
    let ray = AABB::from_corners([end, y], [x, y]);
    let crosses = |Line { from, to }: &&Line<[f64; 2]>| {
        // The lower end belongs to a segment, the upper one does not: every corner counts once.
        let across = (from[1] > y) != (to[1] > y);
        let at = from[0] + (y - from[1]) / (to[1] - from[1]) * (to[0] - from[0]);
        across && (at < x) == leftwards
    };
    let crossed = segments.locate_in_envelope_intersecting(ray);
    crossed.filter(crosses).count() % 2 == 1
}

/// The distance `s = -(4 eps / 3) atanh u` to the interface of a phase field of width `eps`, interpolated by cubics.
///
/// The interpolant is [`geometry::Stored::spline`]. Near the interface of a phase field that keeps its profile it is the signed distance;
/// elsewhere it has the right sign at the nodes. In the box it is periodic; it ends at the faces, beyond which everything is outside.
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
