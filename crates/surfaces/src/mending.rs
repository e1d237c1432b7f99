//! Meshes whose faults are trifles, mended so that they bound a solid.

use std::collections::{HashMap, HashSet};
use std::ops::RangeBounds;

use crate::closed::{Seams, drop_unreferenced, is_flat};
use crate::crossings::touching;
use crate::half_edges::HalfEdges;
use crate::joined::Joined;
use crate::mesh::{has_three_corners, key};
use crate::nesting::enclosing;
use crate::repair::orient;
use crate::vector::{Vector, scaled_normal};
use crate::{ClosedMesh, Error, Overlap, TriangleMesh, Warning};

/// Points that are so near to each other, in longest sides of the mesh, may be one: the first of these with which the surface is closed.
const NEAR: [f64; 4] = [1e-8, 1e-7, 1e-6, 1e-5];
/// Rounds in which faces without area give their longest sides to their neighbours.
const ROUNDS: usize = 20;

/// A mesh that bounds a solid, of one with trifling faults.
#[derive(Clone, Debug)]
pub struct Mended {
    /// The mesh.
    pub mesh: ClosedMesh,
    /// What was changed.
    pub changes: Vec<Warning>,
    /// For every vertex that was given, where the mesh has it: at the place of another one, where the two are one up to rounding.
    pub places: Vec<[f64; 3]>,
}

impl ClosedMesh {
    /// As [`ClosedMesh::new`], and mends more, still without moving a vertex by more than rounding. In this order, where the surface is not closed
    /// without it:
    ///
    /// - Vertices that agree up to rounding are one, as those of seams and of facets that were written one by one.
    /// - Of faces that are there twice, one is left out. Two that are each other's back enclose nothing, and both are.
    /// - Neighbours are oriented alike.
    /// - A face whose corners are on a line gives its longest side to the neighbour there.
    /// - Parts are oriented by how many others they lie in: inwards in one, and so on. A part within another one that is oriented outwards is a body
    ///   of its own. A surface does not tell it from a cavity, and for distances and flows it is one.
    ///
    /// # Errors
    /// As [`ClosedMesh::new`], for what is wrong with the mesh as it was given; [`Error::Overlap`] for parts that are not one in the other, but reach
    /// into each other.
    pub fn mended(mesh: TriangleMesh) -> Result<Mended, Error> {
        let given = match Self::new(mesh.clone()) {
            Ok((closed, changes)) => {
                return Ok(Mended {
                    mesh: closed,
                    changes,
                    places: mesh.vertices,
                });
            }
            Err(error) => error,
        };
        if !matches!(
            given,
            Error::Open { .. }
                | Error::NonManifold { .. }
                | Error::MixedOrientation { .. }
                | Error::NoArea { .. }
                | Error::NoVolume { .. }
                | Error::Nesting { .. }
        ) {
            return Err(given);
        }
        // Those steps that did not help are no reason for another message.
        let Some(mending) = Mending::of(mesh).sheets() else {
            return Err(given);
        };
        if let Some(overlap) = mending.overlap() {
            return Err(Error::Overlap(overlap));
        }
        mending.closed().ok_or(given)
    }
}

pub(crate) struct Mending {
    pub(crate) mesh: TriangleMesh,
    pub(crate) changes: Vec<Warning>,
    pub(crate) places: Vec<[f64; 3]>,
}

impl Mending {
    pub(crate) fn of(mesh: TriangleMesh) -> Self {
        Self {
            places: mesh.vertices.clone(),
            mesh,
            changes: Vec::new(),
        }
    }

    /// Makes vertices at exactly the same place one.
    pub(crate) fn merge(&mut self) {
        let exact = self.mesh.merged();
        let merged = self.mesh.vertices.len() - exact.vertices.len();
        let collapsed = self.mesh.faces.len() - exact.faces.len();
        self.note(merged, Warning::Merged);
        self.note(collapsed, Warning::Collapsed);
        self.mesh = exact;
    }

    /// With every edge between two faces, which agree.
    fn sheets(mut self) -> Option<Self> {
        self.merge();
        self = self.joined()?;
        let flat = flipped(&mut self.mesh, ..)?;
        self.note(flat, Warning::Flat);
        Some(self)
    }

