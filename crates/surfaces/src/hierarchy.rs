//! A hierarchy of bounding boxes of triangles.

use crate::triangle::{Part, Triangle, offset};
use crate::vector::Vector;

/// Most triangles in a box of the lowest level.
const LEAF: usize = 4;

/// Boxes around all triangles, around halves of them, halves of these, and so on.
#[derive(Clone, Debug)]
pub(crate) struct Hierarchy {
    triangles: Vec<Triangle>,
    /// The two halves of box `i` are `2 i + 1` and `2 i + 2`; the last level is complete.
    boxes: Vec<Bounds>,
}

#[derive(Clone, Copy, Debug)]
struct Bounds {
    min: Vector,
    max: Vector,
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
        let mut boxes = vec![Bounds::around(triangles.iter().take(1)); (2 << levels) - 1];
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        divide(triangles, &mut order, &mut boxes, 0);
        let triangles = order.iter().map(|&t| triangles[t]).collect();
        (Self { triangles, boxes }, order)
    }

    pub(crate) fn triangle(&self, number: usize) -> &Triangle {
        &self.triangles[number]
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
        if self.boxes[0].squared_distance(x) < bound {
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
            .map(|(half, range)| (self.boxes[half].squared_distance(x), half, range));
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

impl Bounds {
    fn around<'a>(triangles: impl IntoIterator<Item = &'a Triangle>) -> Self {
        let empty = Self {
            min: Vector::INFINITY,
            max: Vector::NEG_INFINITY,
        };
        triangles
            .into_iter()
            .flatten()
            .fold(empty, |bounds, &corner| Self {
                min: bounds.min.min(corner),
                max: bounds.max.max(corner),
            })
    }

    fn squared_distance(&self, x: Vector) -> f64 {
        let outside = (self.min - x).max(x - self.max).max(Vector::ZERO);
        outside.length_squared()
    }
}

/// Sorts the triangles of a box into its halves and these likewise, and sets their bounds.
fn divide(triangles: &[Triangle], order: &mut [usize], boxes: &mut [Bounds], node: usize) {
    boxes[node] = Bounds::around(order.iter().map(|&t| &triangles[t]));
    if 2 * node + 1 >= boxes.len() {
        return;
    }
    let axis = (boxes[node].max - boxes[node].min).max_position();
    let centre = |t: &usize| triangles[*t].iter().map(|corner| corner[axis]).sum::<f64>();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)));
    let (low, high) = order.split_at_mut(middle);
    divide(triangles, low, boxes, 2 * node + 1);
    divide(triangles, high, boxes, 2 * node + 2);
}
