//! Lists of triangles.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::hash::{BuildHasherDefault, Hasher};

use chacha20::ChaCha8Rng;
use geometry::measure::BoundingBox;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;

use crate::Error;
use crate::vector::{Vector, scaled_normal};

/// Triangles over shared vertices, not necessarily closed; see [`ClosedMesh`](crate::ClosedMesh).
#[must_use]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Positions.
    pub vertices: Vec<[f64; 3]>,
    /// Three vertices each, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Outward unit normals of the vertices, if known.
    pub normals: Option<Vec<[f64; 3]>>,
}

impl TriangleMesh {
    /// The smallest box with all vertices; `None` without vertices.
    pub fn bounding_box(&self) -> Option<BoundingBox<3>> {
        BoundingBox::around(self.vertices.iter().copied())
    }

    /// The vertices as vectors.
    pub(crate) fn points(&self) -> Vec<Vector> {
        let vertices = self.vertices.iter();
        vertices.map(|&x| Vector::from_array(x)).collect()
    }

    /// The places of the vertices that faces have, in the order of the vertices.
    pub fn corner_places(&self) -> impl Iterator<Item = [f64; 3]> {
        let mut is_corner = vec![false; self.vertices.len()];
        for &vertex in self.faces.as_flattened() {
            is_corner[vertex as usize] = true;
        }
        let all = self.vertices.iter().zip(is_corner);
        all.filter(|(_, is_corner)| *is_corner).map(|(x, _)| *x)
    }

    /// Corners of a face.
    pub(crate) fn corners(&self, face: [u32; 3]) -> [Vector; 3] {
        face.map(|v| Vector::from_array(self.vertices[v as usize]))
    }

    /// The same faces on other vertices, without normals.
    pub(crate) fn on(&self, points: &[Vector]) -> Self {
        Self {
            vertices: points.iter().map(Vector::to_array).collect(),
            faces: self.faces.clone(),
            normals: None,
        }
    }

    /// The centres of faces with their normals and areas; of large meshes those of every k-th face, at most `most` of them.
    pub fn sides(&self, most: usize) -> impl Iterator<Item = ([f64; 3], [f64; 3], f64)> + Clone {
        let faces = (self.faces.iter()).step_by(self.faces.len().div_ceil(most).max(1));
        let sides = faces.map(|face| {
            let corners = self.corners(*face);
            let normal = scaled_normal(corners);
            let length = normal.length();
            let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
            (
                centre.to_array(),
                (normal / length).to_array(),
                0.5 * length,
            )
        });
        sides.filter(|(_, _, area)| *area > 0.0)
    }

    /// Moves every vertex along its normal by a random length of up to `noise`, as a scanner errs; those at the same place move alike, so that
    /// seams stay closed. Normals that the mesh has are dropped: they are no longer those of the surface.
    pub fn roughen(&mut self, noise: f64, seed: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (first, index) = merge_coincident(&self.vertices);
        let first = |vertex: usize| first[index[vertex] as usize];
        let normals = self.normals.take().unwrap_or_else(|| {
            let mut welded = self.clone();
            for face in &mut welded.faces {
                *face = face.map(|vertex| first(vertex as usize) as u32);
            }
            welded.vertex_normals()
        });
        for (x, normal) in self.vertices.iter_mut().zip(&normals) {
            let length = noise * rng.random_range(-1.0..=1.0);
            *x = std::array::from_fn(|i| length.mul_add(normal[i], x[i]));
        }
        let moved = self.vertices.clone();
        for (vertex, x) in self.vertices.iter_mut().enumerate() {
            *x = moved[first(vertex)];
        }
    }

    /// The unit normal of a face; zero for a face without area.
    pub fn face_normal(&self, face: [u32; 3]) -> [f64; 3] {
        let normal = scaled_normal(self.corners(face)).normalize_or_zero();
        normal.to_array()
    }

    /// The volume that a closed surface encloses, `1/6 sum a . (b x c)`.
    pub fn volume(&self) -> f64 {
        self.volume_behind(&self.faces)
    }

