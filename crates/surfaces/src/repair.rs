//! Closed meshes from triangles that bound nothing properly.

use std::collections::{BTreeMap, HashMap};
use std::f64::consts::PI;
use std::fmt;

use geometry::{Field, Grid, SignedDistance, Stored, optimal_profile};
use rayon::prelude::*;

use crate::closed::{Seams, drop_unreferenced};
use crate::crossings::touching;
use crate::half_edges::HalfEdges;
use crate::hierarchy::{Hierarchy, bounds};
use crate::joined::Joined;
use crate::mending::{Backs, flipped, without_doubles};
use crate::nesting::enclosing;
use crate::vector::{Vector, scaled_normal, solid_angle};
use crate::{ClosedMesh, Error, MeshDistance, TriangleMesh, remeshed_surface};

/// Part of the box that the mesh fills, so that what closes its holes has room.
const PART: f64 = 0.8;
/// Width of the interface in cells for the surface that is made.
const EPS_OVER_H: f64 = 2.0;
/// Fewest cells of a part that is made anew.
const FEWEST_CELLS: usize = 48;
/// The vector area of a patch that is nearly closed, as a part of its area. A half of a sphere has a half.
const NEARLY_CLOSED: f64 = 0.1;
/// Less volume than this part of area times length is nothing.
const ENCLOSES: f64 = 1e-6;
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepairChanges {
    /// The side of the cells on which parts are made anew: smaller details of them are lost.
    pub spacing: f64,
    /// Faces that were turned round to agree with their neighbours.
    pub turned: usize,
    /// Holes that were closed by smooth lids, beside which all stays.
    pub holes: usize,
    /// Parts that were made anew, since they cross themselves or are no surface, and what they were.
    pub anew: usize,
    /// Bodies that cross or touch each other and became one.
    pub united: usize,
    /// Parts that are inside of others, or enclose nothing, and were left out.
    pub left_out: usize,
    /// The part of the new area that is further than a cell from the old surface: what closes its holes.
    pub added: f64,
    /// The part of the old area that is further than a cell from the new surface: what is inside, or thinner than a cell.
    pub dropped: f64,
}

impl fmt::Display for RepairChanges {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "repaired: {} faces were turned round", self.turned)?;
        if self.holes > 0 {
            write!(f, ", {} holes were closed by smooth lids", self.holes)?;
        }
        if self.anew > 0 {
            let spacing = self.spacing;
            write!(
                f,
                ", {} parts were made anew with cells of {spacing:.3e}",
                self.anew
            )?;
        }
        if self.united > 0 {
            write!(
                f,
                ", {} bodies that cross or touch each other were united",
                self.united
            )?;
        }
        if self.left_out > 0 {
            write!(
                f,
                ", {} parts inside of others, or that enclose nothing, were left out",
                self.left_out
            )?;
        }
        let [added, dropped] = [self.added, self.dropped].map(|part| 100.0 * part);
        write!(
            f,
            ", {added:.2} % of the new surface closes holes, {dropped:.2} % of the old one was inside or too thin and is left out"
        )
    }
}

