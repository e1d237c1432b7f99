//! A hierarchy of bounding boxes of triangles.

use geometry::measure::BoundingBox;

use crate::triangle::{Part, Triangle, offset};
use crate::vector::Vector;

/// Most triangles in a box of the lowest level.
const LEAF: usize = 8;
/// Bounds are less sharp by this part of themselves, which is more than their rounding.
const ROUNDING: f64 = 1e-12;

/// Boxes around all triangles, around halves of them, halves of these, and so on.
#[derive(Clone, Debug)]
pub(crate) struct Hierarchy {
    pub(crate) triangles: Vec<Triangle>,
    /// The two halves of box `i` are `2 i + 1` and `2 i + 2`; the last level is complete.
    boxes: Vec<BoundingBox<3>>,
    /// The boxes of the last level.
    leaves: Vec<Leaf>,
}

/// What bounds the squared distances of the triangles of a box from below, one in each lane.
///
/// A point of a triangle with the longest side `l` is no farther than `l / sqrt 3` from a corner, and the way from `x` to the nearest point of the
/// triangle is perpendicular to that to such a corner: `|x - corner|^2 - l^2 / 3` is at most the squared distance. That is far quicker than the nearest
/// point, and for distances that are large against the sides hardly less.
#[derive(Clone, Debug)]
struct Leaf {
    /// Coordinates of the three corners, at infinity in lanes without a triangle.
    corners: [[[f64; LEAF]; 3]; 3],
    /// `l^2 / 3`.
    room: [f64; LEAF],
}

impl Leaf {
    fn new(triangles: &[Triangle]) -> Self {
        let mut leaf = Self {
            corners: [[[f64::INFINITY; LEAF]; 3]; 3],
            room: [0.0; LEAF],
        };
        for (lane, [a, b, c]) in triangles.iter().enumerate() {
            for (corner, x) in leaf.corners.iter_mut().zip([a, b, c]) {
                for axis in 0..3 {
                    corner[axis][lane] = x[axis];
                }
            }
            let sides = [
                a.distance_squared(*b),
                b.distance_squared(*c),
                c.distance_squared(*a),
            ];
            let longest = sides.into_iter().fold(0.0, f64::max);
            leaf.room[lane] = (1.0 + ROUNDING) * longest / 3.0;
        }
        leaf
    }

    /// The lower bounds for the distances from `x`.
    fn bounds(&self, x: Vector) -> [f64; LEAF] {
        let mut least = [f64::INFINITY; LEAF];
        for [xs, ys, zs] in &self.corners {
            for (lane, least) in least.iter_mut().enumerate() {
                let [dx, dy, dz] = [xs[lane] - x.x, ys[lane] - x.y, zs[lane] - x.z];
                let squared = dx * dx + dy * dy + dz * dz;
                // Not `min`, which looks for NaN.
                *least = if squared < *least { squared } else { *least };
            }
        }
        for (least, room) in least.iter_mut().zip(&self.room) {
            *least = *least * (1.0 - ROUNDING) - room;
        }
        least
    }
}

/// The point of the triangles that is nearest to another point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    pub(crate) triangle: usize,
    pub(crate) part: Part,
    /// From the nearest point.
    pub(crate) offset: Vector,
    pub(crate) squared_distance: f64,
}

impl Hierarchy {
    /// Divides at the median of the centres along the longest side; `order` maps the numbers of the triangles in the
    /// hierarchy to those given.
    pub(crate) fn new(triangles: &[Triangle]) -> (Self, Vec<usize>) {
        let levels = triangles.len().div_ceil(LEAF).next_power_of_two().ilog2();
        let mut boxes = vec![bounds(triangles.iter().take(1)); (2 << levels) - 1];
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        divide(triangles, &mut order, &mut boxes, 0);
        let triangles: Vec<Triangle> = order.iter().map(|&t| triangles[t]).collect();
        let mut leaves = Vec::with_capacity(1 << levels);
        pack(&triangles, levels, &mut leaves);
        let hierarchy = Self {
            triangles,
            boxes,
            leaves,
        };
        (hierarchy, order)
    }

    pub(crate) fn project(&self, x: Vector, triangle: usize) -> Nearest {
        let (offset, part) = offset(&self.triangles[triangle], x);
        Nearest {
            triangle,
            part,
            offset,
            squared_distance: offset.length_squared(),
        }
    }

    /// The nearest point; `guess` if none is nearer. `None` if squares of distances are not finite.
    pub(crate) fn nearest(&self, x: Vector, guess: Option<Nearest>) -> Option<Nearest> {
        let mut best = guess;
        let bound = best.map_or(f64::MAX, |b| b.squared_distance);
        if squared_distance(&self.boxes[0], x) < bound {
            self.search(x, 0, 0..self.triangles.len(), &mut best);
        }
        best
    }

