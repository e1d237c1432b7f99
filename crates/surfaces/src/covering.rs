//! Open surfaces and surfaces that are no manifolds, closed for a flow alone.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use geometry::measure::BoundingBox;

use crate::closed::{Seams, drop_unreferenced, has_no_area};
use crate::lids::Lids;
use crate::mending::{Backs, Mending, flipped, without_doubles};
use crate::repair::orient;
use crate::vector::{Vector, scaled_normal};
use crate::{ClosedMesh, Error, Mended, TriangleMesh, Warning};

/// How high domes are over holes on which smooth lids would cross the surface or lie on it, as parts of the radius of the hole: the first of these that
/// is free.
const DOMES: [f64; 6] = [0.25, -0.25, 0.5, -0.5, 1.0, -1.0];
/// A part with its lids that encloses less than this part of its area times its longest side lies in a plane.
const IN_A_PLANE: f64 = 1e-6;

/// An open surface, or one with edges of more than two faces, closed by lids on its holes.
#[derive(Clone, Debug)]
pub struct Covered {
    /// The closed mesh: the surface comes first, and then its lids.
    pub mended: Mended,
    /// How many vertices are those of the surface,
    pub vertices: usize,
    /// and how many faces.
    pub faces: usize,
    /// The places of the vertices at its holes, and at edges that were cut.
    pub rim: Vec<[f64; 3]>,
    /// Those of them from where the surface does not go on smoothly.
    pub creases: Vec<[f64; 3]>,
    /// The parts that have no lids without crossings, and are not in the mesh.
    pub left: TriangleMesh,
}

impl Covered {
    /// The standard deviation of the noise of the surface, as [`TriangleMesh::noise`].
    pub fn noise(&self) -> f64 {
        self.mended.mesh.mesh().noise_of_first(self.vertices)
    }
}

impl ClosedMesh {
    /// A surface that bounds nothing with [lids](TriangleMesh::with_lids) on its holes, which is mended where exact coordinates and the neighbours of
    /// faces say how.
    ///
    /// Edges of more than two faces are cut: of the faces there, those stay neighbours between which the inside is, or of an odd number those that go
    /// on from each other with the least bend (A. Guéziec et al.: Cutting and stitching: converting sets of polygons to manifold surfaces. IEEE Trans.
    /// Vis. Comput. Graph. 7 (2001)). Where a smooth lid would cross the surface or lie on it, a dome takes its place. Parts for which there is none
    /// are left out.
    ///
    /// # Errors
    /// As [`ClosedMesh::mended`] for other faults; [`Error::LidCrosses`] if no part is left.
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
        let Apart {
            mesh,
            surface: [vertices, faces],
            rim,
            mut creases,
            left,
            parts: [left_parts, all],
            holes,
        } = Apart::of(&mending.mesh)?;
        if left_parts > 0 {
            let parts = left_parts;
            mending.changes.push(Warning::Left { parts, all });
        }
        mending.note(holes, Warning::Lids);
        mending.mesh = mesh;
        mending.orient_parts();
        let (mesh, more) = Self::new(mending.mesh)?;
        mending.changes.extend(more);
        creases.extend(&cuts.places);
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
            left,
        })
    }
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

/// A surface with lids that neither cross it nor lie on it.
struct Apart {
    mesh: TriangleMesh,
    /// Vertices and faces of the surface, which come first.
    surface: [usize; 2],
    rim: Vec<[f64; 3]>,
    /// The vertices at domes.
    creases: Vec<[f64; 3]>,
    left: TriangleMesh,
    /// How many parts are left out, and how many there are.
    parts: [usize; 2],
    /// How many holes are closed.
    holes: usize,
}

