//! Closed meshes from triangles that bound nothing properly.

use std::collections::HashMap;
use std::f64::consts::PI;

use derive_more::Display;
use geometry::{Field, Grid, SignedDistance, Stored, optimal_profile};
use rayon::prelude::*;

use crate::hierarchy::{Hierarchy, bounds};
use crate::vector::{Vector, scaled_normal, solid_angle};
use crate::{ClosedMesh, Error, MeshDistance, TriangleMesh, remeshed_surface};

/// Part of the box that the mesh fills, so that what closes its holes has room.
const PART: f64 = 0.8;
/// Width of the interface in cells for the surface that is made.
const EPS_OVER_H: f64 = 2.0;
/// Triangles in the smallest parts of the hierarchy of winding numbers.
const LEAF: usize = 8;
/// Parts that are this many times their radius away are taken for dipoles.
const FAR: f64 = 2.0;

/// A closed mesh, and how it differs from what it was made of.
#[derive(Clone, Debug)]
pub struct Repaired {
    /// The mesh.
    pub mesh: ClosedMesh,
    /// The differences.
    pub changes: RepairChanges,
}

/// How a repaired mesh differs from what it was made of.
#[derive(Clone, Copy, Debug, PartialEq, Display)]
#[display(
    "repaired with cells of {spacing:.3e}: {turned} faces were turned round, {:.2} % of the new surface closes holes, {:.2} % of the old \
     one was inside or too thin and is left out",
    100.0 * added, 100.0 * dropped
)]
pub struct RepairChanges {
    /// The side of the cells on which it was made: smaller details are lost.
    pub spacing: f64,
    /// Faces that were turned round to agree with their neighbours.
    pub turned: usize,
    /// The part of the new area that is further than a cell from the old surface: what closes its holes.
    pub added: f64,
    /// The part of the old area that is further than a cell from the new surface: what is inside, or thinner than a cell.
    pub dropped: f64,
}

/// A closed mesh of any triangles: open, not manifold, crossing themselves, of mixed orientation.
///
/// Neighbours are oriented alike. A point is inside where the generalized winding number of all faces is above one half; where there are
/// holes its level set at one half, which is smooth, closes them. A. Jacobson, L. Kavan, O. Sorkine-Hornung: Robust inside-outside
/// segmentation using generalized winding numbers. ACM Trans. Graph. 32 (2013); far faces are summed as dipoles: G. Barill et al.: Fast
/// winding numbers for soups and clouds. ACM Trans. Graph. 37 (2018). The surface is that of the signed distance on a grid with so
/// many cells a side, of which the mesh fills four fifths; edges and gaps are rounded at the scale of a cell.
///
/// # Errors
/// [`Error::NoFaces`], [`Error::NonFiniteVertex`], [`Error::IndexOutOfRange`]; [`Error::EnclosesNothing`].
pub fn repair(mesh: &TriangleMesh, cells: usize) -> Result<Repaired, Error> {
    mesh.check(1e70)?;
    let mut old = mesh.merged();
    if old.faces.is_empty() {
        return Err(Error::NoFaces);
    }
    let turned = orient(&mut old.faces);
    let triangles: Vec<[Vector; 3]> = old.faces.iter().map(|&f| old.corners(f)).collect();
    let bounds = bounds(&triangles);
    let side = bounds.longest_side() / PART;
    let corner = bounds.centre().map(|x| x - 0.5 * side);
    let grid = Grid::new(cells, side)?.with_origin(corner)?;
    let tree = Windings::new(&triangles);
    let mut winding = sampled(grid, |x| tree.at(x))?;
    if winding.values().iter().sum::<f64>() < 0.0 {
        winding = winding.map(|w| -w);
    }
    let (hierarchy, _) = Hierarchy::new(&triangles);
    let to_old = |x: Vector| {
        (hierarchy.nearest(x, None)).map_or(f64::INFINITY, |n| n.squared_distance.sqrt())
    };
    let unsigned = sampled(grid, to_old)?;
    let eps = EPS_OVER_H * grid.spacing();
    let u = signed(&unsigned, &winding)?.map(|s| optimal_profile(s, eps));
    let new = remeshed_surface(&without_sharp_edges(u), eps)?;
    if new.faces.is_empty() {
        let spacing = grid.spacing();
        return Err(Error::EnclosesNothing { spacing });
    }
    let (new, _) = ClosedMesh::new(new)?;
    let far_part = |points: &TriangleMesh, distance: &(dyn Fn(Vector) -> f64 + Sync)| {
        let (mut far, mut all) = (0.0, 0.0);
        for (x, _, area) in points.sides(usize::MAX) {
            all += area;
            far += area * f64::from(u8::from(distance(Vector::from_array(x)) > grid.spacing()));
        }
        far / f64::max(all, f64::MIN_POSITIVE)
    };
    let to_new = MeshDistance::new(&new);
    let changes = RepairChanges {
        spacing: grid.spacing(),
        turned,
        added: far_part(new.mesh(), &to_old),
        dropped: far_part(&old, &|x| to_new.signed_distance(x.to_array()).abs()),
    };
    Ok(Repaired { mesh: new, changes })
}

fn sampled(grid: Grid<3>, value: impl Fn(Vector) -> f64 + Sync) -> Result<Field<3>, Error> {
    let nodes = (0..grid.len()).into_par_iter();
    let values = nodes.map(|node| value(Vector::from_array(grid.node(node))));
    Ok(Field::from_values(grid, values.collect())?)
}

