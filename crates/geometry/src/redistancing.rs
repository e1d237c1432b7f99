//! Signed distances to the zero level of a smooth function on a grid, of high order.

use std::array::from_fn;

use crate::bspline::Jet;
use crate::{BSpline, Grid, parallel, vector};

/// Newton's method along the gradient ends at points nearer to the zero level than this, in spacings.
const ON_LEVEL: f64 = 1e-11;
/// Points of the zero level farther from their node than this, in spacings, belong to another part of it.
const FARTHEST: f64 = 2.5;
/// Work on fewer nodes than this is not worth another thread.
const SHARE: usize = 1 << 9;
/// Width of the profile by which distances are a smooth function that the grid resolves, in spacings.
const WIDTH: f64 = 8.0;
/// Nodes without a point of the zero level.
const NOWHERE: u32 = u32::MAX;

/// A point of the zero level, with the shape of the level there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelPoint<const D: usize> {
    /// Its place.
    pub position: [f64; D],
    /// The unit normal, to where the function is positive.
    pub normal: [f64; D],
    /// The shape operator `P Hess P / |grad|` with the projection `P` on the tangent plane: its eigenvalues are the principal curvatures, positive
    /// where the negative side is convex, and zero along the normal.
    pub shape: [[f64; D]; D],
}

impl<const D: usize> LevelPoint<D> {
    fn of(position: [f64; D], jet: &Jet<D>) -> Self {
        let size = vector::norm(jet.gradient);
        let normal = jet.gradient.map(|slope| slope / size);
        let along = |v: [f64; D]| jet.hessian.map(|row| vector::dot(row, v));
        let bend = along(normal);
        let twice = vector::dot(bend, normal);
        let shape = from_fn(|a| {
            from_fn(|b| {
                let outer =
                    normal[a] * bend[b] + bend[a] * normal[b] - twice * normal[a] * normal[b];
                (jet.hessian[a][b] - outer) / size
            })
        });
        Self {
            position,
            normal,
            shape,
        }
    }

    /// The mean curvature, the sum of the principal curvatures.
    pub fn mean_curvature(&self) -> f64 {
        (0..D).map(|axis| self.shape[axis][axis]).sum()
    }

    /// The sum of the squares of the principal curvatures.
    pub fn squared_curvatures(&self) -> f64 {
        self.shape.iter().map(|row| vector::dot(*row, *row)).sum()
    }

    /// The larger of the principal curvatures, in absolute value.
    pub fn largest_curvature(&self) -> f64 {
        let (sum, squares) = (self.mean_curvature(), self.squared_curvatures());
        // In the plane the other one is zero.
        let gap = (2.0 * squares - sum * sum).max(0.0).sqrt();
        0.5 * (sum.abs() + gap)
    }

    /// Where a point is as seen from this one.
    fn seen(&self, x: [f64; D]) -> Seen<D> {
        let from_here = vector::sub(x, self.position);
        let height = vector::dot(from_here, self.normal);
        let beside = from_fn(|axis| from_here[axis] - height * self.normal[axis]);
        // (1 + b B)^-1 t by the theorem of Cayley and Hamilton in the tangent plane.
        let (sum, squares) = (self.mean_curvature(), self.squared_curvatures());
        let product = 0.5 * (sum * sum - squares);
        let determinant = 1.0 + height * sum + height * height * product;
        let bent = self.shape.map(|row| vector::dot(row, beside));
        let foot = from_fn(|axis| {
            ((1.0 + height * sum) * beside[axis] - height * bent[axis]) / determinant
        });
        Seen {
            height,
            foot,
            sag: 0.5 * vector::dot(bent, foot),
            is_regular: determinant > 0.1,
        }
    }

    /// The signed distance of a point to the level, which is taken for its osculating quadric: an error of third order in the distance of the two feet.
    /// None beyond the centres of curvature.
    fn distance(&self, x: [f64; D]) -> Option<f64> {
        let seen = self.seen(x);
        seen.is_regular.then_some(seen.height + seen.sag)
    }
}

