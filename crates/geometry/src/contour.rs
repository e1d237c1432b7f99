//! Zero level sets of fields: closed curves in 2D, crossings along rays in any dimension.
//!
//! The periodic grid is treated as a picture: curves end where the nodes do, and nothing wraps.

use std::collections::BTreeMap;

use crate::error::{finite, positive};
use crate::profile::profile_variable;
use crate::{Error, Field, vector};

/// Which quantity is taken to be linear along the edges of the grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// `atanh u`, proportional to the distance for the optimal profile: `O(h^2)` with a
    /// constant that does not grow as `eps` shrinks towards `h`. For phase fields.
    #[default]
    Profile,
    /// `u` itself. For other fields.
    Value,
}

impl Interpolation {
    fn apply(self, u: f64) -> f64 {
        match self {
            Self::Profile => profile_variable(u),
            Self::Value => u,
        }
    }
}

/// A curve through the given points.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyline {
    /// The points in order; the first is not repeated at the end of a closed curve.
    pub points: Vec<[f64; 2]>,
    /// Whether the last point is joined to the first; an open curve ends at the border.
    pub closed: bool,
}

impl Polyline {
    /// The segments, including the closing one.
    pub fn segments(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let closing = if self.closed {
            self.points.first()
        } else {
            None
        };
        let ends = self.points.iter().skip(1).chain(closing);
        self.points.iter().copied().zip(ends.copied())
    }

    /// Length of the curve.
    pub fn length(&self) -> f64 {
        self.segments()
            .map(|(a, b)| vector::norm(vector::sub(b, a)))
            .sum()
    }

    /// Area to the left of a closed curve: positive around an inside, negative around a hole.
    pub fn signed_area(&self) -> f64 {
        self.segments()
            .map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0]))
            .sum()
    }
}

/// The zero level set by marching squares, with `u > 0` on the left of every curve.
///
/// Outer boundaries thus run counter-clockwise (first axis to the right, second upwards), holes
/// clockwise. Nodes with `u = 0` count as outside. In a cell with two opposite corners inside, the
/// sign of the mean of the corners decides whether they are joined. Open curves come first,
/// then closed ones, in the order of their first grid edge.
pub fn zero_level(field: &Field<2>, interpolation: Interpolation) -> Vec<Polyline> {
    let (grid, v) = (field.grid(), field.values());
    zero_level_of(
        grid.shape(),
        |node| v[grid.index(node)],
        interpolation,
        |node, axis, [a, b]| {
            let mut point = [0, 1].map(|axis| grid.coordinate(axis, node[axis]));
            point[axis] += grid.spacing() * a / (a - b);
            point
        },
    )
}

/// As [`zero_level`], for values at the nodes of any lattice that is not stored as a [`Field`]:
/// one that is not square or not evenly spaced, such as the pixels of an image.
///
/// `value` gives the value at a node, by its index along both axes; the second runs fastest. `crossing` gives the point
/// where the line from `a` at a node to `b` at the next node along `axis` is zero, which is the
/// fraction `a / (a - b)` of the way; `a` and `b` are the values or, by the interpolation, their
/// `atanh`.
pub fn zero_level_of(
    shape: [usize; 2],
    value: impl Fn([usize; 2]) -> f64,
    interpolation: Interpolation,
    crossing: impl Fn([usize; 2], usize, [f64; 2]) -> [f64; 2],
) -> Vec<Polyline> {
    let lattice = Lattice {
        shape,
        value,
        interpolation,
        crossing,
    };
    let next = lattice.segments();
    let mut open: BTreeMap<usize, usize> = next.clone();
    for end in next.values() {
        open.remove(end);
    }
    let mut rest = next;
    let mut curves = Vec::new();
    for &start in open.keys() {
        curves.push(lattice.trace(&mut rest, start));
    }
    while let Some((&start, _)) = rest.first_key_value() {
        curves.push(lattice.trace(&mut rest, start));
    }
    curves.retain(|curve| curve.points.len() > 1);
    curves
}

/// Nodes in rows and columns. Edge `2 i + axis` goes from the `i`-th node, row-major, along `axis`.
struct Lattice<V, C> {
    shape: [usize; 2],
    value: V,
    interpolation: Interpolation,
    crossing: C,
}

