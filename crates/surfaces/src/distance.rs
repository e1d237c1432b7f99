//! The exact signed distance to a closed mesh.

use std::collections::HashMap;

use geometry::{Field, Grid, SignedDistance};
use rayon::prelude::*;

use crate::hierarchy::{Hierarchy, Nearest};
use crate::mesh::{angle_weighted_normals, merge_coincident};
use crate::triangle::Part;
use crate::vector::{Vector, scaled_normal};
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
    hierarchy: Hierarchy,
    /// The vertices of the triangles of the hierarchy.
    faces: Vec<[u32; 3]>,
    /// Sums of the unit normals of all faces there, weighted by their angles at vertices.
    vertex_normals: Vec<Vector>,
    edge_normals: HashMap<Edge, Vector>,
    /// A power of two that makes the longest side of the bounding box about one: the scaling is
    /// exact, and products of coordinates neither overflow nor underflow.
    scale: f64,
}

/// Nodes along a side of the blocks for which it is asked first whether they are far away.
const BLOCK: usize = 8;

/// Two vertices in ascending order.
type Edge = [u32; 2];

impl MeshDistance {
    /// Builds the hierarchy.
    pub fn new(mesh: &ClosedMesh) -> Self {
        let exponent = mesh.bounding_box().longest_side().log2().floor();
        let scale = (-exponent).clamp(-1000.0, 1000.0).exp2();
        let mesh = mesh.mesh();
        // Where sheets touch in a vertex, the pseudo-normal is the sum over all of them.
        let (first, index) = merge_coincident(&mesh.vertices);
        let vertices = first.iter().map(|&v| mesh.vertices[v]);
        let vertices: Vec<_> = vertices.map(|x| Vector::from_array(x) * scale).collect();
        let faces = mesh.faces.iter();
        let faces: Vec<_> = faces.map(|f| f.map(|v| index[v as usize])).collect();
        let triangles: Vec<_> = faces
            .iter()
            .map(|f| f.map(|v| vertices[v as usize]))
            .collect();
        let vertex_normals = angle_weighted_normals(&vertices, &faces);
        let mut edge_normals = HashMap::with_capacity(3 * faces.len() / 2);
        for (face, triangle) in faces.iter().zip(&triangles) {
            let normal = scaled_normal(*triangle).normalize_or_zero();
            for i in 0..3 {
                *edge_normals.entry(edge(face, i)).or_default() += normal;
            }
        }
        let (hierarchy, order) = Hierarchy::new(&triangles);
        Self {
            hierarchy,
            faces: order.iter().map(|&f| faces[f]).collect(),
            vertex_normals,
            edge_normals,
            scale,
        }
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
        self.sample_within(f64::INFINITY, grid, layer_done)
    }

    /// The same, but distances are cut off beyond `reach`, on either side: where nothing is nearer than that, nothing is searched for.
    ///
    /// # Errors
    /// As [`Self::sample`].
    pub fn sample_within(
        &self,
        reach: f64,
        grid: Grid<3>,
        layer_done: impl Fn() + Sync,
    ) -> Result<Field<3>, Error> {
        let cells = grid.cells();
        let blocks = cells.div_ceil(BLOCK);
        let far = self.far_blocks(reach, &grid);
        let mut values = vec![0.0; grid.len()];
        values
            .par_chunks_mut(cells * cells)
            .enumerate()
            .for_each(|(i, layer)| {
                let x = grid.coordinate(0, i);
                let mut row_start = None;
                for (j, row) in layer.chunks_mut(cells).enumerate() {
                    let y = grid.coordinate(1, j);
                    let far = &far[(i / BLOCK * blocks + j / BLOCK) * blocks..][..blocks];
                    let mut near = row_start;
                    for (k, value) in row.iter_mut().enumerate() {
                        if let Some(distance) = far[k / BLOCK] {
                            *value = distance;
                            continue;
                        }
                        let node = Vector::new(x, y, grid.coordinate(2, k));
                        (*value, near) = self.distance_near(node, near);
                        *value = value.clamp(-reach, reach);
                        if k == 0 {
                            row_start = near;
                        }
                    }
                }
                layer_done();
            });
        Ok(Field::from_values(grid, values)?)
    }

    /// The distances of many points, in parallel.
    pub fn signed_distances(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let points = points.par_iter();
        points.map(|&x| self.signed_distance(x)).collect()
    }

    /// For every block of `BLOCK^3` nodes, `reach` with its sign if all of the block is further away.
    fn far_blocks(&self, reach: f64, grid: &Grid<3>) -> Vec<Option<f64>> {
        let blocks = grid.cells().div_ceil(BLOCK);
        if reach.is_infinite() {
            return vec![None; blocks.pow(3)];
        }
        let to_centre = 0.5 * (BLOCK - 1) as f64 * grid.spacing();
        let far = |block: usize| {
            let place = [
                block / (blocks * blocks),
                block / blocks % blocks,
                block % blocks,
            ];
            let at = |axis: usize| grid.coordinate(axis, place[axis] * BLOCK) + to_centre;
            let centre = Vector::new(at(0), at(1), at(2));
            let (distance, _) = self.distance_near(centre, None);
            (distance.abs() > reach + 3.0_f64.sqrt() * to_centre)
                .then_some(reach.copysign(distance))
        };
        (0..blocks.pow(3)).into_par_iter().map(far).collect()
    }

    /// The signed distance of `x`, and the nearest face; NaN if there is none. A face that is not
    /// far from the nearest one speeds up the search.
    fn distance_near(&self, x: Vector, near: Option<usize>) -> (f64, Option<usize>) {
        let x = x * self.scale;
        let guess = near.map(|face| self.hierarchy.project(x, face));
        match self.hierarchy.nearest(x, guess) {
            Some(nearest) => {
                let distance = nearest.squared_distance.sqrt() / self.scale;
                let inside = nearest.offset.dot(self.pseudo_normal(&nearest)) < 0.0;
                let signed = if inside { -distance } else { distance };
                (signed, Some(nearest.triangle))
            }
            None => (f64::NAN, None),
        }
    }

    /// Points outwards at the nearest point; of any length.
    fn pseudo_normal(&self, nearest: &Nearest) -> Vector {
        let face = &self.faces[nearest.triangle];
        match nearest.part {
            Part::Corner(i) => self.vertex_normals[face[i] as usize],
            Part::Edge(i) => self.edge_normals[&edge(face, i)],
            Part::Inside => scaled_normal(self.hierarchy.triangles[nearest.triangle]),
        }
    }
}

/// Edge `i` of a face, from corner `i` to the next.
fn edge(face: &[u32; 3], i: usize) -> Edge {
    let (a, b) = (face[i], face[(i + 1) % 3]);
    [a.min(b), a.max(b)]
}

impl SignedDistance<3> for MeshDistance {
    fn signed_distance(&self, x: [f64; 3]) -> f64 {
        self.distance_near(Vector::from_array(x), None).0
    }
}

/// The Hausdorff distance of two meshes at their vertices: how far the farthest vertex of one is from the faces of the other.
pub fn hausdorff_distance(a: &ClosedMesh, b: &ClosedMesh) -> f64 {
    let farthest = |points: &ClosedMesh, from: &ClosedMesh| {
        let distances = MeshDistance::new(from).signed_distances(&points.mesh().vertices);
        distances.into_iter().map(f64::abs).fold(0.0, f64::max)
    };
    farthest(a, b).max(farthest(b, a))
}
