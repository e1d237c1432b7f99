//! The exact signed distance to a closed mesh.

use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;

use geometry::{Bricks, Field, Grid, Nodes, PhaseField, SignedDistance, Stored, is_thin};
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
    /// The faces of the mesh that they are.
    order: Vec<usize>,
    /// Sums of the unit normals of all faces there, weighted by their angles at vertices.
    vertex_normals: Vec<Vector>,
    edge_normals: HashMap<Edge, Vector>,
    /// A power of two that makes the longest side of the bounding box about one: the scaling is
    /// exact, and products of coordinates neither overflow nor underflow.
    scale: f64,
}

/// Nodes along a side of the bricks for which it is asked first whether they are far away.
const SIDE: usize = 8;

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
            order,
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
    pub fn sample(&self, grid: Grid<3>, layer_done: &(dyn Fn() + Sync)) -> Result<Field<3>, Error> {
        let cells = grid.cells();
        let mut values = vec![0.0; grid.len()];
        let layers = values.par_chunks_mut(cells * cells).enumerate();
        layers.for_each(|(i, layer)| {
            let mut start = None;
            for (j, row) in layer.chunks_mut(cells).enumerate() {
                start = self.sample_row(&grid, [i, j, 0], start, row);
            }
            layer_done();
        });
        Ok(Field::from_values(grid, values)?)
    }

    /// The same, but distances are cut off beyond `reach`, on either side, and where nothing is nearer than that, nothing is searched for or
    /// stored, unless the bricks of this do not fit the grid. `part_done` is called at most as often as there are layers.
    ///
    /// # Errors
    /// As [`Self::sample`].
    pub fn sample_within(
        &self,
        reach: f64,
        grid: Grid<3>,
        part_done: &(dyn Fn() + Sync),
    ) -> Result<Stored<3>, Error> {
        match self.bricks_within(reach, &grid) {
            Some(bricks) => self.sample_bricks(bricks, grid, reach, part_done),
            None => {
                let all = self.sample(grid, part_done)?;
                Ok(Stored::whole(all.map(|s| s.clamp(-reach, reach))))
            }
        }
    }

    /// As [`Self::sample_within`], for callers that need only distances below `near`. If the bricks with such distances are less than half of the
    /// grid, only they are searched and stored. All other nodes have the distance `reach` outside and `-reach` inside. Both are lengths of the grid.
    ///
    /// # Errors
    /// As [`Self::sample`].
    pub fn sample_near(
        &self,
        near: f64,
        reach: f64,
        grid: Grid<3>,
        part_done: &(dyn Fn() + Sync),
    ) -> Result<Stored<3>, Error> {
        match self.bricks_within(near, &grid) {
            Some(bricks) if 2 * bricks.len() < grid.len() => {
                self.sample_bricks(bricks, grid, reach, part_done)
            }
            _ => self.sample_within(reach, grid, part_done),
        }
    }

    /// The distances in bricks, cut off beyond `reach`.
    fn sample_bricks(
        &self,
        bricks: Bricks<3>,
        grid: Grid<3>,
        reach: f64,
        part_done: &(dyn Fn() + Sync),
    ) -> Result<Stored<3>, Error> {
        let mut values = vec![0.0; bricks.len()];
        let part = bricks.places().len().div_ceil(grid.cells()).max(1) * bricks.volume();
        let parts = values.par_chunks_mut(part).enumerate();
        parts.for_each(|(number, values)| {
            let mut start = None;
            for (row, values) in values.chunks_mut(SIDE).enumerate() {
                let cell = number * part + row * SIDE;
                start = self.sample_row(&grid, bricks.multi_index(cell), start, values);
                for value in values {
                    *value = value.clamp(-reach, reach);
                }
            }
            part_done();
        });
        let nodes = Nodes::on_bricks(grid, Arc::new(bricks));
        let stored = Stored::new(values, nodes, [reach, -reach]);
        stored.check_finite()?;
        Ok(stored)
    }

    /// The distances of nodes in a row from a place on, and the face nearest to the first of them.
    fn sample_row(
        &self,
        grid: &Grid<3>,
        [i, j, first]: [usize; 3],
        near_start: Option<usize>,
        row: &mut [f64],
    ) -> Option<usize> {
        let [x, y] = [grid.coordinate(0, i), grid.coordinate(1, j)];
        let (mut near, mut start) = (near_start, None);
        for (k, value) in row.iter_mut().enumerate() {
            let node = Vector::new(x, y, grid.coordinate(2, first + k));
            (*value, near) = self.distance_near(node, near);
            if k == 0 {
                start = near;
            }
        }
        start
    }

    /// The bricks of which not all is further away than `reach`, if they fit the grid.
    fn bricks_within(&self, reach: f64, grid: &Grid<3>) -> Option<Bricks<3>> {
        let per_axis = grid.cells() / SIDE;
        let to_centre = 0.5 * (SIDE - 1) as f64 * grid.spacing();
        let flat = |[i, j, k]: [usize; 3]| (i * per_axis + j) * per_axis + k;
        let at = |brick: usize, axis: usize| {
            let place = brick / per_axis.pow(2 - axis as u32) % per_axis;
            grid.coordinate(axis, place * SIDE) + to_centre
        };
        let distance = |brick: usize| {
            let centre = Vector::new(at(brick, 0), at(brick, 1), at(brick, 2));
            self.distance_near(centre, None).0
        };
        let distances = (0..per_axis.pow(3)).into_par_iter().map(distance);
        let distances: Vec<f64> = distances.collect();
        let far = reach + 3.0_f64.sqrt() * to_centre;
        // Not where it is NaN, which is to be seen.
        let is_far = |place| distances[flat(place)].abs() > far;
        Bricks::new(
            grid.cells(),
            SIDE,
            |place| !is_far(place),
            |place| distances[flat(place)] < 0.0,
        )
        .ok()
    }

    /// The nearest face of the mesh to each of many points, in parallel; of several the same one as for the distance.
    ///
    /// # Panics
    /// Points so far away that squares of distances overflow.
    pub fn nearest_faces(&self, points: &[[f64; 3]]) -> Vec<usize> {
        let nearest = |&x: &[f64; 3]| {
            let (_, face) = self.distance_near(Vector::from_array(x), None);
            self.order[face.expect("a face is nearest")]
        };
        points.par_iter().map(nearest).collect()
    }

    /// The ways from the nearest point of the mesh to each of many points, in parallel; of NaN for points so far away that squares of distances
    /// overflow.
    pub fn offsets(&self, points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let offset = |&x: &[f64; 3]| {
            let nearest = (self.hierarchy).nearest(Vector::from_array(x) * self.scale, None);
            nearest.map_or([f64::NAN; 3], |n| (n.offset / self.scale).to_array())
        };
        points.par_iter().map(offset).collect()
    }

    /// The distances of many points, in parallel.
    pub fn signed_distances(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let points = points.par_iter();
        points.map(|&x| self.signed_distance(x)).collect()
    }

    /// Whether the body, or the gap before it, is thinner than `width` at a point of the mesh with this outward normal. The face nearest to one place
    /// bounds the search for the next one's.
    pub(crate) fn is_thin(&self, x: [f64; 3], normal: [f64; 3], width: f64) -> bool {
        let near = Cell::new(None);
        let distance = |x: [f64; 3]| {
            let (distance, nearest) = self.distance_near(Vector::from_array(x), near.get());
            near.set(nearest);
            distance
        };
        is_thin(distance, x, normal, width)
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