/// A point `p + b n + t` as seen from a point `p` of a level with normal `n` and shape operator `B`.
struct Seen<const D: usize> {
    /// `b`
    height: f64,
    /// `(1 + b B)^-1 t`: where its foot is, in the tangent plane.
    foot: [f64; D],
    /// `t B (1 + b B)^-1 t / 2`: by how much the level bends away.
    sag: f64,
    /// Whether `det (1 + b B)` is well above zero.
    is_regular: bool,
}

/// How far from the zero level distances are wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceRange {
    /// Distances up to this are as exact as the spline.
    pub precise: f64,
    /// Distances beyond this are infinite.
    pub largest: f64,
}

/// The signed distances of all nodes to the zero level of a function, negative where the function is.
#[derive(Clone, Debug)]
pub struct Redistanced<const D: usize> {
    grid: Grid<D>,
    /// The distances at the nodes, in the order of the grid.
    pub distances: Vec<f64>,
    /// For each node the number of the point of the zero level that is nearest, or nearly; beyond the last of them where the distance is infinite.
    pub nearest: Vec<u32>,
    /// Points of the zero level, about two for each spacing.
    pub points: Vec<LevelPoint<D>>,
}

impl<const D: usize> Redistanced<D> {
    /// The distances to the zero level of the quintic spline through the values of a smooth function: of sixth order in the spacing up to the
    /// distance that is to be precise. Beyond it the level is taken for its osculating quadric at the nearest of the points, and beyond the
    /// centres of curvature for that point.
    ///
    /// Points of the zero level are found from the nodes next to it, by Newton's method along the gradient. They are carried over the grid as in
    /// the distance transform of Danielsson (Computer Graphics and Image Processing 14, 1980).
    ///
    /// ```
    /// use geometry::{DistanceRange, Grid, Redistanced};
    ///
    /// // A circle of radius 1/2, by a function that is no distance.
    /// let grid = Grid::<2>::centred(64, 2.0)?;
    /// let node = |i: usize| grid.node(i);
    /// let values: Vec<f64> = (0..grid.len()).map(|i| node(i)[0].powi(2) + node(i)[1].powi(2) - 0.25).collect();
    /// let range = DistanceRange { precise: 0.1, largest: 0.4 };
    /// let made = Redistanced::from_values(grid, values, range);
    /// let error = |i: usize| (made.distances[i] - (node(i)[0].hypot(node(i)[1]) - 0.5)).abs();
    /// assert!((0..grid.len()).filter(|i| made.distances[*i].abs() < 0.1).all(|i| error(i) < 1e-6));
    /// assert!((made.reach() - 0.5).abs() < 0.01);
    /// # Ok::<(), geometry::Error>(())
    /// ```
    ///
    /// # Panics
    /// Unless there is a value for each node.
    pub fn from_values(grid: Grid<D>, values: Vec<f64>, range: DistanceRange) -> Self {
        let positive: Vec<bool> = values.iter().map(|value| *value > 0.0).collect();
        let level = BSpline::through(grid, values);
        let (points, mut nearest) = points(&level, &positive);
        carry(&grid, &points, range.largest, &mut nearest);
        let distances = parallel::values(grid.len(), |node| {
            let sign = if positive[node] { 1.0 } else { -1.0 };
            match points.get(nearest[node] as usize) {
                Some(point) => {
                    let x = near(&grid, grid.node(node), point.position);
                    distance(&level, point, x, sign, range.precise)
                }
                None => sign * f64::INFINITY,
            }
        });
        Self {
            grid,
            distances,
            nearest,
            points,
        }
    }

    /// The same of what is nearly a distance `s` at the nodes, and infinite or of no account far from the zero level: by the function `tanh(s / 8 h)`.
    ///
    /// # Panics
    /// Unless there is a distance for each node.
    pub fn from_distances(grid: Grid<D>, distances: &[f64], range: DistanceRange) -> Self {
        let width = WIDTH * grid.spacing();
        let values = parallel::values(distances.len(), |node| (distances[node] / width).tanh());
        Self::from_values(grid, values, range)
    }

