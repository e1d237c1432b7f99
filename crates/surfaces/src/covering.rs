//! Open surfaces and surfaces that are no manifolds, closed for a flow alone.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use geometry::measure::BoundingBox;

use crate::closed::{Seams, drop_unreferenced, has_no_area};
use crate::hierarchy::Hierarchy;
use crate::joined::Joined;
use crate::lids::Lids;
use crate::mending::{Backs, Mending, flipped, without_doubles};
use crate::repair::orient;
use crate::triangle::Triangle;
use crate::vector::{Vector, scaled_normal};
use crate::{ClosedMesh, Error, Mended, MeshDistance, TriangleMesh, Warning};

/// How high domes are over holes on which smooth lids would cross the surface or lie on it, as parts of the radius of the hole: the first of these that
/// is free.
const DOMES: [f64; 6] = [0.25, -0.25, 0.5, -0.5, 1.0, -1.0];
/// How far away the copy of a part is that becomes a plate, over its longest side: the first of these that is free.
const PLATES: [f64; 6] = [-0.1, 0.1, -0.05, 0.05, -0.025, 0.025];
/// If more than this part of the area can only be left out, parts are closed that cross others,
const MOST_LEFT: f64 = 0.5;
/// and if it is still more than this, the surface is refused.
const MOST_LEFT_OF_UNION: f64 = 0.9;
/// Lids may cross the surface of a part where nothing else closes it, if they cross no more than this part of its area.
const MOST_CROSSED: f64 = 0.2;
/// A surface of more parts, or with more holes, is one of loose faces, which would take long to be closed one by one.
const MOST_LOOSE: usize = 2000;
/// Vertices that are no farther than this part of the longest side from another body, or from a lid that crosses something, stay.
const BESIDE: f64 = 0.02;
/// Rounds in which the normals along which that is are averaged over neighbours.
const AVERAGED: usize = 8;
/// A part with its lids that encloses less than this part of its area times its longest side lies in a plane.
const IN_A_PLANE: f64 = 1e-6;

/// An open surface, or one with edges of more than two faces, closed by lids on its holes.
#[derive(Clone, Debug)]
pub struct Covered {
    /// The closed mesh: the surface comes first, and then its lids.
    pub mended: Mended,
    /// How many vertices are those of the surface.
    pub vertices: usize,
    /// How many faces are those of the surface.
    pub faces: usize,
    /// The places of the vertices at its holes, and at edges that were cut.
    pub rim: Vec<[f64; 3]>,
    /// The places of the rim from where the surface does not go on smoothly.
    pub creases: Vec<[f64; 3]>,
    /// The places of other vertices that stay, since it is not known there what is inside: those within other bodies, or near where bodies or lids cross.
    pub unsure: Vec<[f64; 3]>,
    /// Whether there are such places at all, near vertices or not.
    pub is_unsure: bool,
    /// The parts that have no lids, and are not in the mesh.
    pub left: TriangleMesh,
}