/// The distance with the sign of the winding number; where that passes one half smoothly, in holes, the distance to this level.
fn signed(unsigned: &Field<3>, winding: &Field<3>) -> Result<Field<3>, Error> {
    let grid = *winding.grid();
    let w = winding.values();
    let nodes = (0..grid.len()).into_par_iter();
    let values = nodes.map(|node| {
        let index = grid.multi_index(node);
        let slope = (0..3).map(|axis| {
            let mut ends = [index; 2];
            ends[0][axis] = index[axis].saturating_sub(1);
            ends[1][axis] = (index[axis] + 1).min(grid.cells() - 1);
            let [a, b] = ends.map(|end| w[grid.index(end)]);
            ((b - a) / (2.0 * grid.spacing())).powi(2)
        });
        let slope = slope.sum::<f64>().sqrt().max(1e-9 / grid.side());
        let depth = w[node] - 0.5;
        let distance = unsigned.values()[node].min(depth.abs() / slope);
        if depth > 0.0 { -distance } else { distance }
    });
    Ok(Field::from_values(grid, values.collect())?)
}

/// Smoothed by `S (2 - S)`, which rounds creases and closes gaps narrower than a cell, and moves smooth surfaces by the fourth order only.
fn without_sharp_edges(u: Field<3>) -> Stored<3> {
    let once = Stored::whole(u).smoothed();
    let twice = once.smoothed();
    once.zip_map(&twice, |once, twice| 2.0 * once - twice)
}

/// Turns faces round so that neighbours across edges of two faces agree, as few as possible of each patch; returns how many.
pub(crate) fn orient(faces: &mut [[u32; 3]]) -> usize {
    let mut edges: HashMap<[u32; 2], Vec<(usize, bool)>> = HashMap::new();
    for (number, face) in faces.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            let sides = edges.entry([a.min(b), a.max(b)]).or_default();
            sides.push((number, a < b));
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    let mut total = 0;
    for start in 0..faces.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let mut patch = vec![start];
        let mut next = 0;
        while let Some(&here) = patch.get(next) {
            next += 1;
            let is_turned = turned[here] == Some(true);
            for i in 0..3 {
                let (a, b) = (faces[here][i], faces[here][(i + 1) % 3]);
                let [(one, up), (two, also_up)] = edges[&[a.min(b), a.max(b)]][..] else {
                    continue;
                };
                let there = if one == here { two } else { one };
                if turned[there].is_none() {
                    turned[there] = Some(is_turned != (up == also_up));
                    patch.push(there);
                }
            }
        }
        let (some, others): (Vec<usize>, Vec<usize>) =
            (patch.into_iter()).partition(|&face| turned[face] == Some(true));
        let fewer = if some.len() <= others.len() {
            some
        } else {
            others
        };
        total += fewer.len();
        for face in fewer {
            faces[face].swap(1, 2);
        }
    }
    total
}

/// Generalized winding numbers of triangles.
struct Windings {
    /// In the order of the parts.
    triangles: Vec<[Vector; 3]>,
    parts: Vec<Part>,
}

/// Neighbouring triangles.
struct Part {
    centre: Vector,
    radius: f64,
    /// The sum of their normals times their areas.
    dipole: Vector,
    triangles: std::ops::Range<usize>,
    /// Two parts of it, unless it is small.
    halves: Option<[usize; 2]>,
}

impl Windings {
    fn new(triangles: &[[Vector; 3]]) -> Self {
        let mut windings = Self {
            triangles: triangles.to_vec(),
            parts: Vec::new(),
        };
        windings.divide(0..triangles.len());
        windings
    }

    fn divide(&mut self, range: std::ops::Range<usize>) -> usize {
        let triangles = &mut self.triangles[range.clone()];
        let middle = |t: &[Vector; 3]| (t[0] + t[1] + t[2]) / 3.0;
        let bounds = bounds(triangles.iter());
        let centre = Vector::from_array(bounds.centre());
        let corners = triangles.iter().flatten();
        let radius = corners.map(|x| x.distance(centre)).fold(0.0, f64::max);
        let dipole = triangles.iter().map(|&t| 0.5 * scaled_normal(t)).sum();
        let number = self.parts.len();
        let axis = Vector::from_array(bounds.extent()).max_position();
        triangles.sort_by(|a, b| middle(a)[axis].total_cmp(&middle(b)[axis]));
        self.parts.push(Part {
            centre,
            radius,
            dipole,
            triangles: range.clone(),
            halves: None,
        });
        if range.len() > LEAF {
            let half = range.start + range.len() / 2;
            let halves = [range.start..half, half..range.end].map(|half| self.divide(half));
            self.parts[number].halves = Some(halves);
        }
        number
    }

    fn at(&self, x: Vector) -> f64 {
        let (mut sum, mut left) = (0.0, vec![0]);
        while let Some(number) = left.pop() {
            let part = &self.parts[number];
            let offset = part.centre - x;
            let distance = offset.length();
            if distance > FAR * part.radius {
                sum += part.dipole.dot(offset) / distance.powi(3);
            } else if let Some(halves) = part.halves {
                left.extend(halves);
            } else {
                let triangles = self.triangles[part.triangles.clone()].iter();
                sum += triangles
                    .map(|t| solid_angle(t.map(|y| y - x)))
                    .sum::<f64>();
            }
        }
        sum / (4.0 * PI)
    }
}