impl Apart {
    fn of(surface: &TriangleMesh) -> Result<Self, Error> {
        let [vertices, faces] = [surface.vertices.len(), surface.faces.len()];
        let mut lids = surface.with_straight_lids()?;
        let seams = Seams::find(&lids.mesh)?;
        let mut is_dome = vec![false; lids.lids.len()];
        let mut free = vec![false; lids.mesh.vertices.len()];
        let in_a_plane = in_a_plane(&lids, &seams);
        for (lid, is_dome) in lids.lids.iter().zip(&mut is_dome) {
            let part = seams.component[lid.faces.start] as usize;
            *is_dome = in_a_plane[part] == Some(lid.faces.start);
            free[lid.vertices.clone()].fill(in_a_plane[part].is_none());
        }
        for lid in (0..is_dome.len()).filter(|lid| is_dome[*lid]) {
            lids.lids[lid].make_dome(&mut lids.mesh, DOMES[0]);
        }
        lids.mesh.bend_least(&free);
        let mut crossing = lids.that_cross();
        for height in DOMES {
            if crossing.is_empty() {
                break;
            }
            for &lid in &crossing {
                is_dome[lid] = true;
                lids.lids[lid].make_dome(&mut lids.mesh, height);
            }
            crossing = lids.that_cross();
        }
        // Faces of lids on straight rims.
        flipped(&mut lids.mesh, faces..);
        let part_of = |lid: usize| seams.component[lids.lids[lid].faces.start];
        let left: HashSet<u32> = crossing.iter().map(|&lid| part_of(lid)).collect();
        if left.len() == seams.components {
            return Err(Error::LidCrosses {
                holes: lids.holes,
                faces: (lids.mesh.crossing_faces().iter()).filter(|c| **c).count(),
            });
        }
        let at = |which: &dyn Fn(usize) -> bool| -> BTreeSet<u32> {
            let of_lids = (0..lids.lids.len()).filter(|lid| which(*lid));
            let corners = of_lids
                .flat_map(|lid| lids.mesh.faces[lids.lids[lid].faces.clone()].as_flattened());
            corners
                .copied()
                .filter(|v| (*v as usize) < vertices)
                .collect()
        };
        let places = |at: BTreeSet<u32>| {
            at.into_iter()
                .map(|v| surface.vertices[v as usize])
                .collect()
        };
        let stays = |lid: usize| !left.contains(&part_of(lid));
        let (rim, creases) = (
            places(at(&stays)),
            places(at(&|lid| stays(lid) && is_dome[lid])),
        );
        let holes = (0..lids.lids.len()).filter(|lid| stays(*lid)).count();
        let of = |is_left: bool, count: usize| TriangleMesh {
            faces: (lids.mesh.faces[..count].iter().zip(&seams.component))
                .filter(|(_, part)| left.contains(part) == is_left)
                .map(|(face, _)| *face)
                .collect(),
            ..lids.mesh.clone()
        };
        let mut used = vec![false; vertices];
        let surface = of(false, faces);
        for &v in surface.faces.as_flattened() {
            used[v as usize] = true;
        }
        let [mut mesh, mut without] = [of(false, lids.mesh.faces.len()), of(true, faces)];
        drop_unreferenced(&mut mesh);
        drop_unreferenced(&mut without);
        Ok(Self {
            mesh,
            surface: [
                used.iter().filter(|used| **used).count(),
                surface.faces.len(),
            ],
            rim,
            creases,
            left: without,
            parts: [left.len(), seams.components],
            holes,
        })
    }
}

/// For each part that lies in a plane, or whose straight lids lie on it, the first face of the largest of its lids.
fn in_a_plane(lids: &Lids, seams: &Seams) -> Vec<Option<usize>> {
    let mut largest: Vec<Option<(f64, usize)>> = vec![None; seams.components];
    for lid in &lids.lids {
        let known = &mut largest[seams.component[lid.faces.start] as usize];
        if known.is_none_or(|(area, _)| lid.area() > area) {
            *known = Some((lid.area(), lid.faces.start));
        }
    }
    let parts = seams.parts(&lids.mesh);
    let is_flat = |faces: &Vec<[u32; 3]>| {
        let corners = faces.as_flattened().iter();
        let bounds = BoundingBox::around(corners.map(|&v| lids.mesh.vertices[v as usize]));
        let side = bounds.map_or(0.0, |bounds| bounds.longest_side());
        let areas = faces
            .iter()
            .map(|&face| 0.5 * scaled_normal(lids.mesh.corners(face)).length());
        let area: f64 = areas.sum();
        lids.mesh.volume_behind(faces).abs() <= IN_A_PLANE * area * side
    };
    (largest.into_iter().zip(&parts))
        .map(|(lid, faces)| lid.filter(|_| is_flat(faces)).map(|(_, first)| first))
        .collect()
}

impl Lids {
    /// The lids of which faces cross others.
    fn that_cross(&self) -> Vec<usize> {
        let crosses = self.mesh.crossing_faces();
        let crosses = |lid: &usize| crosses[self.lids[*lid].faces.clone()].contains(&true);
        (0..self.lids.len()).filter(crosses).collect()
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
        let mut fans = Fans((0..3 * mesh.faces.len()).collect());
        let mut edges = 0;
        for (ends, edge) in &mut sides {
            if is_singular(edge) {
                edges += 1;
                singular.extend(*ends);
                set_angles(mesh, *ends, edge);
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
        Self { edges, places }
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
struct Fans(Vec<usize>);

impl Fans {
    fn root(&mut self, mut corner: usize) -> usize {
        while self.0[corner] != corner {
            self.0[corner] = self.0[self.0[corner]];
            corner = self.0[corner];
        }
        corner
    }

    fn join(&mut self, one: usize, other: usize) {
        let [one, other] = [one, other].map(|corner| self.root(corner));
        self.0[one.max(other)] = one.min(other);
    }

    /// Joins the corners at both ends of two sides that start from these corners in opposite directions.
    fn join_across(&mut self, one: usize, other: usize) {
        let next = |corner: usize| corner - corner % 3 + (corner + 1) % 3;
        self.join(one, next(other));
        self.join(next(one), other);
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
            let root = self.root(corner);
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