    /// Signed volume behind some of the faces.
    pub(crate) fn volume_behind<'a>(&self, faces: impl IntoIterator<Item = &'a [u32; 3]>) -> f64 {
        // From a point close by, so that far-away meshes do not lose digits.
        let origin = self.vertices.first().copied().unwrap_or_default();
        let origin = Vector::from_array(origin);
        let sixfold = faces.into_iter().map(|&face| {
            let [a, b, c] = self.corners(face).map(|x| x - origin);
            a.dot(b.cross(c))
        });
        sixfold.sum::<f64>() / 6.0
    }

    /// Outward unit normals of the vertices: the sums of the unit normals of the faces there, weighted by their angles; zero for
    /// a vertex of no face.
    pub fn vertex_normals(&self) -> Vec<[f64; 3]> {
        let sums = angle_weighted_normals(&self.points(), &self.faces);
        let unit = |sum: Vector| sum.normalize_or_zero().to_array();
        sums.into_iter().map(unit).collect()
    }

    /// Checks that all numbers are finite and at most `limit`, and all indices in range.
    ///
    /// # Errors
    /// [`Error::NonFiniteVertex`], [`Error::IndexOutOfRange`], [`Error::Normals`].
    pub fn check(&self, limit: f64) -> Result<(), Error> {
        let count = self.vertices.len();
        let representable = |x: &[f64; 3]| x.iter().all(|v| v.abs() <= limit);
        if let Some(vertex) = self.vertices.iter().position(|x| !representable(x)) {
            return Err(Error::NonFiniteVertex {
                vertex,
                position: self.vertices[vertex],
                limit,
            });
        }
        for (face, corners) in self.faces.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= count) {
                return Err(Error::IndexOutOfRange {
                    face,
                    vertex,
                    vertices: count,
                });
            }
        }
        if let Some(normals) = &self.normals {
            let finite = normals.iter().filter(|n| n.iter().all(|v| v.is_finite()));
            let finite = finite.count();
            if finite != count || normals.len() != count {
                return Err(Error::Normals {
                    normals: normals.len(),
                    finite,
                    vertices: count,
                });
            }
        }
        Ok(())
    }

    /// With vertices at exactly the same place as one, and without the faces that repeat a vertex then.
    pub(crate) fn merged(&self) -> Self {
        let (first, index) = merge_coincident(&self.vertices);
        let mut merged = self.reindexed(&first, |v| index[v as usize]);
        merged.faces.retain(has_three_corners);
        merged
    }

    /// Both meshes as one, the vertices and the faces of the other one behind those of this one. Normals are left out.
    pub fn beside(&self, other: &Self) -> Self {
        let mut both = self.clone();
        both.append(other);
        both
    }

    /// Adds what [`Self::beside`] puts behind.
    pub(crate) fn append(&mut self, other: &Self) {
        let first = self.vertices.len() as u32;
        let others = other.faces.iter().map(|face| face.map(|v| v + first));
        self.vertices.extend_from_slice(&other.vertices);
        self.faces.extend(others);
        self.normals = None;
    }

    /// Keeps the given vertices, among which are those of all faces.
    pub(crate) fn keeping(&self, kept: &[usize]) -> Self {
        let mut index = vec![0; self.vertices.len()];
        for (new, &old) in kept.iter().enumerate() {
            index[old] = new as u32;
        }
        self.reindexed(kept, |v| index[v as usize])
    }

    /// Keeps the given vertices and renumbers the corners; `corner` maps old indices to new ones.
    fn reindexed(&self, kept: &[usize], corner: impl Fn(u32) -> u32) -> Self {
        let keep = |values: &[[f64; 3]]| kept.iter().map(|&v| values[v]).collect();
        Self {
            vertices: keep(&self.vertices),
            faces: self.faces.iter().map(|f| f.map(&corner)).collect(),
            normals: self.normals.as_deref().map(keep),
        }
    }
}

/// Whether no vertex is repeated.
pub(crate) fn has_three_corners(&[a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// The coordinates as bits, by which equal positions are found.
pub(crate) fn key(x: [f64; 3]) -> [u64; 3] {
    // Adding zero turns -0 into 0.
    x.map(|v| (v + 0.0).to_bits())
}

/// Hashes the bits of coordinates, several times as fast as the hasher of the standard library.
pub type PlaceHasher = BuildHasherDefault<Mixed>;

/// The bits that were hashed, mixed by multiplications.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mixed(u64);

impl Hasher for Mixed {
    fn write(&mut self, bytes: &[u8]) {
        // The odd number next to 2^64 over the golden ratio.
        const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
        for part in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..part.len()].copy_from_slice(part);
            let mixed = self.0.rotate_left(29) ^ u64::from_le_bytes(word);
            self.0 = mixed.wrapping_mul(FACTOR);
        }
    }

    fn finish(&self) -> u64 {
        // A product's low bits are those of the factors alone.
        self.0 ^ (self.0 >> 32)
    }
}

/// For every distinct position (`-0` equals `0`) the first vertex there, and for every vertex the number of its position.
pub(crate) fn merge_coincident(vertices: &[[f64; 3]]) -> (Vec<usize>, Vec<u32>) {
    let mut known = HashMap::with_capacity_and_hasher(vertices.len(), PlaceHasher::default());
    let mut first = Vec::new();
    let index = vertices.iter().enumerate().map(|(vertex, x)| {
        *known.entry(key(*x)).or_insert_with(|| {
            first.push(vertex);
            first.len() as u32 - 1
        })
    });
    let index = index.collect();
    (first, index)
}

/// The angle of a triangle at a corner.
pub(crate) fn angle(triangle: &[Vector; 3], corner: usize) -> f64 {
    let [here, next, last] = [corner, corner + 1, corner + 2].map(|i| triangle[i % 3]);
    let (a, b) = (next - here, last - here);
    // That of the system's library takes several times as long.
    libm::atan2(a.cross(b).length(), a.dot(b))
}

/// Faces whose normals are kept at a time, in the cache.
const AT_ONCE: usize = 1 << 14;

/// For every vertex the sum of the unit normals of its faces, weighted by their angles there.
pub(crate) fn angle_weighted_normals(vertices: &[Vector], faces: &[[u32; 3]]) -> Vec<Vector> {
    let at_corners = |face: &[u32; 3]| {
        let triangle = face.map(|v| vertices[v as usize]);
        let normal = scaled_normal(triangle).normalize_or_zero();
        // The angles of a triangle add up to pi, which saves an arc tangent.
        let [first, second] = [0, 1].map(|corner| angle(&triangle, corner));
        [first, second, PI - first - second].map(|angle| normal * angle)
    };
    let mut normals = vec![Vector::ZERO; vertices.len()];
    let mut weighted = Vec::new();
    for faces in faces.chunks(AT_ONCE) {
        (faces.par_iter().map(at_corners)).collect_into_vec(&mut weighted);
        // One after the other, so that sums do not depend on the threads.
        for (face, at_corners) in faces.iter().zip(&weighted) {
            for (&vertex, normal) in face.iter().zip(at_corners) {
                normals[vertex as usize] += normal;
            }
        }
    }
    normals
}