/// A closed mesh of any triangles: open, not manifold, crossing themselves, of mixed orientation.
///
/// Neighbours are oriented alike. Bodies that are apart in the mesh stay apart: those that do not cross or touch each other. Of each, if it is a
/// surface that does not cross itself, all stays as it is, and [lids](TriangleMesh::with_lids) close its holes.
///
/// Others are made anew, with the loose triangles within a cell of them. A point is inside where the generalized winding number of their faces is
/// above one half; where there are
/// holes its level set at one half closes them. A. Jacobson, L. Kavan, O. Sorkine-Hornung: Robust inside-outside
/// segmentation using generalized winding numbers. ACM Trans. Graph. 32 (2013); far faces are summed as dipoles: G. Barill et al.: Fast
/// winding numbers for soups and clouds. ACM Trans. Graph. 37 (2018). The surface is that of the signed distance on a grid with so
/// many cells a side, of which the mesh fills four fifths; edges and gaps are rounded at the scale of a cell.
///
/// # Errors
/// [`Error::NoFaces`], [`Error::NonFiniteVertex`], [`Error::IndexOutOfRange`]; [`Error::EnclosesNothing`].
pub fn repair(mesh: &TriangleMesh, cells: usize) -> Result<Repaired, Error> {
    mesh.check(1e70)?;
    let mut old = mesh.merged();
    old.normals = None;
    let sheets = old.clone();
    without_doubles(&mut old, Backs::Enclose);
    if old.faces.is_empty() {
        // Each face has its back: sheets with two sides.
        old = sheets;
        without_doubles(&mut old, Backs::Repeat);
    }
    if old.faces.is_empty() {
        return Err(Error::NoFaces);
    }
    drop_unreferenced(&mut old);
    let turned = orient(&mut old.faces);
    let side = old.bounding_box().ok_or(Error::NoFaces)?.longest_side() / PART;
    let spacing = side / cells as f64;
    let mut changes = RepairChanges {
        spacing,
        turned,
        holes: 0,
        anew: 0,
        united: 0,
        left_out: 0,
        added: 0.0,
        dropped: 0.0,
    };
    let mut new = TriangleMesh::default();
    for group in groups(&old, spacing) {
        let part = only(&old, &group.faces);
        if let Some((whole, holes)) = whole(&part) {
            changes.holes += holes;
            new.append(&whole);
        } else if let Some((made, components)) = made_anew(&part, spacing, cells)? {
            changes.anew += 1;
            changes.united += group.bodies.saturating_sub(components);
            new.append(&made);
        } else {
            changes.left_out += 1;
        }
    }
    if new.faces.is_empty() {
        return Err(Error::EnclosesNothing { spacing });
    }
    changes.left_out += without_inner_bodies(&mut new)?;
    let (new, _) = ClosedMesh::new(new)?;
    let to_new = MeshDistance::new(&new);
    let triangles: Vec<[Vector; 3]> = old.faces.iter().map(|&f| old.corners(f)).collect();
    let (hierarchy, _) = Hierarchy::new(&triangles);
    let far_part = |points: &TriangleMesh, distance: &(dyn Fn(Vector) -> f64 + Sync)| {
        let (mut far, mut all) = (0.0, 0.0);
        for (x, _, area) in points.sides(usize::MAX) {
            all += area;
            far += area * f64::from(u8::from(distance(Vector::from_array(x)) > spacing));
        }
        far / f64::max(all, f64::MIN_POSITIVE)
    };
    changes.added = far_part(new.mesh(), &|x| to_triangles(&hierarchy, x));
    changes.dropped = far_part(&old, &|x| to_new.signed_distance(x.to_array()).abs());
    Ok(Repaired { mesh: new, changes })
}

fn to_triangles(hierarchy: &Hierarchy, x: Vector) -> f64 {
    (hierarchy.nearest(x, None)).map_or(f64::INFINITY, |n| n.squared_distance.sqrt())
}

/// The mesh of some faces, without normals.
fn only(mesh: &TriangleMesh, faces: &[usize]) -> TriangleMesh {
    // Not by a copy of all vertices, since there may be many such meshes.
    let faces = faces.iter().map(|&face| mesh.faces[face]);
    let mut kept: Vec<u32> = faces.clone().flatten().collect();
    kept.sort_unstable();
    kept.dedup();
    let number = |vertex: u32| kept.partition_point(|&other| other < vertex) as u32;
    TriangleMesh {
        vertices: kept.iter().map(|&v| mesh.vertices[v as usize]).collect(),
        faces: faces.map(|face| face.map(number)).collect(),
        normals: None,
    }
}