    /// Parts that overlap, if there are several parts.
    fn overlap(&self) -> Option<Overlap> {
        let seams = Seams::find(&self.mesh).ok()?;
        (seams.components > 1).then(|| Overlap::of(&self.mesh, &seams))?
    }

    /// With all parts oriented.
    fn closed(mut self) -> Option<Mended> {
        self.orient_parts();
        let (mesh, more) = ClosedMesh::new(self.mesh).ok()?;
        self.changes.extend(more);
        Some(Mended {
            mesh,
            changes: self.changes,
            places: self.places,
        })
    }

    /// The solid that the faces bound: of parts that overlap, their union.
    pub(crate) fn bounded(&mut self) -> Result<ClosedMesh, Error> {
        let seams = Seams::find(&self.mesh)?;
        let part: Vec<usize> = seams.component.iter().map(|&part| part as usize).collect();
        let pairs = touching(&self.mesh, &part);
        if pairs.is_empty() {
            let mut oriented = Self::of(self.mesh.clone());
            oriented.orient_parts();
            match ClosedMesh::new(oriented.mesh) {
                Ok((mesh, more)) => {
                    self.changes.extend(oriented.changes);
                    self.changes.extend(more);
                    return Ok(mesh);
                }
                // A part that crosses itself is around no other one.
                Err(Error::Nesting { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        let overlapping: HashSet<usize> = pairs.iter().flatten().copied().collect();
        self.note(overlapping.len(), Warning::United);
        let bodies = apart(seams.components, &pairs);
        let bodies: Vec<u32> = part.into_iter().map(|part| bodies[part]).collect();
        let count = bodies.iter().max().map_or(0, |last| last + 1);
        let (mut within, mut inside_out) = (0, 0);
        for body in 0..count {
            for change in self.orient_body(&bodies, body) {
                match change {
                    Warning::Bodies(parts) => within += parts,
                    Warning::InsideOut(parts) => inside_out += parts,
                    _ => {}
                }
            }
        }
        self.note(within, Warning::Bodies);
        self.note(inside_out, Warning::InsideOut);
        let unreferenced = drop_unreferenced(&mut self.mesh);
        self.note(unreferenced, Warning::Unreferenced);
        ClosedMesh::union(self.mesh.clone(), bodies)
    }

    /// Orients the parts of one body, all of it outwards, and says what was turned for that.
    fn orient_body(&mut self, bodies: &[u32], body: u32) -> Vec<Warning> {
        let faces: Vec<usize> = (0..bodies.len()).filter(|f| bodies[*f] == body).collect();
        let mut alone = Self::of(TriangleMesh {
            faces: faces.iter().map(|&face| self.mesh.faces[face]).collect(),
            ..self.mesh.clone()
        });
        alone.orient_parts();
        let is_inside_out = alone.mesh.volume() < 0.0;
        for (face, mut turned) in faces.into_iter().zip(alone.mesh.faces) {
            if is_inside_out {
                turned.swap(1, 2);
            }
            self.mesh.faces[face] = turned;
        }
        alone.changes
    }

    pub(crate) fn note(&mut self, count: usize, warning: fn(usize) -> Warning) {
        self.changes.extend((count > 0).then(|| warning(count)));
    }

    /// With the fewest vertices joined that make it closed.
    fn joined(self) -> Option<Self> {
        let side = self.mesh.bounding_box()?.longest_side();
        let all = std::iter::once(0.0).chain(NEAR);
        all.into_iter()
            .find_map(|near| self.joined_within(near * side))
    }

    /// With vertices joined that are so near to each other, if it is closed then.
    fn joined_within(&self, near: f64) -> Option<Self> {
        let mut mended = Self {
            mesh: self.mesh.clone(),
            changes: self.changes.clone(),
            places: self.places.clone(),
        };
        if near > 0.0 {
            mended.join(near);
        }
        let doubled = without_doubles(&mut mended.mesh, Backs::Enclose);
        mended.note(doubled, Warning::Doubled);
        if let Err(Error::MixedOrientation { .. }) = HalfEdges::new(&mended.mesh) {
            let turned = orient(&mut mended.mesh.faces);
            mended.note(turned, Warning::Turned);
        }
        HalfEdges::new(&mended.mesh).is_ok().then_some(mended)
    }

    /// Joins vertices to the first one that is near, and leaves out faces that are nothing then.
    fn join(&mut self, near: f64) {
        let first = first_near(&self.mesh.vertices, near);
        let joined = (first.iter().enumerate()).filter(|(vertex, first)| vertex != *first);
        let joined = joined.count();
        let moves: HashMap<_, _> = (first.iter().zip(&self.mesh.vertices))
            .map(|(&first, x)| (key(*x), self.mesh.vertices[first]))
            .collect();
        for place in &mut self.places {
            *place = moves.get(&key(*place)).copied().unwrap_or(*place);
        }
        for corner in self.mesh.faces.as_flattened_mut() {
            *corner = first[*corner as usize] as u32;
        }
        let before = self.mesh.faces.len();
        self.mesh.faces.retain(has_three_corners);
        let collapsed = before - self.mesh.faces.len();
        self.note(joined, Warning::Joined);
        self.note(collapsed, Warning::Collapsed);
    }

    /// Turns parts round that lie in a number of others that does not fit to their orientation.
    pub(crate) fn orient_parts(&mut self) {
        let Ok(seams) = Seams::find(&self.mesh) else {
            return;
        };
        let parts = seams.parts(&self.mesh);
        if parts.len() < 2 {
            return;
        }
        let enclosing = enclosing(&self.mesh, &parts);
        let (mut bodies, mut shells) = (0, 0);
        let turned: Vec<bool> = (parts.iter().zip(&enclosing))
            .map(|(faces, around)| {
                let inwards = self.mesh.volume_behind(faces) < 0.0;
                let fits = inwards == (around.len() % 2 == 1);
                match (fits, inwards) {
                    (true, _) => {}
                    (false, false) => bodies += 1,
                    (false, true) => shells += 1,
                }
                !fits
            })
            .collect();
        if bodies + shells == parts.len() {
            // All of it is inside out, which is told as that.
            return;
        }
        for (face, part) in self.mesh.faces.iter_mut().zip(&seams.component) {
            if turned[*part as usize] {
                face.swap(1, 2);
            }
        }
        self.note(bodies, Warning::Bodies);
        self.note(shells, Warning::InsideOut);
    }
}

/// Numbers for so many parts, so that the two of each pair have different ones.
fn apart(count: usize, pairs: &[[usize; 2]]) -> Vec<u32> {
    let mut beside = vec![Vec::new(); count];
    for &[one, other] in pairs {
        beside[one].push(other);
        beside[other].push(one);
    }
    let mut numbers: Vec<Option<u32>> = vec![None; count];
    for part in 0..count {
        let taken: HashSet<u32> = beside[part].iter().filter_map(|&p| numbers[p]).collect();
        numbers[part] = (0..=part as u32).find(|number| !taken.contains(number));
    }
    numbers.into_iter().flatten().collect()
}

/// For every vertex the first one that it is joined to by a chain of vertices near to each other.
fn first_near(vertices: &[[f64; 3]], near: f64) -> Vec<usize> {
    let cell = |x: &[f64; 3]| x.map(|v| (v / near).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::with_capacity(vertices.len());
    let mut joined = Joined::new(vertices.len());
    for (vertex, x) in vertices.iter().enumerate() {
        let here = cell(x);
        for neighbour in 0..27_i64 {
            let step = [neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1];
            let there = [0, 1, 2].map(|axis| here[axis].saturating_add(step[axis]));
            for &other in cells.get(&there).into_iter().flatten() {
                let way = Vector::from_array(*x) - Vector::from_array(vertices[other]);
                if way.length() <= near {
                    joined.join(vertex, other);
                }
            }
        }
        cells.entry(here).or_default().push(vertex);
    }
    (0..vertices.len()).map(|v| joined.root(v)).collect()
}

/// What becomes of two faces that are each other's back.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Backs {
    /// They enclose nothing, and both are left out.
    Enclose,
    /// They are a surface that is there twice, of which the first one stays.
    Repeat,
}

/// Leaves out all but one of faces on the same vertices; returns how many.
pub(crate) fn without_doubles(mesh: &mut TriangleMesh, backs: Backs) -> usize {
    let sorted = |face: &[u32; 3]| {
        let mut sorted = *face;
        sorted.sort_unstable();
        // Whether the face goes round as the sorted vertices do.
        let turn = (0..3).find(|&i| face[i] == sorted[0]).unwrap_or_default();
        (sorted, face[(turn + 1) % 3] == sorted[1])
    };
    let mut known: HashMap<[u32; 3], [usize; 2]> = HashMap::with_capacity(mesh.faces.len());
    for face in &mesh.faces {
        let (vertices, forwards) = sorted(face);
        known.entry(vertices).or_default()[usize::from(forwards)] += 1;
    }
    if known.len() == mesh.faces.len() {
        return 0;
    }
    let before = mesh.faces.len();
    mesh.faces.retain(|face| {
        let (vertices, forwards) = sorted(face);
        let counts = known.get_mut(&vertices).expect("all are counted");
        // The first one of the side of which there are more.
        let [these, others] = [forwards, !forwards].map(|side| counts[usize::from(side)]);
        let stays = these > others || (backs == Backs::Repeat && these == others && these > 0);
        if stays {
            *counts = [0; 2];
        }
        stays
    });
    before - mesh.faces.len()
}

/// Flips the longest sides of faces without area among these, with others among these, until all have some; returns how many had none. None if that
/// does not help.
pub(crate) fn flipped(mesh: &mut TriangleMesh, among: impl RangeBounds<usize>) -> Option<usize> {
    let chosen: Vec<u32> = (0..mesh.faces.len() as u32)
        .filter(|face| among.contains(&(*face as usize)))
        .collect();
    let flat = |mesh: &TriangleMesh| -> Vec<u32> {
        let is_flat = |face: &u32| is_flat(mesh, mesh.faces[*face as usize]);
        chosen.iter().copied().filter(is_flat).collect()
    };
    let first = flat(mesh).len();
    for _ in 0..ROUNDS {
        if flat(mesh).is_empty() {
            return Some(first);
        }
        let mut surface = HalfEdges::new(mesh).ok()?;
        let mut any = false;
        for &face in &chosen {
            let corners = [0, 1, 2].map(|i| surface.from(3 * face + i));
            if is_flat(mesh, corners) {
                let is_chosen = |face: u32| among.contains(&(face as usize));
                any |= flip_longest(mesh, &mut surface, face, is_chosen);
            }
        }
        if !any {
            return None;
        }
        mesh.faces = surface.faces().collect();
    }
    None
}

/// Flips the longest side of a face that can be flipped with such a neighbour, if the two faces there are less flat then.
fn flip_longest(
    mesh: &TriangleMesh,
    surface: &mut HalfEdges,
    face: u32,
    with: impl Fn(u32) -> bool,
) -> bool {
    let point = |v: u32| Vector::from_array(mesh.vertices[v as usize]);
    let length = |h: u32| point(surface.to(h)).distance(point(surface.from(h)));
    let sides = [3 * face, 3 * face + 1, 3 * face + 2];
    let longest = sides
        .into_iter()
        .max_by(|a, b| length(*a).total_cmp(&length(*b)));
    let can_flip = |side: &u32| with(surface.twin(*side) / 3) && surface.can_flip(*side);
    let Some(side) = longest.filter(can_flip) else {
        return false;
    };
    let [a, b, c] = [surface.from(side), surface.to(side), surface.opposite(side)];
    let d = surface.opposite(surface.twin(side));
    // How high a face is over its longest side, as a part of that.
    let height = |face: [u32; 3]| {
        let corners = face.map(point);
        let sides = (0..3).map(|i| corners[i].distance(corners[(i + 1) % 3]));
        scaled_normal(corners).length() / sides.fold(0.0, f64::max).powi(2)
    };
    let least = |faces: [[u32; 3]; 2]| height(faces[0]).min(height(faces[1]));
    if least([[a, d, c], [d, b, c]]) <= least([[a, b, c], [b, a, d]]) {
        return false;
    }
    surface.flip(side);
    true
}