impl ClosedMesh {
    /// A surface that bounds nothing with [lids](TriangleMesh::with_lids) on its holes, which is mended where exact coordinates and the neighbours of
    /// faces say how.
    ///
    /// Edges of more than two faces are cut: of the faces there, those stay neighbours between which the inside is, or of an odd number those that go
    /// on from each other with the least bend (A. Guéziec et al.: Cutting and stitching: converting sets of polygons to manifold surfaces. IEEE Trans.
    /// Vis. Comput. Graph. 7 (2001)). Where a smooth lid would cross the surface, a dome takes its place. A part in a plane, and one with
    /// lids that still cross, becomes a plate, with a copy of it beside it. Parts for which there is no place are left out.
    ///
    /// Where that is more than half of the area, each part is closed by itself: its lids or its plate may cross other parts, and if nothing else closes
    /// it, itself in a few places. Parts that overlap are a [union of bodies](ClosedMesh::bodies). Vertices for which it is not known then what is inside
    /// are [named](Covered::unsure).
    ///
    /// # Errors
    /// As [`ClosedMesh::mended`] for other faults; [`Error::LidCrosses`] if nearly all of the area would be left out;
    /// [`Error::Loose`] for thousands of parts or holes.
    pub fn covered(mesh: TriangleMesh) -> Result<Covered, Error> {
        let mut mending = Mending::of(mesh);
        mending.merge();
        let doubled = without_doubles(&mut mending.mesh, Backs::Repeat);
        mending.note(doubled, Warning::Doubled);
        let turned = orient(&mut mending.mesh.faces);
        mending.note(turned, Warning::Turned);
        let cuts = Cuts::make(&mut mending.mesh);
        mending.note(cuts.edges, Warning::Cut);
        let unreferenced = drop_unreferenced(&mut mending.mesh);
        mending.note(unreferenced, Warning::Unreferenced);
        let flat = with_area(&mut mending.mesh)?;
        mending.note(flat, Warning::Flat);
        let (apart, closed) = Apart::of(&mending.mesh)?;
        let count = |closing: Closing| apart.closings.iter().filter(|c| **c == closing).count();
        let stays = |lid: usize| apart.closings[apart.part_of(lid)] != Closing::Left;
        let crossed = apart.crossing_lids();
        let rim = apart.rims(stays);
        let is_crease = |lid: usize| !apart.has_lids(apart.part_of(lid)) || apart.is_dome[lid];
        let mut creases = apart.rims(|lid| stays(lid) && is_crease(lid));
        let (left, holes) = (apart.left(), apart.chosen_lids().count());
        let [lost, all] = [count(Closing::Left), apart.closings.len()];
        let plates = all - lost - count(Closing::Lids) - count(Closing::Crossing);
        let [vertices, faces] = closed.surface;
        if lost > 0 {
            mending.changes.push(Warning::Left { parts: lost, all });
        }
        mending.note(holes, Warning::Lids);
        mending.note(plates, Warning::Plates);
        mending.note(crossed.lids, Warning::CrossingLids);
        mending.mesh = closed.mesh;
        let mesh = mending.bounded()?;
        creases.extend(&cuts.places);
        let unsure = unsure(&mesh, vertices, &crossed.faces);
        let is_unsure = mesh.is_union() || crossed.lids > 0;
        if is_unsure {
            mending.changes.push(Warning::Stay {
                vertices: unsure.len() + left.vertices.len(),
                all: vertices + left.vertices.len(),
            });
        }
        Ok(Covered {
            mended: Mended {
                mesh,
                changes: mending.changes,
                places: mending.places,
            },
            vertices,
            faces,
            rim: rim.into_iter().chain(cuts.places).collect(),
            creases,
            unsure,
            is_unsure,
            left,
        })
    }
}

/// The places of those of the first vertices that are within other bodies or near them, or near these faces.
fn unsure(mesh: &ClosedMesh, count: usize, crossed: &[Triangle]) -> Vec<[f64; 3]> {
    let near = BESIDE * mesh.bounding_box().longest_side();
    let places = &mesh.mesh().vertices[..count];
    let mut is_unsure = vec![false; count];
    if !crossed.is_empty() {
        let (lids, _) = Hierarchy::new(crossed);
        for (is_unsure, x) in is_unsure.iter_mut().zip(places) {
            *is_unsure |= lids.is_within(Vector::from_array(*x), near * near);
        }
    }
    if mesh.is_union() {
        let of_vertices = mesh.body_of_vertices();
        for (number, body) in (0..).zip(mesh.bodies()) {
            let others: Vec<usize> = (0..count).filter(|&v| of_vertices[v] != number).collect();
            let at: Vec<[f64; 3]> = others.iter().map(|&v| places[v]).collect();
            let distances = MeshDistance::new(&body).signed_distances(&at);
            for (vertex, distance) in others.into_iter().zip(distances) {
                is_unsure[vertex] |= distance < near;
            }
        }
    }
    let pairs = places.iter().zip(is_unsure);
    (pairs.filter(|(_, is_unsure)| *is_unsure))
        .map(|(x, _)| *x)
        .collect()
}

/// Flips the longest sides of faces without area; returns how many had none.
fn with_area(surface: &mut TriangleMesh) -> Result<usize, Error> {
    let Err(error) = has_no_area(surface) else {
        return Ok(0);
    };
    let count = surface.faces.len();
    let mut closed = surface.with_straight_lids()?.mesh;
    let flat = flipped(&mut closed, ..count).ok_or(error)?;
    surface.faces.copy_from_slice(&closed.faces[..count]);
    Ok(flat)
}

