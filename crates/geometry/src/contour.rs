//! Zero level sets of fields: closed curves in 2D, crossings along rays in any dimension.
//!
//! The periodic grid is treated as a picture: curves end where the nodes do, and nothing wraps.

use std::collections::BTreeMap;

use crate::error::{finite, positive};
use crate::profile::profile_variable;
use crate::{Error, Field, vector};

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
    pub fn segments(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + Clone + '_ {
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

/// The zero level set of a phase field by marching squares, with `u > 0` on the left of every curve.
///
/// `atanh u` is taken to be linear along the edges of the grid. For the optimal profile it is proportional to the distance: the error
/// is `O(h^2)` with a constant that does not grow as `eps` shrinks towards `h`.
///
/// Outer boundaries thus run counter-clockwise (first axis to the right, second upwards), holes
/// clockwise. Nodes with `u = 0` count as outside. In a cell with two opposite corners inside, the
/// sign of the mean of the corners decides whether they are joined. Open curves come first,
/// then closed ones, in the order of their first grid edge.
pub fn zero_level(field: &Field<2>) -> Vec<Polyline> {
    let (grid, v) = (field.grid(), field.values());
    zero_level_of(
        grid.shape(),
        |node| profile_variable(v[grid.index(node)]),
        |node, axis, [a, b]| {
            let mut point = [0, 1].map(|axis| grid.coordinate(axis, node[axis]));
            point[axis] += grid.spacing() * a / (a - b);
            point
        },
    )
}

/// As [`zero_level`], for values at the nodes of any lattice, linear along its edges: one that is not square or not evenly spaced,
/// such as the pixels of an image. Of phase fields these are [`profile_variable`]s.
///
/// `value` gives the value at a node, by its index along both axes; the second runs fastest. `crossing` gives the point
/// where the line from `a` at a node to `b` at the next node along `axis` is zero, which is the
/// fraction `a / (a - b)` of the way.
pub fn zero_level_of(
    shape: [usize; 2],
    value: impl Fn([usize; 2]) -> f64,
    crossing: impl Fn([usize; 2], usize, [f64; 2]) -> [f64; 2],
) -> Vec<Polyline> {
    let lattice = Lattice {
        shape,
        value,
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
                let sum: f64 = corners.into_iter().map(&self.value).sum();
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

    /// Where the interface crosses an edge.
    fn point(&self, edge: usize) -> [f64; 2] {
        let (index, axis) = (edge / 2, edge % 2);
        let node = [index / self.shape[1], index % self.shape[1]];
        let mut end = node;
        end[axis] += 1;
        (self.crossing)(node, axis, [node, end].map(&self.value))
    }
}

/// Distance along a ray from `start` at which a phase field first changes sign.
///
/// `direction` may have any length; the distance is in units of length. `atanh u` is sampled at the start and where the ray crosses the
/// planes of the grid that are normal to its largest component, which are nodes if it follows a grid line or a diagonal through nodes
/// (elsewhere the multilinear interpolant), up to the last node. Between the first two samples of unlike sign, the zero is the mean
/// of two extrapolations, each from up to three samples of one side. So an interface with a corner on the ray is found as well as a smooth one,
/// where interpolation across the corner has an error of first order (the idea of Harten's subcell resolution, J. Comput. Phys. 83,
/// 1989). Error `O(h^3)` through nodes, `O(h^2)` elsewhere; what is thinner than the distance of the samples may be missed. `None`
/// if the sign never changes, zero if `u = 0` at the start.
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
    // Distance to the next plane and from plane to plane; planes of the axis along which they are closest.
    let (mut next, mut spacing) = (0.0, f64::INFINITY);
    for axis in 0..D {
        let (low, high) = (grid.origin()[axis], grid.coordinate(axis, grid.cells() - 1));
        if !(low..=high).contains(&start[axis]) {
            return Err(Error::PointOutside {
                point: start.to_vec(),
            });
        }
        let speed = direction[axis].abs() / grid.spacing();
        if speed != 0.0 {
            let ahead = direction[axis] > 0.0;
            let end = if ahead { high } else { low };
            reach = reach.min((end - start[axis]) / direction[axis]);
            if 1.0 / speed < spacing {
                spacing = 1.0 / speed;
                let cells = (start[axis] - low) / grid.spacing();
                let cells = if ahead { cells } else { -cells };
                next = (cells.floor() + 1.0 - cells) * spacing;
            }
        }
    }
    // A plane through the start, but for rounding, would be sampled twice.
    if next < 1e-6 * spacing {
        next += spacing;
    }
    let sample = |s: f64| {
        let x = vector::add(start, vector::scale(direction, s));
        [s, field.interpolate_with(x, profile_variable)]
    };
    let planes = (0..)
        .map(|k| next + spacing * f64::from(k))
        .take_while(|s| *s <= reach * (1.0 + f64::EPSILON));
    let samples: Vec<[f64; 2]> = std::iter::once(0.0).chain(planes).map(sample).collect();
    let changed = samples
        .iter()
        .position(|[_, value]| value * samples[0][1] <= 0.0);
    Ok(changed.map(|k| match k {
        0 => 0.0,
        _ => {
            let before: Vec<_> = samples[..k].iter().rev().copied().collect();
            zero_between(&before, &samples[k..])
        }
    }))
}

/// Samples of `atanh u` beyond this (`|u| = 0.97`) are too far from the interface to extrapolate from.
const FAR: f64 = 2.09;

/// The zero of a function from samples `[s, value]` on both sides, the closest first.
fn zero_between(before: &[[f64; 2]], after: &[[f64; 2]]) -> f64 {
    let ([a, value_a], [b, value_b]) = (before[0], after[0]);
    let interpolated = a + (b - a) * value_a / (value_a - value_b);
    let inside = |s: &f64| (a.min(b)..=a.max(b)).contains(s);
    match [before, after].map(|side| extrapolated_zero(side).filter(inside)) {
        [Some(first), Some(second)] => 0.5 * (first + second),
        _ => interpolated,
    }
}

/// Inverse extrapolation, `s` as a polynomial in the value, from the samples near the interface as far as they go away from it.
fn extrapolated_zero(samples: &[[f64; 2]]) -> Option<f64> {
    let away = |pair: &[[f64; 2]]| pair[1][1].abs() > pair[0][1].abs();
    let near = |pair: &[[f64; 2]]| pair[1][1].abs() < FAR && pair[0][1] * pair[1][1] >= 0.0;
    let usable = (samples.windows(2).take(2))
        .take_while(|pair| away(pair) && near(pair))
        .count();
    let samples = &samples[..=usable];
    let weight = |i: usize| -> f64 {
        let others = (samples.iter().enumerate()).filter(|(j, _)| *j != i);
        others
            .map(|(_, other)| other[1] / (other[1] - samples[i][1]))
            .product()
    };
    (usable > 0).then(|| {
        (samples.iter().enumerate())
            .map(|(i, sample)| weight(i) * sample[0])
            .sum()
    })
}
