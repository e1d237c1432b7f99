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
    /// Those of the boxes of the last level.
    corners: Corners,
}

/// The corners of the triangles of boxes of the last level, which bound their squared distances from below.
///
/// A point of a triangle with the longest side `l` is no farther than `l / sqrt 3` from a corner, and the way from `x` to the nearest point of the
/// triangle is perpendicular to that to such a corner: `|x - corner|^2 - l^2 / 3` is at most the squared distance. That is far quicker than the nearest
/// point, and for distances that are large against the sides hardly less. Triangles that are neighbours have most of their corners in common, so that a
/// box is looked at in a fraction of the time of its triangles.
#[derive(Clone, Debug, Default)]
struct Corners {
    /// Where the corners of each box begin, and the end of all.
    starts: Vec<u32>,
    /// Coordinates of different corners, so many at a time; the last one again where there are fewer.
    places: Vec<[[f64; LANES]; 3]>,
    /// `l^2 / 3` of the largest triangle of each box,
    rooms: Vec<f64>,
    /// and of each triangle.
    own_rooms: Vec<f64>,
}

/// Corners that are looked at together.
const LANES: usize = 4;

impl Corners {
    /// Adds a box.
    fn push(&mut self, triangles: &[Triangle]) {
        let mut corners: Vec<Vector> = Vec::with_capacity(3 * LEAF);
        for corner in triangles.as_flattened() {
            if !corners.contains(corner) {
                corners.push(*corner);
            }
        }
        self.starts.push(self.places.len() as u32);
        self.places.extend(corners.chunks(LANES).map(|corners| {
            let corner = |lane: usize| corners[lane.min(corners.len() - 1)];
            [0, 1, 2].map(|axis| std::array::from_fn(|lane| corner(lane)[axis]))
        }));
        let room = |[a, b, c]: &Triangle| {
            let sides = [
                a.distance_squared(*b),
                b.distance_squared(*c),
                c.distance_squared(*a),
            ];
            (1.0 + ROUNDING) * sides.into_iter().fold(0.0, f64::max) / 3.0
        };
        let rooms = triangles.iter().map(room);
        self.rooms.push(rooms.clone().fold(0.0, f64::max));
        self.own_rooms.extend(rooms);
    }

    fn of_box(&self, leaf: usize) -> &[[[f64; LANES]; 3]] {
        let end = self.starts.get(leaf + 1);
        let end = end.map_or(self.places.len(), |&end| end as usize);
        &self.places[self.starts[leaf] as usize..end]
    }

    /// The lower bound for the squared distances of a box from `x`.
    fn bound(&self, leaf: usize, x: Vector) -> f64 {
        let mut least = [f64::INFINITY; LANES];
        for [xs, ys, zs] in self.of_box(leaf) {
            for (lane, least) in least.iter_mut().enumerate() {
                let [dx, dy, dz] = [xs[lane] - x.x, ys[lane] - x.y, zs[lane] - x.z];
                let squared = dx * dx + dy * dy + dz * dz;
                // Not `min`, which looks for NaN.
                *least = if squared < *least { squared } else { *least };
            }
        }
        let least = least
            .into_iter()
            .fold(f64::INFINITY, |a, b| if b < a { b } else { a });
        least * (1.0 - ROUNDING) - self.rooms[leaf]
    }

    /// The same for the places of a row.
    fn bounds_of_row(&self, leaf: usize, [x, y]: [f64; 2], z: &[f64; ROW]) -> [f64; ROW] {
        let mut least = [f64::INFINITY; ROW];
        for [xs, ys, zs] in self.of_box(leaf) {
            for lane in 0..LANES {
                let [dx, dy] = [xs[lane] - x, ys[lane] - y];
                let lateral = dx * dx + dy * dy;
                for (z, least) in z.iter().zip(&mut least) {
                    let dz = zs[lane] - z;
                    let squared = lateral + dz * dz;
                    *least = if squared < *least { squared } else { *least };
                }
            }
        }
        least.map(|least| least * (1.0 - ROUNDING) - self.rooms[leaf])
    }

