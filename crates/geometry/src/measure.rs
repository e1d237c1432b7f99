//! Distances, perimeter, enclosed volume and extent of fields.
//!
//! Sums run in parallel over fixed chunks, so that results do not depend on the number of threads.

use crate::error::positive;
use crate::profile::profile_variable;
use crate::{Error, Lookup, PhaseField, parallel};

/// `L2` norm `sqrt(h^D sum (a - b)^2)` of the difference: the trapezoidal rule on the periodic box, not a mean. The sum is over the whole grid,
/// in its order, wherever the values are stored.
///
/// # Errors
/// Both fields must live on the same grid.
pub fn l2_distance<const D: usize>(
    a: &impl PhaseField<D>,
    b: &impl PhaseField<D>,
) -> Result<f64, Error> {
    let grid = a.nodes().grid();
    grid.same_as(b.nodes().grid())?;
    let fields: [&dyn PhaseField<D>; 2] = [a, b];
    let sum = parallel::sum_of_chunks(grid.len(), &|nodes| {
        let [a, b] = fields.map(|field| {
            let mut values = vec![0.0; nodes.len()];
            field.read(nodes.start, &mut values);
            values
        });
        let pairs = a.iter().zip(&b);
        pairs.map(|(a, b)| (a - b) * (a - b)).sum()
    });
    Ok((grid.cell_volume() * sum).sqrt())
}

/// Whether there is an interface at all.
pub fn has_interface<const D: usize>(u: &impl PhaseField<D>) -> bool {
    let inside = u.values().iter().filter(|u| **u > 0.0).count() + positive_outside(u);
    inside > 0 && inside < u.nodes().grid().len()
}

/// How many nodes that are not stored have positive values.
fn positive_outside<const D: usize>(u: &impl PhaseField<D>) -> usize {
    let outside = u.nodes().outside().into_iter().zip(u.phase_values());
    let outside = outside.map(|(nodes, rest)| if rest > 0.0 { nodes } else { 0 });
    outside.sum()
}

/// Whether a node at the side of the box has a value above this one.
pub fn touches_side<const D: usize>(u: &impl PhaseField<D>, above: f64) -> bool {
    let nodes = u.nodes();
    let last = nodes.grid().cells() - 1;
    let at_side = |node: usize| (nodes.multi_index(node).iter()).any(|&i| i == 0 || i == last);
    let stored = (u.values().iter().enumerate()).any(|(node, u)| *u > above && at_side(node));
    let outside = |phase: bool| {
        let mut bricks = (nodes.bricks().into_iter()).flat_map(|bricks| bricks.not_active(phase));
        bricks.any(|[first, end]| first.contains(&0) || end.contains(&last))
    };
    stored
        || ([false, true].into_iter())
            .any(|positive| u.value(Lookup::Pure { positive }) > above && outside(positive))
}