impl<V, C> Lattice<V, C>
where
    V: Fn([usize; 2]) -> f64,
    C: Fn([usize; 2], usize, [f64; 2]) -> [f64; 2],
{
    /// Follows a curve from the crossed edge `start`, removing its segments.
    fn trace(&self, next: &mut BTreeMap<usize, usize>, start: usize) -> Polyline {
        let mut points = vec![self.point(start)];
        let mut edge = start;
        let mut closed = false;
        while let Some(following) = next.remove(&edge) {
            closed = following == start;
            if !closed {
                points.push(self.point(following));
            }
            edge = following;
        }
        // Neighbouring edges that are crossed at a common node give the same point.
        points.dedup();
        if closed && points.len() > 1 && points.first() == points.last() {
            points.pop();
        }
        Polyline { points, closed }
    }

    /// The directed segments, from crossed edge to crossed edge.
    fn segments(&self) -> BTreeMap<usize, usize> {
        let [rows, columns] = self.shape;
        let mut next = BTreeMap::new();
        // Every value is asked for once, unless the curve is near.
        let row = |i: usize| -> Vec<bool> {
            let values = (0..columns).map(|j| (self.value)([i, j]) > 0.0);
            values.collect()
        };
        let mut above = if rows > 0 { row(0) } else { Vec::new() };
        for i in 0..rows.saturating_sub(1) {
            let below = std::mem::replace(&mut above, row(i + 1));
            for j in 0..columns.saturating_sub(1) {
                let inside = [below[j], above[j], above[j + 1], below[j + 1]];
                if inside == [inside[0]; 4] {
                    continue;
                }
                // Corners and the edges that follow them, counter-clockwise.
                let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
                let edges = [
                    self.edge(corners[0], 0),
                    self.edge(corners[1], 1),
                    self.edge(corners[3], 0),
                    self.edge(corners[0], 1),
                ];
                let sum: f64 = corners.into_iter().map(|c| self.interpolated(c)).sum();
                for k in (0..4).filter(|&k| inside[k] && !inside[(k + 1) % 4]) {
                    // The border leaves the inside at edge k. Joined insides: the curve cuts off
                    // the outer corner ahead and ends where the border enters again; else it goes
                    // back to where the border entered.
                    let enters = |&l: &usize| !inside[l % 4] && inside[(l + 1) % 4];
                    let mut ahead = k + 1..k + 4;
                    let entry = if sum > 0.0 {
                        ahead.find(enters)
                    } else {
                        ahead.rev().find(enters)
                    };
                    let entry = entry.expect("a border that leaves the inside enters it again");
                    next.insert(edges[k], edges[entry % 4]);
                }
            }
        }
        next
    }

    fn edge(&self, [i, j]: [usize; 2], axis: usize) -> usize {
        2 * (i * self.shape[1] + j) + axis
    }

    fn interpolated(&self, node: [usize; 2]) -> f64 {
        self.interpolation.apply((self.value)(node))
    }

    /// Where the interface crosses an edge.
    fn point(&self, edge: usize) -> [f64; 2] {
        let (index, axis) = (edge / 2, edge % 2);
        let node = [index / self.shape[1], index % self.shape[1]];
        let mut end = node;
        end[axis] += 1;
        (self.crossing)(node, axis, [node, end].map(|n| self.interpolated(n)))
    }
}

/// Distance along a ray from `start` at which a phase field first changes sign.
///
/// `direction` may have any length; the distance is in units of length. The multilinear
/// interpolant of `atanh u` is followed in steps of `h/2` up to the last node, and the first
/// change of sign is refined by bisection to rounding error; along a grid line this is
/// linear interpolation between the two nodes. Error `O(h^2)`; what is thinner than `h/2` along the
/// ray may be missed. `None` if the sign never changes, zero if `u = 0` at the start.
///
/// # Errors
/// The start must lie in the box spanned by the nodes, the direction be finite and not zero.
pub fn ray_crossing<const D: usize>(
    field: &Field<D>,
    start: [f64; D],
    direction: [f64; D],
) -> Result<Option<f64>, Error> {
    let grid = field.grid();
    let length = positive("length of the direction", vector::norm(direction))?;
    let direction = vector::scale(direction, 1.0 / length);
    finite("start", start)?;
    let mut reach = f64::INFINITY;
    for axis in 0..D {
        let (low, high) = (grid.origin()[axis], grid.coordinate(axis, grid.cells() - 1));
        if !(low..=high).contains(&start[axis]) {
            return Err(Error::PointOutside {
                point: start.to_vec(),
            });
        }
        if direction[axis] != 0.0 {
            let end = if direction[axis] > 0.0 { high } else { low };
            reach = reach.min((end - start[axis]) / direction[axis]);
        }
    }
    let at = |s: f64| {
        let x = vector::add(start, vector::scale(direction, s));
        field.interpolate_with(x, profile_variable)
    };
    let first = at(0.0);
    if first == 0.0 {
        return Ok(Some(0.0));
    }
    let changed = |s: f64| at(s) * first <= 0.0;
    let steps = (reach / (0.5 * grid.spacing())).ceil() as usize;
    let position = |k: usize| reach * (k as f64 / steps as f64);
    let Some(k) = (1..=steps).find(|&k| changed(position(k))) else {
        return Ok(None);
    };
    let (mut low, mut high) = (position(k - 1), position(k));
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Ok(Some(high));
        }
        if changed(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
}