    /// That of a triangle of a hierarchy.
    fn bound_of(&self, number: usize, triangle: &Triangle, x: Vector) -> f64 {
        let [a, b, c] = triangle.map(|corner| corner.distance_squared(x));
        a.min(b).min(c) * (1.0 - ROUNDING) - self.own_rooms[number]
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
    /// Divides at the median of the centres along the axis on which they are spread most; `order` maps the numbers of the triangles in the
    /// hierarchy to those given.
    pub(crate) fn new(triangles: &[Triangle]) -> (Self, Vec<usize>) {
        let levels = triangles.len().div_ceil(LEAF).next_power_of_two().ilog2();
        let centred = |(number, triangle): (usize, &Triangle)| Centred {
            centre: triangle[0] + triangle[1] + triangle[2],
            number,
        };
        let mut centred: Vec<Centred> = triangles.iter().enumerate().map(centred).collect();
        divide(&mut centred, levels);
        let order: Vec<usize> = centred.into_iter().map(|c| c.number).collect();
        let triangles: Vec<Triangle> = order.iter().map(|&t| triangles[t]).collect();
        let mut boxes = vec![bounds(triangles.iter().take(1)); (2 << levels) - 1];
        let mut corners = Corners::default();
        pack(&triangles, 0, &mut boxes, &mut corners);
        let hierarchy = Self {
            triangles,
            boxes,
            corners,
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
        let touches = |own: &BoundingBox<3>| {
            (0..3).all(|k| own.lower[k] <= bounds.upper[k] && own.upper[k] >= bounds.lower[k])
        };
        self.any_meeting(&touches, holds)
    }

    /// The same of something that meets a box if it meets one within.
    pub(crate) fn any_meeting(
        &self,
        meets: &impl Fn(&BoundingBox<3>) -> bool,
        holds: &mut impl FnMut(usize) -> bool,
    ) -> bool {
        self.any_in(0, 0..self.triangles.len(), meets, holds)
    }

    fn any_in(
        &self,
        node: usize,
        range: std::ops::Range<usize>,
        meets: &impl Fn(&BoundingBox<3>) -> bool,
        holds: &mut impl FnMut(usize) -> bool,
    ) -> bool {
        if !meets(&self.boxes[node]) {
            return false;
        }
        let first = 2 * node + 1;
        if first >= self.boxes.len() {
            return range.into_iter().any(holds);
        }
        let middle = range.start.midpoint(range.end);
        self.any_in(first, range.start..middle, meets, holds)
            || self.any_in(first + 1, middle..range.end, meets, holds)
    }

    /// Whether a triangle is within this squared distance; the first one that is found ends the search.
    pub(crate) fn is_within(&self, x: Vector, squared: f64) -> bool {
        self.is_within_box(x, squared, 0, 0..self.triangles.len())
    }

    fn is_within_box(
        &self,
        x: Vector,
        squared: f64,
        node: usize,
        range: std::ops::Range<usize>,
    ) -> bool {
        let first = 2 * node + 1;
        if first >= self.boxes.len() {
            let is_near = |triangle: usize| {
                self.corners
                    .bound_of(triangle, &self.triangles[triangle], x)
                    <= squared
                    && self.project(x, triangle).squared_distance <= squared
            };
            return self.corners.bound(self.leaf(node), x) <= squared
                && range.into_iter().any(is_near);
        }
        let middle = range.start.midpoint(range.end);
        let halves = [(first, range.start..middle), (first + 1, middle..range.end)];
        let far = halves
            .clone()
            .map(|(half, _)| squared_distance(&self.boxes[half], x));
        let nearer = usize::from(far[1] < far[0]);
        [nearer, 1 - nearer].into_iter().any(|half| {
            let (node, range) = halves[half].clone();
            far[half] <= squared && self.is_within_box(x, squared, node, range)
        })
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
            if self.corners.bound(self.leaf(node), x) < bound(best) {
                for triangle in range {
                    let least = self
                        .corners
                        .bound_of(triangle, &self.triangles[triangle], x);
                    if least >= bound(best) {
                        continue;
                    }
                    let candidate = self.project(x, triangle);
                    if candidate.squared_distance < bound(best) {
                        *best = Some(candidate);
                    }
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

    /// The number of a box of the last level among these.
    fn leaf(&self, node: usize) -> usize {
        node - self.boxes.len() / 2
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

/// Places in a row along the last axis, for which a hierarchy is walked once.
pub(crate) const ROW: usize = 8;

/// The search for the points that are nearest to the places of a row.
pub(crate) struct RowSearch<'a> {
    hierarchy: &'a Hierarchy,
    x: f64,
    y: f64,
    z: [f64; ROW],
    /// The nearest points so far.
    best: [Option<Nearest>; ROW],
    /// Their squared distances.
    bounds: [f64; ROW],
}

impl<'a> RowSearch<'a> {
    /// The nearest points; none where squares of distances are not finite. A triangle that is not far from the nearest one speeds up the search.
    pub(crate) fn nearest(
        hierarchy: &'a Hierarchy,
        [x, y]: [f64; 2],
        z: [f64; ROW],
        guesses: [Option<usize>; ROW],
    ) -> [Option<Nearest>; ROW] {
        let mut search = Self {
            hierarchy,
            x,
            y,
            z,
            best: [None; ROW],
            bounds: [f64::MAX; ROW],
        };
        for (place, guess) in guesses.into_iter().enumerate() {
            if let Some(triangle) = guess {
                search.look(place, triangle);
            }
        }
        if search.distance_of_box(0).is_some() {
            search.walk(0, 0..hierarchy.triangles.len());
        }
        search.best
    }

    fn place(&self, place: usize) -> Vector {
        Vector::new(self.x, self.y, self.z[place])
    }

    /// Takes the nearest point of a triangle where nothing nearer is known.
    fn look(&mut self, place: usize, triangle: usize) {
        let candidate = self.hierarchy.project(self.place(place), triangle);
        if candidate.squared_distance < self.bounds[place] {
            self.bounds[place] = candidate.squared_distance;
            self.best[place] = Some(candidate);
        }
    }

    /// The least squared distance of a box from the row; none if something nearer is known for each place.
    fn distance_of_box(&self, node: usize) -> Option<f64> {
        let BoundingBox { lower, upper } = &self.hierarchy.boxes[node];
        let across = |x: f64, axis: usize| larger(larger(lower[axis] - x, x - upper[axis]), 0.0);
        let [dx, dy] = [across(self.x, 0), across(self.y, 1)];
        let lateral = dx * dx + dy * dy;
        let (mut least, mut is_near) = (f64::INFINITY, false);
        for (z, bound) in self.z.iter().zip(&self.bounds) {
            let dz = across(*z, 2);
            let squared = lateral + dz * dz;
            is_near |= squared < *bound;
            least = if squared < least { squared } else { least };
        }
        is_near.then_some(least)
    }

    fn walk(&mut self, node: usize, range: std::ops::Range<usize>) {
        let first = 2 * node + 1;
        if first >= self.hierarchy.boxes.len() {
            self.look_into(self.hierarchy.leaf(node), range);
            return;
        }
        let middle = range.start.midpoint(range.end);
        let (low, high) = (range.start..middle, middle..range.end);
        let [below, above] = [first, first + 1].map(|half| self.distance_of_box(half));
        match (below, above) {
            (None, None) => {}
            (Some(_), None) => self.walk(first, low),
            (None, Some(_)) => self.walk(first + 1, high),
            (Some(below), Some(above)) => {
                let halves = [(first, low), (first + 1, high)];
                let [nearer, farther] = if below <= above {
                    halves
                } else {
                    let [low, high] = halves;
                    [high, low]
                };
                self.walk(nearer.0, nearer.1);
                // Something nearer may be known now.
                if self.distance_of_box(farther.0).is_some() {
                    self.walk(farther.0, farther.1);
                }
            }
        }
    }

    /// Looks at the triangles of a box of the last level.
    fn look_into(&mut self, leaf: usize, range: std::ops::Range<usize>) {
        let hierarchy = self.hierarchy;
        let least = hierarchy
            .corners
            .bounds_of_row(leaf, [self.x, self.y], &self.z);
        for (place, least) in least.into_iter().enumerate() {
            if least >= self.bounds[place] {
                continue;
            }
            let x = self.place(place);
            for triangle in range.clone() {
                let corners = &hierarchy.triangles[triangle];
                if hierarchy.corners.bound_of(triangle, corners, x) < self.bounds[place] {
                    self.look(place, triangle);
                }
            }
        }
    }
}

/// Not `f64::max`, which looks for NaN.
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
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

/// A triangle by which boxes are divided.
struct Centred {
    /// Three times the centre.
    centre: Vector,
    number: usize,
}

/// From so many triangles on, the halves of a box are divided on two cores.
const IN_PARALLEL: usize = 1 << 13;

/// Sorts triangles into two halves and these likewise, so many times.
fn divide(centred: &mut [Centred], levels: u32) {
    if levels == 0 {
        return;
    }
    let ends = [Vector::INFINITY, Vector::NEG_INFINITY];
    let [low, high] = centred.iter().fold(ends, |[low, high], triangle| {
        [low.min(triangle.centre), high.max(triangle.centre)]
    });
    let axis = (high - low).max_position();
    let middle = centred.len() / 2;
    centred.select_nth_unstable_by(middle, |a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    let (below, above) = centred.split_at_mut(middle);
    if below.len() < IN_PARALLEL {
        divide(below, levels - 1);
        divide(above, levels - 1);
    } else {
        rayon::join(|| divide(below, levels - 1), || divide(above, levels - 1));
    }
}

/// Sets the bounds of a box and of those in it, from their triangles in order, and adds the boxes of the last level.
fn pack(triangles: &[Triangle], node: usize, boxes: &mut [BoundingBox<3>], corners: &mut Corners) {
    let first = 2 * node + 1;
    if first >= boxes.len() {
        boxes[node] = bounds(triangles);
        corners.push(triangles);
        return;
    }
    let (low, high) = triangles.split_at(triangles.len() / 2);
    pack(low, first, boxes, corners);
    pack(high, first + 1, boxes, corners);
    let ends = [first, first + 1].map(|half| [boxes[half].lower, boxes[half].upper]);
    boxes[node] = BoundingBox::around(ends.into_iter().flatten()).expect("there are four ends");
}
