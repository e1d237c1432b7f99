//! The exact signed distance to a closed mesh.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use geometry::{Bricks, Field, Grid, Nodes, PhaseField, SignedDistance, Stored, is_thin};
use rayon::prelude::*;

use crate::hierarchy::{Hierarchy, Nearest, ROW, RowSearch};
use crate::mesh::{angle, merge_coincident};
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
    /// Where the triangles around each vertex begin, and the end of all. Where sheets touch in a vertex, they are those of all of them.
    starts: Vec<u32>,
    around: Vec<u32>,
    /// A power of two that makes the longest side of the bounding box about one: the scaling is
    /// exact, and products of coordinates neither overflow nor underflow.
    scale: f64,
}

/// Nodes along a side of the bricks for which it is asked first whether they are far away.
const SIDE: usize = ROW;

impl MeshDistance {
    /// Builds the hierarchy.
    pub fn new(mesh: &ClosedMesh) -> Self {
        let exponent = mesh.bounding_box().longest_side().log2().floor();
        let scale = (-exponent).clamp(-1000.0, 1000.0).exp2();
        let mesh = mesh.mesh();
        let (first, index) = merge_coincident(&mesh.vertices);
        let vertices = first.iter().map(|&v| mesh.vertices[v]);
        let vertices: Vec<_> = vertices.map(|x| Vector::from_array(x) * scale).collect();
        let faces = mesh.faces.iter();
        let faces: Vec<_> = faces.map(|f| f.map(|v| index[v as usize])).collect();
        let triangles: Vec<_> = faces
            .iter()
            .map(|f| f.map(|v| vertices[v as usize]))
            .collect();
        let (hierarchy, order) = Hierarchy::new(&triangles);
        let (starts, around) = around(vertices.len(), &faces, &order);
        Self {
            hierarchy,
            faces: order.iter().map(|&f| faces[f]).collect(),
            order,
            starts,
            around,
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
            let mut near = [None; ROW];
            for (j, row) in layer.chunks_mut(cells).enumerate() {
                for (piece, values) in row.chunks_mut(ROW).enumerate() {
                    near = self.sample_row(&grid, [i, j, piece * ROW], near, values);
                }
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
            let mut near = [None; ROW];
            for (row, values) in values.chunks_mut(SIDE).enumerate() {
                let cell = number * part + row * SIDE;
                near = self.sample_row(&grid, bricks.multi_index(cell), near, values);
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

    /// The distances of a few nodes in a row from a place on, and the faces nearest to them. Faces that are not far from these speed up the search.
    fn sample_row(
        &self,
        grid: &Grid<3>,
        [i, j, first]: [usize; 3],
        near: [Option<usize>; ROW],
        values: &mut [f64],
    ) -> [Option<usize>; ROW] {
        let at = |axis: usize, node: usize| self.scale * grid.coordinate(axis, node);
        let z = std::array::from_fn(|k| at(2, first + k.min(values.len() - 1)));
        let nearest = RowSearch::nearest(&self.hierarchy, [at(0, i), at(1, j)], z, near);
        for (value, nearest) in values.iter_mut().zip(&nearest) {
            *value = nearest.map_or(f64::NAN, |nearest| self.signed(&nearest));
        }
        nearest.map(|nearest| nearest.map(|nearest| nearest.triangle))
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
            Some(nearest) => (self.signed(&nearest), Some(nearest.triangle)),
            None => (f64::NAN, None),
        }
    }

    /// The signed distance of a point from the nearest one.
    fn signed(&self, nearest: &Nearest) -> f64 {
        let distance = nearest.squared_distance.sqrt() / self.scale;
        let is_inside = nearest.offset.dot(self.pseudo_normal(nearest)) < 0.0;
        if is_inside { -distance } else { distance }
    }

    /// Points outwards at the nearest point, of any length: the sum of the unit normals of all triangles there, at a vertex weighted by their angles.
    fn pseudo_normal(&self, nearest: &Nearest) -> Vector {
        let face = &self.faces[nearest.triangle];
        match nearest.part {
            Part::Corner(i) => self.sum_around(face[i], |triangle| {
                let corner = self.corner(triangle, face[i])?;
                Some(angle(&self.hierarchy.triangles[triangle], corner))
            }),
            Part::Edge(i) => self.sum_around(face[i], |triangle| {
                self.corner(triangle, face[(i + 1) % 3]).map(|_| 1.0)
            }),
            Part::Inside => scaled_normal(self.hierarchy.triangles[nearest.triangle]),
        }
    }

    /// Which corner of a triangle a vertex is, if it is one.
    fn corner(&self, triangle: usize, vertex: u32) -> Option<usize> {
        self.faces[triangle].iter().position(|&v| v == vertex)
    }

    /// The sum of the unit normals around a vertex, of those triangles that have a weight.
    fn sum_around(&self, vertex: u32, weight: impl Fn(usize) -> Option<f64>) -> Vector {
        let vertex = vertex as usize;
        let around = &self.around[self.starts[vertex] as usize..self.starts[vertex + 1] as usize];
        let normals = around.iter().filter_map(|&triangle| {
            let triangle = triangle as usize;
            let normal = scaled_normal(self.hierarchy.triangles[triangle]).normalize_or_zero();
            Some(normal * weight(triangle)?)
        });
        normals.sum()
    }

    /// The largest distance of points from the surface, of those that have a distance. `beside` has a vertex of the surface for each point, near which
    /// it may be: what is no farther from that than another point from the surface is not looked for.
    fn largest(&self, points: &[[f64; 3]], beside: Option<&[[f64; 3]]>) -> f64 {
        let at = |x: &[f64; 3]| Vector::from_array(*x) * self.scale;
        let bound = |point: usize| {
            beside.map_or(f64::INFINITY, |beside| {
                at(&points[point]).distance_squared(at(&beside[point]))
            })
        };
        // Numbers that are not negative are in the order of their bits.
        let largest = AtomicU64::new(0);
        let look = |point: usize| {
            let (x, known) = (
                at(&points[point]),
                f64::from_bits(largest.load(Ordering::Relaxed)),
            );
            if bound(point) <= known || self.hierarchy.is_within(x, known) {
                return;
            }
            if let Some(nearest) = self.hierarchy.nearest(x, None) {
                largest.fetch_max(nearest.squared_distance.to_bits(), Ordering::Relaxed);
            }
        };
        let all = 0..points.len();
        // One that has gone far spares most of the others.
        if let Some(far) = all.clone().max_by(|a, b| bound(*a).total_cmp(&bound(*b))) {
            look(far);
        }
        all.into_par_iter().for_each(look);
        f64::from_bits(largest.into_inner()).sqrt() / self.scale
    }
}

/// For each vertex where its triangles begin, and the end of all, and these triangles: their places in an order, in the order of the faces.
fn around(vertices: usize, faces: &[[u32; 3]], order: &[usize]) -> (Vec<u32>, Vec<u32>) {
    let mut places = vec![0; faces.len()];
    for (place, &face) in (0..).zip(order) {
        places[face] = place;
    }
    let mut starts = vec![0; vertices + 1];
    for &vertex in faces.as_flattened() {
        starts[vertex as usize + 1] += 1;
    }
    for vertex in 1..starts.len() {
        starts[vertex] += starts[vertex - 1];
    }
    let (mut next, mut around) = (starts.clone(), vec![0; 3 * faces.len()]);
    for (face, place) in faces.iter().zip(places) {
        for &vertex in face {
            let next = &mut next[vertex as usize];
            around[*next as usize] = place;
            *next += 1;
        }
    }
    (starts, around)
}

impl SignedDistance<3> for MeshDistance {
    fn signed_distance(&self, x: [f64; 3]) -> f64 {
        self.distance_near(Vector::from_array(x), None).0
    }
}

/// The Hausdorff distance of two meshes at their vertices: how far the farthest vertex of one is from the faces of the other.
pub fn hausdorff_distance(a: &ClosedMesh, b: &ClosedMesh) -> f64 {
    let farthest = |points: &ClosedMesh, from: &ClosedMesh| {
        let [points, beside] = [points, from].map(|mesh| &*mesh.mesh().vertices);
        // Two states of one mesh have their vertices in the same order.
        let beside = (points.len() == beside.len()).then_some(beside);
        MeshDistance::new(from).largest(points, beside)
    };
    farthest(a, b).max(farthest(b, a))
}