/// How a part of a surface is closed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Closing {
    /// By lids on its holes.
    Lids,
    /// By its own copy, which is so many longest sides of the part away along the normals, and a band between both rims.
    Plate(usize),
    /// By lids on its holes that cross it in a few places.
    Crossing,
    /// Not at all: it is left out.
    Left,
}

/// Which faces must not cross what closes a part.
#[derive(Clone, Copy, PartialEq)]
enum Against {
    /// All others.
    All,
    /// Those of the part.
    Itself,
}

/// Lids that cross the surface.
struct CrossingLids {
    lids: usize,
    /// Their faces that do.
    faces: Vec<Triangle>,
}

/// A surface, and what closes its parts without crossing them.
struct Apart<'a> {
    surface: &'a TriangleMesh,
    against: Against,
    lids: Lids,
    seams: Seams,
    is_dome: Vec<bool>,
    /// Whether each part lies in a plane, or its straight lids on it.
    is_flat: Vec<bool>,
    closings: Vec<Closing>,
}

/// A closed surface.
struct Closed {
    mesh: TriangleMesh,
    /// The part of each face.
    part: Vec<usize>,
    /// Vertices and faces of the surface, which come first.
    surface: [usize; 2],
}

impl<'a> Apart<'a> {
    fn of(surface: &'a TriangleMesh) -> Result<(Self, Closed), Error> {
        match Self::against(Against::All, surface) {
            Err(Error::LidCrosses { .. }) => Self::against(Against::Itself, surface),
            found => found,
        }
    }

    fn against(against: Against, surface: &'a TriangleMesh) -> Result<(Self, Closed), Error> {
        let lids = surface.with_straight_lids()?;
        let seams = Seams::find(&lids.mesh)?;
        if lids.holes.max(seams.components) > MOST_LOOSE {
            return Err(Error::Loose {
                parts: seams.components,
                holes: lids.holes,
                most: MOST_LOOSE,
            });
        }
        let mut apart = Self {
            surface,
            against,
            is_dome: vec![false; lids.each.len()],
            is_flat: vec![false; seams.components],
            closings: vec![Closing::Lids; seams.components],
            lids,
            seams,
        };
        for part in apart.in_a_plane() {
            apart.is_flat[part] = true;
            apart.closings[part] = Closing::Plate(0);
        }
        apart.bend();
        apart.raise_domes();
        loop {
            let closed = apart.closed();
            let mut crossing = closed.that_cross(against);
            crossing.retain(|part| apart.closings[*part] != Closing::Crossing);
            if crossing.is_empty() {
                return Ok((apart, closed));
            }
            // Lids that were good are so when a plate has found its place.
            let of_plates = |part: &usize| apart.closings[*part] != Closing::Lids;
            if crossing.iter().any(of_plates) {
                crossing.retain(of_plates);
            }
            let mut at_end = Vec::new();
            for part in crossing {
                apart.closings[part] = match apart.closings[part] {
                    Closing::Lids => Closing::Plate(0),
                    Closing::Plate(last) if last + 1 < PLATES.len() => Closing::Plate(last + 1),
                    _ => {
                        at_end.push(part);
                        Closing::Left
                    }
                };
            }
            if against == Against::Itself {
                apart.let_lids_cross(&at_end);
            }
            let most = match against {
                Against::All => MOST_LEFT,
                Against::Itself => MOST_LEFT_OF_UNION,
            };
            if apart.part_left() > most {
                return Err(Error::LidCrosses {
                    holes: apart.lids.holes,
                    faces: (apart.lids.mesh.crossing_faces().iter())
                        .filter(|crosses| **crosses)
                        .count(),
                });
            }
        }
    }

    fn part_of(&self, lid: usize) -> usize {
        self.seams.component[self.lids.each[lid].faces.start] as usize
    }

    fn has_lids(&self, part: usize) -> bool {
        matches!(self.closings[part], Closing::Lids | Closing::Crossing)
    }

    /// Which faces cross others that count.
    fn crossing_faces(&self) -> Vec<bool> {
        let part = &self.seams.component;
        (self.lids.mesh).crossing_among(|one, other| self.against.counts(&part[one], &part[other]))
    }

