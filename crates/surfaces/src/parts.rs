//! The parts of a closed surface, and their volumes.

use crate::closed::drop_unreferenced;
use crate::half_edges::HalfEdges;
use crate::vector::Vector;
use crate::{ClosedMesh, TriangleMesh};

/// Newton steps to a volume, which is a polynomial of third degree in the length, nearly linear.
const STEPS: usize = 4;

/// The components of a closed surface: the outer surfaces of bodies, and the walls of their cavities. The volume of a wall is negative.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    of_face: Vec<u32>,
    of_vertex: Vec<u32>,
    count: usize,
}

impl ClosedMesh {
    /// The components in the order of their first faces. A vertex that components share belongs to the last one.
    pub fn parts(&self) -> Parts {
        let surface = HalfEdges::new(self.mesh()).expect("the mesh is closed");
        let (of_face, count) = surface.components();
        let mut of_vertex = vec![0; self.mesh().vertices.len()];
        for (face, &part) in self.mesh().faces.iter().zip(&of_face) {
            for &vertex in face {
                of_vertex[vertex as usize] = part;
            }
        }
        Parts {
            of_face,
            of_vertex,
            count,
        }
    }
}

impl Parts {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The part of every vertex.
    pub fn of_vertices(&self) -> &[u32] {
        &self.of_vertex
    }

    /// The part of every face.
    pub fn of_faces(&self) -> &[u32] {
        &self.of_face
    }

    /// The sum of what `of_face` says of the corners of each face, for every part.
    fn sums(
        &self,
        mesh: &TriangleMesh,
        of_face: impl Fn([u32; 3], [Vector; 3]) -> Vector,
    ) -> Vec<Vector> {
        // From a point close by, so that far-away meshes do not lose digits.
        let origin = origin(mesh);
        let mut sums = vec![Vector::ZERO; self.count];
        for (&face, &part) in mesh.faces.iter().zip(&self.of_face) {
            sums[part as usize] += of_face(face, mesh.corners(face).map(|x| x - origin));
        }
        sums
    }

    /// The volume that each part encloses. `mesh` has the faces of the surface.
    pub fn volumes(&self, mesh: &TriangleMesh) -> Vec<f64> {
        let sixfold = self.sums(mesh, |_, [a, b, c]| {
            Vector::new(a.dot(b.cross(c)), 0.0, 0.0)
        });
        sixfold.into_iter().map(|sum| sum.x / 6.0).collect()
    }

    /// The centre of mass of what each part encloses.
    pub fn centroids(&self, mesh: &TriangleMesh) -> Vec<[f64; 3]> {
        let moments = self.sums(mesh, |_, [a, b, c]| a.dot(b.cross(c)) * (a + b + c) / 24.0);
        let pairs = moments.into_iter().zip(self.volumes(mesh));
        let centre = |(moment, volume): (Vector, f64)| origin(mesh) + moment / volume;
        pairs.map(|pair| centre(pair).to_array()).collect()
    }

    /// The mesh with the faces of some parts alone.
    pub fn only(&self, mesh: &TriangleMesh, is_meant: impl Fn(usize) -> bool) -> TriangleMesh {
        let faces = mesh.faces.iter().zip(&self.of_face);
        let faces = faces.filter(|(_, part)| is_meant(**part as usize));
        let mut some = TriangleMesh {
            faces: faces.map(|(face, _)| *face).collect(),
            ..mesh.clone()
        };
        drop_unreferenced(&mut some);
        some
    }
}

fn origin(mesh: &TriangleMesh) -> Vector {
    Vector::from_array(mesh.vertices.first().copied().unwrap_or_default())
}

impl TriangleMesh {
    /// The vertices of each part moved along their normals by a length of the part, so that it encloses its volume.
    pub fn with_volumes(&self, parts: &Parts, volumes: &[f64]) -> Self {
        self.with_volumes_by(parts, volumes, |_| true)
    }

    /// The same by those vertices alone that may move.
    pub fn with_volumes_by(
        &self,
        parts: &Parts,
        volumes: &[f64],
        moves: impl Fn(usize) -> bool,
    ) -> Self {
        let mut moved = self.clone();
        for _ in 0..STEPS {
            moved = moved.towards_volumes(parts, volumes, &moves);
        }
        Self {
            normals: self.normals.clone(),
            ..moved
        }
    }

    /// One step of Newton's method.
    pub(crate) fn towards_volumes(
        &self,
        parts: &Parts,
        volumes: &[f64],
        moves: impl Fn(usize) -> bool,
    ) -> Self {
        let normals = self.moving_normals(moves);
        let derivatives = parts.sums(self, |face, [a, b, c]| {
            let [u, v, w] = face.map(|vertex| normals[vertex as usize]);
            let sixfold = u.dot(b.cross(c)) + v.dot(c.cross(a)) + w.dot(a.cross(b));
            Vector::new(sixfold / 6.0, 0.0, 0.0)
        });
        let now = parts.volumes(self).into_iter().zip(volumes);
        let lengths = now.zip(derivatives).map(|((now, wanted), derivative)| {
            if derivative.x == 0.0 {
                0.0
            } else {
                (wanted - now) / derivative.x
            }
        });
        let lengths: Vec<f64> = lengths.collect();
        let moves = normals.into_iter().zip(&parts.of_vertex);
        let moves = moves.map(|(normal, &part)| lengths[part as usize] * normal);
        self.moved_by(&moves.collect::<Vec<_>>())
    }
}