    /// The reach of the zero level (Federer, Trans. Amer. Math. Soc. 93, 1959): the largest radius of balls that touch it from both sides wherever they
    /// lie on it. It is at most the smallest radius of curvature, and half of the width of parts and gaps, as far as distances are known.
    pub fn reach(&self) -> f64 {
        let (h, grid) = (self.grid.spacing(), &self.grid);
        let point = |node: usize| self.points.get(self.nearest[node] as usize);
        let touching = parallel::map(grid.len(), SHARE, &|node| {
            let Some(own) = point(node) else {
                return f64::INFINITY;
            };
            let place = grid.multi_index(node);
            let radius = |axis: usize| -> Option<f64> {
                let mut next = place;
                next[axis] += 1;
                let next = grid.index(next);
                let other = point(next).filter(|_| self.nearest[next] != self.nearest[node])?;
                let gap = vector::sub(near(grid, other.position, own.position), own.position);
                let far = self.distances[node].abs().max(self.distances[next].abs());
                // Neighbours whose feet are far apart, for how far away these are, have the medial axis between them.
                let is_apart = vector::norm(gap) > far.max(4.0 * h);
                // The ball that touches at both feet.
                let turn = vector::dot(gap, vector::sub(other.normal, own.normal)).abs();
                is_apart.then(|| (vector::dot(gap, gap) / turn).max(far))
            };
            (0..D).filter_map(radius).fold(f64::INFINITY, f64::min)
        });
        let radii = self.points.iter().map(|p| p.largest_curvature().recip());
        touching
            .into_iter()
            .chain(radii)
            .fold(f64::INFINITY, f64::min)
    }
}

/// The image of a point in the periodic box that is nearest to another point.
fn near<const D: usize>(grid: &Grid<D>, x: [f64; D], other: [f64; D]) -> [f64; D] {
    let side = grid.side();
    from_fn(|axis| {
        let gap = x[axis] - other[axis];
        if gap.abs() <= 0.5 * side {
            x[axis]
        } else {
            x[axis] - side * (gap / side).round()
        }
    })
}

/// The points of the zero level from the nodes next to it, and for each node the number of its own.
fn points<const D: usize>(level: &BSpline<D>, positive: &[bool]) -> (Vec<LevelPoint<D>>, Vec<u32>) {
    let grid = level.grid();
    let is_next_to_level = |node: usize| {
        let place = grid.multi_index(node);
        (0..D).any(|axis| {
            [1, grid.cells() - 1].into_iter().any(|step| {
                let mut other = place;
                other[axis] += step;
                positive[grid.index(other)] != positive[node]
            })
        })
    };
    let found = parallel::filter_map(grid.len(), SHARE, &|node| {
        let point = is_next_to_level(node).then(|| on_level(level, grid.node(node)))??;
        Some((node, point))
    });
    let mut nearest = vec![NOWHERE; grid.len()];
    for (number, (node, _)) in found.iter().enumerate() {
        nearest[*node] = number as u32;
    }
    (found.into_iter().map(|(_, point)| point).collect(), nearest)
}

/// The point of the zero level that Newton's method finds from a point along the gradient.
fn on_level<const D: usize>(level: &BSpline<D>, start: [f64; D]) -> Option<LevelPoint<D>> {
    const MOST: usize = 12;
    let h = level.grid().spacing();
    let mut x = start;
    for _ in 0..MOST {
        let jet = level.at(x);
        let square = vector::dot(jet.gradient, jet.gradient);
        let step = jet.value / square;
        if step.abs() * square.sqrt() < ON_LEVEL * h {
            let is_near = vector::norm(vector::sub(x, start)) < FARTHEST * h;
            return is_near.then(|| LevelPoint::of(x, &jet));
        }
        let longest = h / square.sqrt();
        x = vector::sub(
            x,
            vector::scale(jet.gradient, step.clamp(-longest, longest)),
        );
    }
    None
}