    /// Closes those of these parts by lids that these cross in a few places only.
    fn let_lids_cross(&mut self, parts: &[usize]) {
        if parts.is_empty() {
            return;
        }
        let crosses = self.crossing_faces();
        let [mut crossed, mut all] = [0, 1].map(|_| vec![0.0; self.closings.len()]);
        let faces = self.surface.faces.iter().zip(&self.seams.component);
        for ((face, part), crosses) in faces.zip(crosses) {
            let area = scaled_normal(self.surface.corners(*face)).length();
            all[*part as usize] += area;
            if crosses {
                crossed[*part as usize] += area;
            }
        }
        for &part in parts {
            if !self.is_flat[part] && crossed[part] <= MOST_CROSSED * all[part] {
                self.closings[part] = Closing::Crossing;
            }
        }
    }

    /// The lids that cross the surface.
    fn crossing_lids(&self) -> CrossingLids {
        let mut found = CrossingLids {
            lids: 0,
            faces: Vec::new(),
        };
        if !self.closings.contains(&Closing::Crossing) {
            return found;
        }
        let crosses = self.crossing_faces();
        for lid in self.chosen_lids() {
            let faces = self.lids.each[lid].faces.clone();
            let crossing = faces.filter(|face| crosses[*face]);
            let before = found.faces.len();
            let mesh = &self.lids.mesh;
            found
                .faces
                .extend(crossing.map(|face| mesh.corners(mesh.faces[face])));
            found.lids += usize::from(found.faces.len() > before);
        }
        found
    }

    /// The lids of parts that have some.
    fn chosen_lids(&self) -> impl Iterator<Item = usize> {
        (0..self.lids.each.len()).filter(|lid| self.has_lids(self.part_of(*lid)))
    }

    /// Makes the lids smooth.
    fn bend(&mut self) {
        let mut free = vec![false; self.lids.mesh.vertices.len()];
        for lid in self.chosen_lids() {
            free[self.lids.each[lid].vertices.clone()].fill(true);
        }
        self.lids.mesh.bend_least(&free);
        // Faces on straight rims, which stay if that does not help.
        flipped(&mut self.lids.mesh, self.surface.faces.len()..);
    }

    /// Makes lids that cross something domes, in the end those that cross the least where lids may cross their part.
    fn raise_domes(&mut self) {
        let mut least: Vec<Option<(usize, f64)>> = vec![None; self.lids.each.len()];
        // A smooth lid that crosses something becomes a straight one if that is best.
        let mut heights = vec![0.0; self.lids.each.len()];
        let last = (self.against == Against::Itself).then_some(None);
        for height in DOMES.into_iter().map(Some).chain(last) {
            let crosses = self.crossing_faces();
            let count = |lid: usize| {
                let faces = &crosses[self.lids.each[lid].faces.clone()];
                faces.iter().filter(|crosses| **crosses).count()
            };
            let crossing = self.chosen_lids().map(|lid| (lid, count(lid)));
            let crossing: Vec<_> = crossing.filter(|(_, count)| *count > 0).collect();
            if crossing.is_empty() {
                return;
            }
            for (lid, count) in crossing {
                let found = (count, heights[lid]);
                let best =
                    least[lid].map_or(found, |best| if best.0 <= count { best } else { found });
                least[lid] = Some(best);
                heights[lid] = height.unwrap_or(best.1);
                self.is_dome[lid] = true;
                self.lids.each[lid].make_dome(&mut self.lids.mesh, heights[lid]);
            }
        }
    }

    /// The parts that lie in a plane, or whose straight lids lie on them.
    fn in_a_plane(&self) -> Vec<usize> {
        let mesh = &self.lids.mesh;
        let parts = self.seams.parts(mesh);
        let is_flat = |part: &usize| {
            let faces = &parts[*part];
            let areas = faces
                .iter()
                .map(|&face| 0.5 * scaled_normal(mesh.corners(face)).length());
            let area: f64 = areas.sum();
            mesh.volume_behind(faces).abs() <= IN_A_PLANE * area * longest_side(mesh, faces)
        };
        (0..parts.len()).filter(is_flat).collect()
    }

