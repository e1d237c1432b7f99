//! Normals of vertices.

use crate::TriangleMesh;
use crate::vector::{Vector, scaled_normal};

impl TriangleMesh {
    /// The unit normal of a face; zero for a face without area.
    pub fn face_normal(&self, face: [u32; 3]) -> [f64; 3] {
        let normal = scaled_normal(self.corners(face)).normalize_or_zero();
        normal.to_array()
    }

    /// The volume that a closed surface encloses, `1/6 sum a . (b x c)`.
    pub fn volume(&self) -> f64 {
        crate::closed::volume(self, &self.faces)
    }

    /// Outward unit normals of the vertices: the sums of the unit normals of the faces there, weighted by their angles; zero for
    /// a vertex of no face.
    pub fn vertex_normals(&self) -> Vec<[f64; 3]> {
        let sums = angle_weighted_normals(&self.points(), &self.faces);
        let unit = |sum: Vector| sum.normalize_or_zero().to_array();
        sums.into_iter().map(unit).collect()
    }
}

/// For every vertex the sum of the unit normals of its faces, weighted by their angles there.
pub(crate) fn angle_weighted_normals(vertices: &[Vector], faces: &[[u32; 3]]) -> Vec<Vector> {
    let mut normals = vec![Vector::ZERO; vertices.len()];
    for face in faces {
        let triangle = face.map(|v| vertices[v as usize]);
        let normal = scaled_normal(triangle).normalize_or_zero();
        for i in 0..3 {
            let [here, next, last] = [i, i + 1, i + 2].map(|i| triangle[i % 3]);
            let (a, b) = (next - here, last - here);
            let angle = a.cross(b).length().atan2(a.dot(b));
            normals[face[i] as usize] += normal * angle;
        }
    }
    normals
}