/// Gives every node the nearest of the points of its neighbours, in sweeps in all diagonal directions, as far as they are near enough.
fn carry<const D: usize>(
    grid: &Grid<D>,
    points: &[LevelPoint<D>],
    largest: f64,
    nearest: &mut [u32],
) {
    // Only what the sweeps read, side by side in memory.
    let positions: Vec<[f64; D]> = points.iter().map(|point| point.position).collect();
    let side = grid.side();
    let squared = |x: [f64; D], number: u32| {
        let position = positions[number as usize];
        let mut square = 0.0;
        for axis in 0..D {
            let gap = (x[axis] - position[axis]).abs();
            let gap = gap.min((side - gap).abs());
            square += gap * gap;
        }
        square
    };
    let limit = largest * largest;
    let mut squares = parallel::values(nearest.len(), |node| match nearest[node] {
        NOWHERE => limit,
        number => squared(grid.node(node), number),
    });
    let (cells, last) = (grid.cells(), D - 1);
    let rows = grid.len() / cells;
    // Twice, since what a sweep carries may come around the period.
    for sweep in 0..2_usize << D {
        let is_back = |axis: usize| sweep >> axis & 1 == 1;
        let before = |axis: usize, at: usize| {
            if is_back(axis) {
                (at + 1) % cells
            } else {
                (at + cells - 1) % cells
            }
        };
        for count in 0..rows {
            let row = if is_back(0) { rows - 1 - count } else { count };
            let mut place = grid.multi_index(row * cells);
            for (axis, at) in place.iter_mut().enumerate().take(last).skip(1) {
                if is_back(axis) != is_back(0) {
                    *at = cells - 1 - *at;
                }
            }
            let start = grid.index(place);
            let neighbours: [usize; D] = from_fn(|axis| {
                let mut other = place;
                if axis < last {
                    other[axis] = before(axis, place[axis]);
                }
                grid.index(other)
            });
            let mut x = grid.node(start);
            for count in 0..cells {
                let at = if is_back(last) {
                    cells - 1 - count
                } else {
                    count
                };
                let node = start + at;
                x[last] = grid.coordinate(last, at);
                for axis in 0..D {
                    let from = if axis < last { at } else { before(last, at) };
                    let number = nearest[neighbours[axis] + from];
                    if number == NOWHERE || number == nearest[node] {
                        continue;
                    }
                    let square = squared(x, number);
                    if square < squares[node] {
                        (squares[node], nearest[node]) = (square, number);
                    }
                }
            }
        }
    }
}