    /// The parts as they are closed.
    fn closed(&self) -> Closed {
        let count = self.surface.faces.len();
        let all = &self.lids.mesh;
        let part_of = |face: usize| self.seams.component[face] as usize;
        let kept = (0..count).filter(|&face| self.closings[part_of(face)] != Closing::Left);
        let kept: Vec<usize> = kept.collect();
        let lids = (count..all.faces.len()).filter(|&face| self.has_lids(part_of(face)));
        let faces: Vec<usize> = kept.iter().copied().chain(lids).collect();
        let mut mesh = TriangleMesh {
            faces: faces.iter().map(|&face| all.faces[face]).collect(),
            ..all.clone()
        };
        let mut part: Vec<usize> = faces.into_iter().map(part_of).collect();
        let mut used = vec![false; self.surface.vertices.len()];
        for &v in mesh.faces[..kept.len()].as_flattened() {
            used[v as usize] = true;
        }
        let mut of_parts: Vec<Vec<[u32; 3]>> = vec![Vec::new(); self.closings.len()];
        for &face in &kept {
            of_parts[part_of(face)].push(all.faces[face]);
        }
        for (number, (closing, own)) in self.closings.iter().zip(of_parts).enumerate() {
            if let Closing::Plate(place) = closing {
                add_plate(&mut mesh, &own, PLATES[*place]);
                part.resize(mesh.faces.len(), number);
            }
        }
        drop_unreferenced(&mut mesh);
        Closed {
            mesh,
            part,
            surface: [used.iter().filter(|used| **used).count(), kept.len()],
        }
    }

    /// The part of the area that is left out.
    fn part_left(&self) -> f64 {
        let (mut left, mut all) = (0.0, 0.0);
        for (face, part) in self.surface.faces.iter().zip(&self.seams.component) {
            let area = scaled_normal(self.surface.corners(*face)).length();
            all += area;
            if self.closings[*part as usize] == Closing::Left {
                left += area;
            }
        }
        left / f64::max(all, f64::MIN_POSITIVE)
    }

    /// The parts that are left out.
    fn left(&self) -> TriangleMesh {
        let faces = self.surface.faces.iter().zip(&self.seams.component);
        let is_left = |part: u32| self.closings[part as usize] == Closing::Left;
        let faces = faces.filter(|(_, part)| is_left(**part));
        let mut left = TriangleMesh {
            faces: faces.map(|(face, _)| *face).collect(),
            ..self.surface.clone()
        };
        drop_unreferenced(&mut left);
        left
    }

    /// The places of the vertices of the surface at lids of these parts.
    fn rims(&self, of: impl Fn(usize) -> bool) -> Vec<[f64; 3]> {
        let lids = (0..self.lids.each.len()).filter(|lid| of(*lid));
        let faces = lids.flat_map(|lid| self.lids.each[lid].faces.clone());
        let corners = faces.flat_map(|face| self.lids.mesh.faces[face]);
        let at: BTreeSet<u32> = corners
            .filter(|v| (*v as usize) < self.surface.vertices.len())
            .collect();
        (at.into_iter())
            .map(|v| self.surface.vertices[v as usize])
            .collect()
    }
}

impl Closed {
    /// The parts of which something crosses that is not of the surface.
    fn that_cross(&self, against: Against) -> Vec<usize> {
        let part = &self.part;
        let counts = |one: usize, other: usize| against.counts(&part[one], &part[other]);
        let crosses = self.mesh.crossing_among(counts);
        let added = (self.surface[1]..crosses.len()).filter(|face| crosses[*face]);
        let parts: BTreeSet<usize> = added.map(|face| self.part[face]).collect();
        parts.into_iter().collect()
    }
}

impl Against {
    /// Whether a crossing of faces of these parts counts.
    fn counts<T: PartialEq>(self, one: &T, other: &T) -> bool {
        self == Self::All || one == other
    }
}

fn longest_side(mesh: &TriangleMesh, faces: &[[u32; 3]]) -> f64 {
    let corners = faces.as_flattened().iter();
    let bounds = BoundingBox::around(corners.map(|&v| mesh.vertices[v as usize]));
    bounds.map_or(0.0, |bounds| bounds.longest_side())
}