/// Perimeter `P_eps[u] = 1/2 integral of eps |grad u|^2 + Psi(u)/eps`, `Psi(u) = 9/16 (1-u^2)^2`.
///
/// For phase fields it tends to the length (area in 3D) of the interface as `eps -> 0`; at a
/// sphere of radius `r` in 3D the excess is `4 pi * 0.573 eps^2`, at a circle it is exponentially
/// small.
///
/// Discretisation: along each axis the derivative at the middle of an edge is the fourth-order
/// difference `(27 (u_1 - u_0) - (u_2 - u_-1)) / (24 h)`; squares are summed over the
/// edges, and the double well over the nodes, with weight `h^D`. The sums are spectrally accurate
/// on a periodic grid, so the error is `O(h^4)` at fixed `eps`: a relative 1e-4 at `eps = 2h`.
///
/// # Errors
/// `eps` must be finite and positive.
pub fn perimeter<const D: usize>(u: &impl PhaseField<D>, eps: f64) -> Result<f64, Error> {
    positive("eps", eps)?;
    let (nodes, v) = (u.nodes(), u.values());
    let h = nodes.grid().spacing();
    let well = |u: f64| {
        let well = 1.0 - u * u;
        0.5625 * well * well / eps
    };
    let square = |[a, b, c, d]: [f64; 4]| ((27.0 * (c - b) - (d - a)) / 24.0).powi(2);
    let density = |node: usize| {
        let (place, here) = (nodes.multi_index(node), v[node]);
        let along = |axis: usize| {
            let beside = nodes.along(node, place, axis, [-1, 1, 2]);
            let [before, next, second] = beside.map(|found| u.value(found));
            let mut squares = square([before, here, next, second]);
            // Edges where nothing is stored, at whose ends or beside which something is.
            if beside[0].stored().is_none() {
                squares += square([before, before, here, next]);
                squares += square([before, before, before, here]);
            }
            if beside[1].stored().is_none() {
                squares += square([here, next, next, next]);
            }
            squares
        };
        let gradient: f64 = (0..D).map(along).sum();
        0.5 * (eps / (h * h) * gradient + well(here))
    };
    let outside = nodes.outside().into_iter().zip(u.phase_values());
    let outside: f64 = outside.map(|(k, rest)| 0.5 * k as f64 * well(rest)).sum();
    Ok(nodes.grid().cell_volume() * (parallel::sum(v.len(), density) + outside))
}

/// Area or volume of `{u > 0}`, resolved below the size of a cell.
///
/// Every cell is cut into `D!` simplices along its main diagonal (Kuhn's triangulation), on each
/// of which `atanh u`, which is nearly the distance, is interpolated linearly; the volume of
/// the positive part is then exact. The error is `O(h^2)`, without a contribution of `eps`.
pub fn zero_set_volume<const D: usize>(u: &impl PhaseField<D>) -> f64 {
    let (nodes, v) = (u.nodes(), u.values());
    let (grid, orders) = (nodes.grid(), permutations::<D>());
    let cell = |index: usize| {
        let node = nodes.multi_index(index);
        let corner = |bits: usize| {
            let upper =
                std::array::from_fn(|axis| (node[axis] + (bits >> axis & 1)) % grid.cells());
            u.value(nodes.at(upper))
        };
        let inside = (0..1_usize << D).filter(|&bits| corner(bits) > 0.0).count();
        if inside == 0 || inside == 1 << D {
            return f64::from(inside != 0);
        }
        let simplices = orders.iter().map(|order| {
            // From the first corner to the opposite one, one axis after the other.
            let mut bits = 0;
            let mut vertices = vec![profile_variable(corner(0))];
            for axis in order {
                bits |= 1 << axis;
                vertices.push(profile_variable(corner(bits)));
            }
            positive_fraction(&mut vertices)
        });
        simplices.sum::<f64>() / orders.len() as f64
    };
    grid.cell_volume() * (parallel::sum(v.len(), cell) + positive_outside(u) as f64)
}

/// All orders of the axes.
fn permutations<const D: usize>() -> Vec<[usize; D]> {
    fn extend<const D: usize>(depth: usize, order: &mut [usize; D], all: &mut Vec<[usize; D]>) {
        if depth == D {
            all.push(*order);
            return;
        }
        for i in depth..D {
            order.swap(depth, i);
            extend(depth + 1, order, all);
            order.swap(depth, i);
        }
    }
    let mut all = Vec::new();
    extend(0, &mut std::array::from_fn(|axis| axis), &mut all);
    all
}

/// Fraction of a simplex in which the linear function with these vertex values is positive.
///
/// Splits the simplex at the zero of an edge with values of both signs: in each half that vertex
/// has the value zero, so the recursion ends when one sign is left.
fn positive_fraction(values: &mut [f64]) -> f64 {
    let above = values.iter().position(|&v| v > 0.0);
    let below = values.iter().position(|&v| v < 0.0);
    let (Some(above), Some(below)) = (above, below) else {
        return f64::from(above.is_some());
    };
    let (high, low) = (values[above], values[below]);
    let share = high / (high - low);
    values[below] = 0.0;
    let near_high = positive_fraction(values);
    (values[above], values[below]) = (0.0, low);
    let near_low = positive_fraction(values);
    values[above] = high;
    share * near_high + (1.0 - share) * near_low
}