    /// Whether this holds for any triangle in a box of the last level that touches these bounds.
    pub(crate) fn any_touching(
        &self,
        bounds: &BoundingBox<3>,
        holds: &mut impl FnMut(usize) -> bool,
    ) -> bool {
        self.any_in(0, 0..self.triangles.len(), bounds, holds)
    }

    fn any_in(
        &self,
        node: usize,
        range: std::ops::Range<usize>,
        bounds: &BoundingBox<3>,
        holds: &mut impl FnMut(usize) -> bool,
    ) -> bool {
        let own = &self.boxes[node];
        if (0..3).any(|k| own.lower[k] > bounds.upper[k] || own.upper[k] < bounds.lower[k]) {
            return false;
        }
        let first = 2 * node + 1;
        if first >= self.boxes.len() {
            return range.into_iter().any(holds);
        }
        let middle = range.start.midpoint(range.end);
        self.any_in(first, range.start..middle, bounds, holds)
            || self.any_in(first + 1, middle..range.end, bounds, holds)
    }

    fn search(
        &self,
        x: Vector,
        node: usize,
        range: std::ops::Range<usize>,
        best: &mut Option<Nearest>,
    ) {
        let bound = |best: &Option<Nearest>| best.map_or(f64::MAX, |b| b.squared_distance);
        let first = 2 * node + 1;
        if first >= self.boxes.len() {
            let leaf = &self.leaves[node + 1 - self.leaves.len()];
            for (triangle, least) in range.zip(leaf.bounds(x)) {
                if least >= bound(best) {
                    continue;
                }
                let candidate = self.project(x, triangle);
                if candidate.squared_distance < bound(best) {
                    *best = Some(candidate);
                }
            }
            return;
        }
        let middle = range.start.midpoint(range.end);
        let (low, high) = (range.start..middle, middle..range.end);
        let below = squared_distance(&self.boxes[first], x);
        let above = squared_distance(&self.boxes[first + 1], x);
        // No sorted array of all this: moving it about would take longer than the rest.
        if below <= above {
            self.search_within(x, below, first, low, best);
            self.search_within(x, above, first + 1, high, best);
        } else {
            self.search_within(x, above, first + 1, high, best);
            self.search_within(x, below, first, low, best);
        }
    }

    /// Searches a box at this squared distance, unless something nearer is known.
    fn search_within(
        &self,
        x: Vector,
        squared_distance: f64,
        node: usize,
        range: std::ops::Range<usize>,
        best: &mut Option<Nearest>,
    ) {
        if squared_distance < best.map_or(f64::MAX, |b| b.squared_distance) {
            self.search(x, node, range, best);
        }
    }
}

/// The smallest box around triangles, of which there is one at least.
pub(crate) fn bounds<'a>(triangles: impl IntoIterator<Item = &'a Triangle>) -> BoundingBox<3> {
    let corners = triangles.into_iter().flatten();
    BoundingBox::around(corners.map(Vector::to_array)).expect("there are triangles")
}

fn squared_distance(bounds: &BoundingBox<3>, x: Vector) -> f64 {
    // Not by the `map` of an array, which is a call in the innermost loop of all searches.
    let (low, high) = (
        Vector::from_array(bounds.lower),
        Vector::from_array(bounds.upper),
    );
    (low - x).max(x - high).max(Vector::ZERO).length_squared()
}

/// Sorts the triangles of a box into its halves and these likewise, and sets their bounds.
fn divide(triangles: &[Triangle], order: &mut [usize], boxes: &mut [BoundingBox<3>], node: usize) {
    boxes[node] = bounds(order.iter().map(|&t| &triangles[t]));
    if 2 * node + 1 >= boxes.len() {
        return;
    }
    let axis = Vector::from_array(boxes[node].extent()).max_position();
    let centre = |t: &usize| triangles[*t].iter().map(|corner| corner[axis]).sum::<f64>();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)));
    let (low, high) = order.split_at_mut(middle);
    divide(triangles, low, boxes, 2 * node + 1);
    divide(triangles, high, boxes, 2 * node + 2);
}

/// The boxes of the last level, from their triangles in order.
fn pack(triangles: &[Triangle], levels: u32, leaves: &mut Vec<Leaf>) {
    if levels == 0 {
        leaves.push(Leaf::new(triangles));
        return;
    }
    let (low, high) = triangles.split_at(triangles.len() / 2);
    pack(low, levels - 1, leaves);
    pack(high, levels - 1, leaves);
}