/// Adds a copy of some faces, turned round, so many of their longest sides away along the averaged normals, and a band between the rims of both.
fn add_plate(mesh: &mut TriangleMesh, faces: &[[u32; 3]], height: f64) {
    let height = height * longest_side(mesh, faces);
    let mut copy: BTreeMap<u32, (u32, Vector)> = BTreeMap::new();
    for &face in faces {
        let normal = scaled_normal(mesh.corners(face));
        for vertex in face {
            copy.entry(vertex).or_default().1 += normal;
        }
    }
    for _ in 0..AVERAGED {
        let before = copy.clone();
        for face in faces {
            let sum: Vector = face.iter().map(|v| before[v].1.normalize_or_zero()).sum();
            for vertex in face {
                copy.entry(*vertex).or_default().1 += sum;
            }
        }
        for (_, normal) in copy.values_mut() {
            *normal = normal.normalize_or_zero();
        }
    }
    for (&vertex, (number, normal)) in &mut copy {
        *number = mesh.vertices.len() as u32;
        let x = Vector::from_array(mesh.vertices[vertex as usize]) + *normal * height;
        mesh.vertices.push(x.to_array());
    }
    let mut sides: BTreeSet<[u32; 2]> = BTreeSet::new();
    for face in faces {
        sides.extend((0..3).map(|i| [face[i], face[(i + 1) % 3]]));
        let [a, b, c] = face.map(|v| copy[&v].0);
        mesh.faces.push([a, c, b]);
    }
    for &[a, b] in sides.iter().filter(|[a, b]| !sides.contains(&[*b, *a])) {
        let [c, d] = [a, b].map(|v| copy[&v].0);
        mesh.faces.extend([[b, a, c], [b, c, d]]);
    }
}

/// A side of a face at an edge, seen along the edge from its lower vertex to the higher one.
#[derive(Clone, Copy)]
struct Side {
    /// The corner from which it starts, of all corners of all faces.
    corner: usize,
    /// Whether the face runs from the lower vertex to the higher one.
    upwards: bool,
    /// The direction of the face about the edge, in radians.
    angle: f64,
}

/// Edges that were cut.
struct Cuts {
    edges: usize,
    /// Where their vertices are.
    places: Vec<[f64; 3]>,
}

impl Cuts {
    /// Cuts all edges of more than two faces, and of two that run through it in the same direction: a vertex for every fan of faces there.
    fn make(mesh: &mut TriangleMesh) -> Self {
        let mut sides: BTreeMap<[u32; 2], Vec<Side>> = BTreeMap::new();
        for (face, vertices) in mesh.faces.iter().enumerate() {
            for i in 0..3 {
                let [a, b] = [vertices[i], vertices[(i + 1) % 3]];
                sides.entry([a.min(b), a.max(b)]).or_default().push(Side {
                    corner: 3 * face + i,
                    upwards: a < b,
                    angle: 0.0,
                });
            }
        }
        let is_singular = |edge: &[Side]| {
            edge.len() > 2 || (edge.len() == 2 && edge[0].upwards == edge[1].upwards)
        };
        let mut singular = BTreeSet::new();
        let mut fans = Fans(Joined::new(3 * mesh.faces.len()));
        let mut edges = 0;
        // Of what is inside out, the other side is inside.
        let is_inside_out = mesh.volume() < 0.0;
        for (ends, edge) in &mut sides {
            if is_singular(edge) {
                edges += 1;
                singular.extend(*ends);
                set_angles(mesh, *ends, edge);
                if is_inside_out {
                    for side in edge.iter_mut() {
                        side.upwards ^= true;
                    }
                }
                for [up, down] in pairs(edge) {
                    fans.join_across(up, down);
                }
            } else if let [one, other] = **edge {
                fans.join_across(one.corner, other.corner);
            }
        }
        let places = singular
            .iter()
            .map(|v| mesh.vertices[*v as usize])
            .collect();
        fans.separate(mesh, &singular);
        detach(mesh);
        Self { edges, places }
    }
}

/// Gives faces their own vertices at edges that others run through in the same direction: those whose fans come together again elsewhere.
fn detach(mesh: &mut TriangleMesh) {
    let mut known: HashSet<[u32; 2]> = HashSet::with_capacity(3 * mesh.faces.len());
    for face in 0..mesh.faces.len() {
        let edges = |face: [u32; 3]| [0, 1, 2].map(|i| [face[i], face[(i + 1) % 3]]);
        if edges(mesh.faces[face])
            .iter()
            .any(|edge| known.contains(edge))
        {
            for i in 0..3 {
                let vertex = mesh.faces[face][i] as usize;
                mesh.faces[face][i] = mesh.vertices.len() as u32;
                mesh.vertices.push(mesh.vertices[vertex]);
                if let Some(normals) = &mut mesh.normals {
                    normals.push(normals[vertex]);
                }
            }
        }
        known.extend(edges(mesh.faces[face]));
    }
}