/// An axis-parallel box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingBox<const D: usize> {
    /// Smallest coordinates.
    pub lower: [f64; D],
    /// Largest coordinates.
    pub upper: [f64; D],
}

impl<const D: usize> BoundingBox<D> {
    /// The smallest box with all points, if there are any.
    pub fn around(points: impl IntoIterator<Item = [f64; D]>) -> Option<Self> {
        let box_of = |point| Self {
            lower: point,
            upper: point,
        };
        points.into_iter().map(box_of).reduce(|a, b| Self {
            lower: std::array::from_fn(|axis| a.lower[axis].min(b.lower[axis])),
            upper: std::array::from_fn(|axis| a.upper[axis].max(b.upper[axis])),
        })
    }

    /// Extent along each axis.
    pub fn extent(&self) -> [f64; D] {
        std::array::from_fn(|axis| self.upper[axis] - self.lower[axis])
    }

    /// The middle.
    pub fn centre(&self) -> [f64; D] {
        std::array::from_fn(|axis| 0.5 * (self.lower[axis] + self.upper[axis]))
    }

    /// Length of the longest side.
    pub fn longest_side(&self) -> f64 {
        self.extent().into_iter().fold(0.0, f64::max)
    }

    /// The box with so much more on both sides along each axis.
    #[must_use]
    pub fn grown(&self, by: [f64; D]) -> Self {
        Self {
            lower: std::array::from_fn(|axis| self.lower[axis] - by[axis]),
            upper: std::array::from_fn(|axis| self.upper[axis] + by[axis]),
        }
    }

    /// Whether the point lies in the box or on its faces.
    pub fn contains(&self, x: [f64; D]) -> bool {
        (0..D).all(|i| (self.lower[i]..=self.upper[i]).contains(&x[i]))
    }
}

/// Bounding box of `{u > 0}`, or `None` if no node is inside.
///
/// The ends come from linear interpolation of `atanh u` along the grid lines, so they are
/// accurate to `O(h^2)` at a smooth interface. The grid is treated as a picture: it does not wrap.
pub fn bounding_box<const D: usize>(u: &impl PhaseField<D>) -> Option<BoundingBox<D>> {
    let (nodes, grid) = (u.nodes(), u.nodes().grid());
    let point = |place: [usize; D], beyond: &dyn Fn(usize) -> f64| {
        std::array::from_fn(|axis| grid.coordinate(axis, place[axis]) + beyond(axis))
    };
    let around_node = |(node, &value): (usize, &f64)| {
        let (place, inside) = (nodes.multi_index(node), profile_variable(value));
        // How far the interface is towards a neighbour outside, if that one is.
        let reach = |axis: usize, step: isize| {
            let end = if step < 0 { 0 } else { grid.cells() - 1 };
            let [beside] = nodes.along(node, place, axis, [step]);
            let outside = profile_variable(u.value(beside));
            if place[axis] == end || outside > 0.0 {
                0.0
            } else {
                grid.spacing() * inside / (inside - outside)
            }
        };
        [
            point(place, &|axis| -reach(axis, -1)),
            point(place, &|axis| reach(axis, 1)),
        ]
    };
    let stored = u.values().iter().enumerate();
    let stored = stored.filter(|(_, value)| **value > 0.0);
    let of_brick = |[first, last]: [[usize; D]; 2]| [first, last].map(|at| point(at, &|_| 0.0));
    let outside = [false, true]
        .into_iter()
        .filter(|&positive| u.value(Lookup::Pure { positive }) > 0.0);
    let outside = outside.filter_map(|phase| nodes.bricks().map(|bricks| bricks.not_active(phase)));
    BoundingBox::around((stored.flat_map(around_node)).chain(outside.flatten().flat_map(of_brick)))
}