/// The part with its holes closed, and how many there were, if it is a surface that does not cross itself then.
fn whole(part: &TriangleMesh) -> Option<(TriangleMesh, usize)> {
    let (mut mesh, holes) = match HalfEdges::new(part) {
        Ok(_) => (part.clone(), 0),
        Err(Error::Open { .. }) => {
            let lids = part.with_lids().ok()?;
            (lids.mesh, lids.holes)
        }
        Err(_) => return None,
    };
    flipped(&mut mesh, ..)?;
    let area: f64 = mesh.sides(usize::MAX).map(|(_, _, area)| area).sum();
    let side = mesh.bounding_box()?.longest_side();
    let encloses = mesh.volume().abs() > ENCLOSES * area * side;
    let is_whole =
        encloses && HalfEdges::new(&mesh).is_ok() && !mesh.crossing_faces().contains(&true);
    is_whole.then_some((mesh, holes))
}

/// The surface about a part on a grid of its own, and the number of its components, if there is one. Cells are as large as given, and smaller where
/// the part has few of them.
fn made_anew(
    part: &TriangleMesh,
    spacing: f64,
    cells: usize,
) -> Result<Option<(TriangleMesh, usize)>, Error> {
    let triangles: Vec<[Vector; 3]> = part.faces.iter().map(|&f| part.corners(f)).collect();
    let bounds = bounds(&triangles);
    let side = bounds.longest_side() / PART;
    let fewest = FEWEST_CELLS.min(cells) as f64;
    let cells = (side / spacing).round().clamp(fewest, cells as f64) as usize;
    let corner = bounds.centre().map(|x| x - 0.5 * side);
    if side == 0.0 {
        return Ok(None);
    }
    let grid = Grid::new(cells, side)?.with_origin(corner)?;
    let tree = Windings::new(&triangles);
    let mut winding = sampled(grid, |x| tree.at(x))?;
    let is_inwards = winding.values().iter().sum::<f64>() < 0.0;
    if is_inwards {
        winding = winding.map(|w| -w);
    }
    let (hierarchy, _) = Hierarchy::new(&triangles);
    let unsigned = sampled(grid, |x| to_triangles(&hierarchy, x))?;
    let eps = EPS_OVER_H * grid.spacing();
    let u = signed(&unsigned, &winding)?.map(|s| optimal_profile(s, eps));
    let mut new = remeshed_surface(&without_sharp_edges(u), eps)?;
    if new.faces.is_empty() {
        return Ok(None);
    }
    new.normals = None;
    let components = Seams::find(&new)?.components;
    if is_inwards {
        new.faces.iter_mut().for_each(|face| face.swap(1, 2));
    }
    Ok(Some((new, components)))
}

/// What becomes of a part.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fate {
    /// It is oriented outwards.
    Body,
    /// It is oriented inwards.
    Cavity,
    /// It is left out, as it is in a body already.
    Inner,
}

/// Leaves out bodies that are inside of others, and says how many; what is inside out is turned.
fn without_inner_bodies(mesh: &mut TriangleMesh) -> Result<usize, Error> {
    let seams = Seams::find(mesh)?;
    let parts = seams.parts(mesh);
    if parts.len() < 2 {
        return Ok(0);
    }
    let enclosing = enclosing(mesh, &parts);
    let is_inwards: Vec<bool> = (parts.iter())
        .map(|faces| mesh.volume_behind(faces) < 0.0)
        .collect();
    let all_inwards = (is_inwards.iter().zip(&enclosing))
        .all(|(inwards, around)| *inwards == (around.len() % 2 == 0));
    // All of what is inside out is meant the other way round.
    let meant: Vec<bool> = is_inwards.iter().map(|&is| is != all_inwards).collect();
    let fates = fates(&meant, &enclosing);
    mesh.faces.clear();
    for ((mut faces, inwards), fate) in parts.into_iter().zip(is_inwards).zip(&fates) {
        if inwards != (*fate == Fate::Cavity) {
            for face in &mut faces {
                face.swap(1, 2);
            }
        }
        if *fate != Fate::Inner {
            mesh.faces.extend(faces);
        }
    }
    drop_unreferenced(mesh);
    Ok(fates.iter().filter(|fate| **fate == Fate::Inner).count())
}

