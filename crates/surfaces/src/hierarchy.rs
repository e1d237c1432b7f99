//! A hierarchy of bounding boxes of triangles.

use geometry::measure::BoundingBox;

use crate::triangle::{Part, Triangle, offset};
use crate::vector::Vector;

/// Most triangles in a box of the lowest level.
const LEAF: usize = 4;

/// Boxes around all triangles, around halves of them, halves of these, and so on.
#[derive(Clone, Debug)]
pub(crate) struct Hierarchy {
    pub(crate) triangles: Vec<Triangle>,
    /// The two halves of box `i` are `2 i + 1` and `2 i + 2`; the last level is complete.
    boxes: Vec<BoundingBox<3>>,
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
        let triangles = order.iter().map(|&t| triangles[t]).collect();
        (Self { triangles, boxes }, order)
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
            for triangle in range {
                let candidate = self.project(x, triangle);
                if candidate.squared_distance < bound(best) {
                    *best = Some(candidate);
                }
            }
            return;
        }
        let middle = range.start.midpoint(range.end);
        let mut halves = [(first, range.start..middle), (first + 1, middle..range.end)]
            .map(|(half, range)| (squared_distance(&self.boxes[half], x), half, range));
        if halves[1].0 < halves[0].0 {
            halves.swap(0, 1);
        }
        for (distance, half, range) in halves {
            if distance < bound(best) {
                self.search(x, half, range, best);
            }
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