/// Measures the directions of the faces at an edge about it.
fn set_angles(mesh: &TriangleMesh, [low, high]: [u32; 2], sides: &mut [Side]) {
    let point = |v: u32| Vector::from_array(mesh.vertices[v as usize]);
    let axis = (point(high) - point(low)).normalize_or_zero();
    let towards = |side: &Side| {
        let face = mesh.faces[side.corner / 3];
        let way = point(face[(side.corner + 2) % 3]) - point(low);
        (way - axis * way.dot(axis)).normalize_or_zero()
    };
    let first = towards(&sides[0]);
    let across = axis.cross(first);
    for side in sides {
        let way = towards(side);
        side.angle = way
            .dot(across)
            .atan2(way.dot(first))
            .rem_euclid(std::f64::consts::TAU);
    }
}

/// Which sides of an edge stay together, those upwards first.
fn pairs(sides: &[Side]) -> Vec<[usize; 2]> {
    let mut sorted = sides.to_vec();
    sorted.sort_by(|a, b| a.angle.total_cmp(&b.angle));
    let ups = sides.iter().filter(|side| side.upwards).count();
    if 2 * ups == sides.len() {
        between(&sorted)
    } else {
        straightest(&sorted)
    }
}

/// The pairs with the inside between them: about the edge, it is behind a face that runs downwards and before one that runs upwards.
fn between(sorted: &[Side]) -> Vec<[usize; 2]> {
    let (mut open, mut pairs) = (Vec::new(), Vec::new());
    // Twice around, so that pairs are found across the beginning.
    let mut paired = vec![false; sorted.len()];
    for place in (0..sorted.len()).chain(0..sorted.len()) {
        if paired[place] {
            continue;
        }
        if !sorted[place].upwards {
            if !open.contains(&place) {
                open.push(place);
            }
        } else if let Some(down) = open.pop() {
            (paired[place], paired[down]) = (true, true);
            pairs.push([sorted[place].corner, sorted[down].corner]);
        }
    }
    pairs
}

/// The pairs that go on from each other with the least bend, one after the other.
fn straightest(sorted: &[Side]) -> Vec<[usize; 2]> {
    let mut all: Vec<(f64, usize, usize)> = Vec::new();
    for up in sorted.iter().filter(|side| side.upwards) {
        for down in sorted.iter().filter(|side| !side.upwards) {
            let bend = (up.angle - down.angle).abs() - std::f64::consts::PI;
            all.push((bend.abs(), up.corner, down.corner));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut used, mut pairs) = (HashSet::new(), Vec::new());
    for (_, up, down) in all {
        if !used.contains(&up) && !used.contains(&down) {
            used.extend([up, down]);
            pairs.push([up, down]);
        }
    }
    pairs
}

/// Corners that are joined to those of neighbours.
struct Fans(Joined);

impl Fans {
    /// Joins the corners at both ends of two sides that start from these corners in opposite directions.
    fn join_across(&mut self, one: usize, other: usize) {
        let next = |corner: usize| corner - corner % 3 + (corner + 1) % 3;
        self.0.join(one, next(other));
        self.0.join(next(one), other);
    }

    /// Gives every fan of faces at these vertices one of its own.
    fn separate(&mut self, mesh: &mut TriangleMesh, at: &BTreeSet<u32>) {
        let mut own: BTreeMap<usize, u32> = BTreeMap::new();
        let mut taken = HashSet::new();
        for corner in 0..3 * mesh.faces.len() {
            let vertex = mesh.faces[corner / 3][corner % 3];
            if !at.contains(&vertex) {
                continue;
            }
            let root = self.0.root(corner);
            let new = *own.entry(root).or_insert_with(|| {
                if taken.insert(vertex) {
                    return vertex;
                }
                mesh.vertices.push(mesh.vertices[vertex as usize]);
                if let Some(normals) = &mut mesh.normals {
                    normals.push(normals[vertex as usize]);
                }
                mesh.vertices.len() as u32 - 1
            });
            mesh.faces[corner / 3][corner % 3] = new;
        }
    }
}
