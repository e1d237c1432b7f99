//! The exact signed distance to a closed mesh.

use geometry::{Field, Grid, SignedDistance};
use parry3d_f64::partitioning::{BvhLeafCost, BvhNode};
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::{TriMesh, TriMeshFlags, TrianglePointLocation};
use rayon::prelude::*;

use crate::mesh::merge_coincident;
use crate::vector::Vector;
use crate::{ClosedMesh, Error};

/// The signed distance to a closed mesh: negative inside, exact to a few units in the last place
/// of the coordinates.
///
/// The nearest point is found in a hierarchy of bounding boxes. Its sign is that of the scalar
/// product with the angle-weighted pseudo-normal there, which is right on faces, edges and corners
/// alike: J. A. Bærentzen, H. Aanæs: Signed distance computation using the angle weighted
/// pseudonormal. IEEE Trans. Vis. Comput. Graph. 11 (2005).
#[derive(Clone, Debug)]
pub struct MeshDistance {
    /// In coordinates times `scale`.
    mesh: TriMesh,
    /// A power of two that makes the longest side of the bounding box about one: the scaling is
    /// exact, and products of coordinates neither overflow nor underflow.
    scale: f64,
}

impl MeshDistance {
    /// Builds the hierarchy.
    pub fn new(mesh: &ClosedMesh) -> Self {
        let exponent = mesh.bounding_box().longest_side().log2().floor();
        let scale = (-exponent).clamp(-1000.0, 1000.0).exp2();
        let mesh = mesh.mesh();
        // Where sheets touch in a vertex, the pseudo-normal is the sum over all of them.
        let merged = merge_coincident(&mesh.vertices);
        let vertices = merged.first.iter().map(|&v| mesh.vertices[v]);
        let vertices = vertices.map(|x| Vector::from_array(x) * scale).collect();
        let faces = mesh
            .faces
            .iter()
            .map(|f| f.map(|v| merged.index[v as usize]));
        let mesh = TriMesh::with_flags(vertices, faces.collect(), TriMeshFlags::ORIENTED)
            .expect("a closed mesh has faces");
        Self { mesh, scale }
    }

    /// Samples the distance at the nodes of a grid, in parallel over layers of the first axis;
    /// `layer_done` is called after each of them, from any thread.
    ///
    /// The values do not depend on the number of threads. They agree with
    /// [`MeshDistance::signed_distance`](SignedDistance::signed_distance) to rounding, and come
    /// faster: the nearest face of a node bounds the search for the next node's.
    ///
    /// # Errors
    /// [`geometry::Error::NonFinite`] for nodes so far away that squares of distances overflow.
    pub fn sample(&self, grid: Grid<3>, layer_done: impl Fn() + Sync) -> Result<Field<3>, Error> {
        let cells = grid.cells();
        let mut values = vec![0.0; grid.len()];
        values
            .par_chunks_mut(cells * cells)
            .enumerate()
            .for_each(|(i, layer)| {
                let x = grid.coordinate(0, i);
                let mut row_start = None;
                for (j, row) in layer.chunks_mut(cells).enumerate() {
                    let y = grid.coordinate(1, j);
                    let mut near = row_start;
                    for (k, value) in row.iter_mut().enumerate() {
                        let node = Vector::new(x, y, grid.coordinate(2, k));
                        (*value, near) = self.distance_near(node, near);
                        if k == 0 {
                            row_start = near;
                        }
                    }
                }
                layer_done();
            });
        Ok(Field::from_values(grid, values)?)
    }

    /// The signed distance of `x`, and the nearest face; NaN if there is none. A face that is not
    /// far from the nearest one speeds up the search.
    fn distance_near(&self, x: Vector, near: Option<u32>) -> (f64, Option<u32>) {
        let x = x * self.scale;
        let guess = near.map(|face| self.project(x, face));
        let bound = guess.as_ref().map_or(f64::MAX, |g| g.squared_distance);
        let nearer = self.mesh.bvh().find_best(
            bound,
            |node, _| squared_distance_to_box(x, node),
            |face, _| Some(self.project(x, face)),
        );
        match nearer.map(|(_, nearest)| nearest).or(guess) {
            Some(nearest) => {
                let distance = nearest.squared_distance.sqrt() / self.scale;
                let inside = nearest.offset.dot(self.pseudo_normal(&nearest)) < 0.0;
                let signed = if inside { -distance } else { distance };
                (signed, Some(nearest.face))
            }
            None => (f64::NAN, None),
        }
    }

    fn project(&self, x: Vector, face: u32) -> Nearest {
        let triangle = self.mesh.triangle(face);
        let (projection, location) = triangle.project_local_point_and_get_location(x, false);
        let offset = x - projection.point;
        Nearest {
            face,
            location,
            offset,
            squared_distance: offset.length_squared(),
        }
    }

    /// Points outwards at the nearest point; of any length.
    fn pseudo_normal(&self, nearest: &Nearest) -> Vector {
        let normals = self.mesh.pseudo_normals().expect("the mesh is oriented");
        let face = nearest.face as usize;
        match nearest.location {
            TrianglePointLocation::OnVertex(corner) => {
                let vertex = self.mesh.indices()[face][corner as usize];
                normals.vertices_pseudo_normal[vertex as usize]
            }
            TrianglePointLocation::OnEdge(edge, _) => {
                normals.edges_pseudo_normal[face][edge as usize]
            }
            TrianglePointLocation::OnFace(..) | TrianglePointLocation::OnSolid => {
                self.mesh.triangle(nearest.face).scaled_normal()
            }
        }
    }
}

impl SignedDistance<3> for MeshDistance {
    fn signed_distance(&self, x: [f64; 3]) -> f64 {
        self.distance_near(Vector::from_array(x), None).0
    }
}

/// The point of a face nearest to `x`.
struct Nearest {
    face: u32,
    location: TrianglePointLocation,
    /// From the point to `x`.
    offset: Vector,
    squared_distance: f64,
}

impl BvhLeafCost for Nearest {
    fn cost(&self) -> f64 {
        self.squared_distance
    }
}

fn squared_distance_to_box(x: Vector, node: &BvhNode) -> f64 {
    let outside = (node.mins() - x).max(x - node.maxs()).max(Vector::ZERO);
    outside.length_squared()
}