/// What becomes of parts that are meant to be inwards or not, with these others around them. From the outside to the inside: what is left out
/// encloses nothing.
fn fates(is_inwards: &[bool], enclosing: &[Vec<usize>]) -> Vec<Fate> {
    let mut from_outside: Vec<usize> = (0..enclosing.len()).collect();
    from_outside.sort_by_key(|&part| enclosing[part].len());
    let mut fates = vec![Fate::Inner; enclosing.len()];
    for part in from_outside {
        let layers = enclosing[part].iter().map(|&other| match fates[other] {
            Fate::Body => 1,
            Fate::Cavity => -1,
            Fate::Inner => 0,
        });
        let is_in_body = layers.sum::<i32>() > 0;
        fates[part] = match (is_in_body, is_inwards[part]) {
            (false, _) => Fate::Body,
            (true, true) => Fate::Cavity,
            (true, false) => Fate::Inner,
        };
    }
    fates
}

/// Faces that are repaired together.
#[derive(Default)]
struct Group {
    faces: Vec<usize>,
    /// Patches among them that are nearly closed.
    bodies: usize,
}

/// The faces of bodies that are apart: patches over common edges, joined where they cross or touch. Patches that are no bodies, as loose triangles,
/// belong to the body within a cell of them, and otherwise together.
fn groups(mesh: &TriangleMesh, spacing: f64) -> Vec<Group> {
    let patch = patches(mesh);
    let count = patch.iter().max().map_or(0, |last| last + 1);
    let (mut areas, mut sums) = (vec![0.0; count], vec![Vector::ZERO; count]);
    for (&face, &patch) in mesh.faces.iter().zip(&patch) {
        let normal = scaled_normal(mesh.corners(face));
        areas[patch] += normal.length();
        sums[patch] += normal;
    }
    let is_body = |patch: usize| sums[patch].length() <= NEARLY_CLOSED * areas[patch];
    let mut joined = Joined::new(count);
    for [one, other] in touching(mesh, &patch) {
        joined.join(one, other);
    }
    let bodies: Vec<usize> = (0..mesh.faces.len())
        .filter(|&face| is_body(patch[face]))
        .collect();
    let triangles: Vec<_> = bodies
        .iter()
        .map(|&face| mesh.corners(mesh.faces[face]))
        .collect();
    let hierarchy = (!triangles.is_empty()).then(|| Hierarchy::new(&triangles));
    let mut is_near = vec![false; count];
    for (&face, &patch_of) in mesh.faces.iter().zip(&patch) {
        let Some((hierarchy, order)) = hierarchy.as_ref().filter(|_| !is_body(patch_of)) else {
            continue;
        };
        let nearest = hierarchy.nearest(mesh.corners(face)[0], None);
        let near = nearest.filter(|near| near.squared_distance <= spacing * spacing);
        if let Some(near) = near {
            joined.join(patch_of, patch[bodies[order[near.triangle]]]);
            is_near[patch_of] = true;
        }
    }
    let loose: Vec<usize> = (0..count).filter(|&p| !is_body(p) && !is_near[p]).collect();
    for pair in loose.windows(2) {
        joined.join(pair[0], pair[1]);
    }
    let mut groups: BTreeMap<usize, Group> = BTreeMap::new();
    for (face, &patch) in patch.iter().enumerate() {
        groups
            .entry(joined.root(patch))
            .or_default()
            .faces
            .push(face);
    }
    for patch in (0..count).filter(|&patch| is_body(patch)) {
        groups.entry(joined.root(patch)).or_default().bodies += 1;
    }
    groups.into_values().collect()
}

/// The number of the patch of every face: faces with a common edge are in one.
fn patches(mesh: &TriangleMesh) -> Vec<usize> {
    let mut joined = Joined::new(mesh.faces.len());
    let mut known: HashMap<[u32; 2], usize> = HashMap::with_capacity(2 * mesh.faces.len());
    for (number, face) in mesh.faces.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            let first = *known.entry([a.min(b), a.max(b)]).or_insert(number);
            joined.join(first, number);
        }
    }
    let mut numbers = HashMap::new();
    let number = |face: usize| {
        let next = numbers.len();
        *numbers.entry(joined.root(face)).or_insert(next)
    };
    (0..mesh.faces.len()).map(number).collect()
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