/// The signed distance of a point near which this one of the zero level is, on this side of it.
fn distance<const D: usize>(
    level: &BSpline<D>,
    point: &LevelPoint<D>,
    x: [f64; D],
    sign: f64,
    precise: f64,
) -> f64 {
    let seen = point.seen(x);
    if !seen.is_regular {
        return sign * vector::norm(vector::sub(x, point.position));
    }
    let first = seen.height + seen.sag;
    if first.abs() > precise {
        return first;
    }
    // From the point under the node, as the quadric has it.
    let along = vector::add(point.position, seen.foot);
    let bent = point.shape.map(|row| vector::dot(row, seen.foot));
    let sag = 0.5 * vector::dot(bent, seen.foot);
    let foot = vector::sub(along, vector::scale(point.normal, sag));
    let jet = level.at(foot);
    let step = jet.value / vector::dot(jet.gradient, jet.gradient);
    let foot = vector::sub(foot, vector::scale(jet.gradient, step));
    LevelPoint::of(foot, &jet).distance(x).unwrap_or(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SignedDistance;
    use crate::shapes::Ellipse;

    const RANGE: DistanceRange = DistanceRange {
        precise: 0.15,
        largest: 0.5,
    };

    /// The distances to the level of a shape, by a function whose values are far from that.
    fn redistanced<const D: usize>(cells: usize, shape: &impl SignedDistance<D>) -> Redistanced<D> {
        let grid = Grid::<D>::centred(cells, 2.0).unwrap();
        let values = parallel::values(grid.len(), |node| {
            let x = grid.node(node);
            let distorted = 1.5 + (3.0 * x[0]).sin() * x[1].cos();
            (shape.signed_distance(x) / 0.15).tanh() * distorted
        });
        Redistanced::from_values(grid, values, RANGE)
    }

    /// The largest errors of precise distances, and of the others but for those near the medial axis.
    fn errors<const D: usize>(cells: usize, shape: &impl SignedDistance<D>) -> [f64; 2] {
        let made = redistanced(cells, shape);
        let mut errors = [0.0_f64; 2];
        for (node, distance) in made.distances.iter().enumerate() {
            let truth = shape.signed_distance(made.grid.node(node));
            assert!(distance.is_finite() || truth.abs() > 0.49, "{truth}");
            if truth.abs() < 0.3 && truth > -0.2 {
                let place = usize::from(truth.abs() >= RANGE.precise - 1e-3);
                errors[place] = errors[place].max((distance - truth).abs());
            }
        }
        errors
    }

    #[test]
    fn distances_are_those_of_the_shape_to_sixth_order() {
        let ellipse = Ellipse::new([0.6, 0.45]).unwrap();
        let [coarse, fine] = [48, 96].map(|cells| errors(cells, &ellipse));
        let order = (coarse[0] / fine[0]).log2();
        assert!(order > 5.5 && fine[0] < 1e-7, "{order} {fine:?}");
        assert!(fine[1] < 3e-5, "{fine:?}");
        let ball = |x: [f64; 3]| vector::norm(x) - 0.55;
        let [coarse, fine] = [24, 48].map(|cells| errors(cells, &ball));
        let order = (coarse[0] / fine[0]).log2();
        assert!(order > 5.5 && fine[0] < 2e-6, "{order} {fine:?}");
    }

    #[test]
    fn points_have_the_curvatures_of_the_surface() {
        // A torus: the circle of its tube around its axis, and the circle around the axis of the torus.
        let (large, small) = (0.45, 0.25);
        let torus = |[x, y, z]: [f64; 3]| (x.hypot(y) - large).hypot(z) - small;
        let made = redistanced(96, &torus);
        for point in &made.points {
            let [x, y, _] = point.position;
            let around = x.hypot(y);
            let other = (around - large) / small / around;
            let (mean, squares) = (small.recip() + other, small.powi(-2) + other * other);
            assert!((point.mean_curvature() - mean).abs() < 5e-3 * mean.abs().max(1.0));
            assert!((point.squared_curvatures() / squares - 1.0).abs() < 5e-3);
            let largest = small.recip().max(other.abs());
            assert!((point.largest_curvature() / largest - 1.0).abs() < 5e-3);
        }
    }

    #[test]
    fn the_reach_is_that_of_curvature_gaps_and_periods() {
        let near =
            |reach: f64, truth: f64| assert!((reach - truth).abs() < 0.01, "{reach} {truth}");
        // The sharpest ends of an ellipse; two discs; the gap between a disc and its periodic image.
        near(
            redistanced(96, &Ellipse::new([0.6, 0.4]).unwrap()).reach(),
            0.4 * 0.4 / 0.6,
        );
        let discs = |[x, y]: [f64; 2]| (x.abs() - 0.42).hypot(y) - 0.3;
        near(redistanced(96, &discs).reach(), 0.12);
        let disc = |[x, y]: [f64; 2]| x.hypot(y) - 0.8;
        near(redistanced(96, &disc).reach(), 0.2);
        let nothing =
            Redistanced::from_values(Grid::<2>::centred(8, 2.0).unwrap(), vec![1.0; 64], RANGE);
        assert!(nothing.points.is_empty() && nothing.reach().is_infinite());
        assert!(
            nothing
                .distances
                .iter()
                .all(|distance| *distance == f64::INFINITY)
        );
    }
}
