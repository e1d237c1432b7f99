//! Surfaces whose vertices stay within a distance of another surface.

use geometry::measure::BoundingBox;
use rayon::prelude::*;

use crate::vector::Vector;
use crate::{ClosedMesh, MeshDistance, TriangleMesh};

/// Rounds in which what the bound has taken is given back by the vertices that are not at the bound.
const ROUNDS: usize = 12;
/// A vertex moves by at most this part of the bound in a round, so that it does not come near another sheet.
const LONGEST: f64 = 0.5;
/// Vertices nearer to the bound than this part of it are at the bound.
const AT: f64 = 1e-6;
/// Distances are rounded by less than this part of them.
const ROUNDING: f64 = 1e-9;

/// A bound on the distance of vertices from a surface, or from the nearest of several.
#[derive(Clone, Debug)]
pub struct Bound {
    distances: Vec<(BoundingBox<3>, MeshDistance)>,
    length: f64,
}

impl Bound {
    /// Of this length, from the faces of a surface.
    pub fn new(surface: &ClosedMesh, length: f64) -> Self {
        Self::of_nearest([surface], length)
    }

    /// Of this length, from the faces of whichever surface is nearest.
    pub fn of_nearest<'a>(surfaces: impl IntoIterator<Item = &'a ClosedMesh>, length: f64) -> Self {
        let surfaces = surfaces.into_iter();
        let distances = surfaces.map(|s| (s.bounding_box(), MeshDistance::new(s)));
        Self {
            distances: distances.collect(),
            length,
        }
    }

    /// How far each vertex is.
    pub fn lengths(&self, mesh: &TriangleMesh) -> Vec<f64> {
        let offsets = self.offsets(&mesh.vertices);
        offsets.into_iter().map(Vector::length).collect()
    }

    /// For each vertex, whether it is at the bound or beyond it.
    pub fn reached(&self, mesh: &TriangleMesh) -> Vec<bool> {
        let least = (1.0 - AT) * self.length;
        let lengths = self.lengths(mesh).into_iter();
        lengths.map(|length| length >= least).collect()
    }

    /// The ways from the nearest point of the surfaces to each of many points.
    fn offsets(&self, points: &[[f64; 3]]) -> Vec<Vector> {
        let mut nearest = vec![Vector::INFINITY; points.len()];
        for (bounds, distance) in &self.distances {
            let [lower, upper] = [bounds.lower, bounds.upper].map(Vector::from_array);
            // Of a surface whose box is farther away than what is nearest so far, nothing is nearer.
            let is_candidate = |point: &usize| {
                let x = Vector::from_array(points[*point]);
                x.distance_squared(x.clamp(lower, upper)) < nearest[*point].length_squared()
            };
            let candidates: Vec<usize> = (0..points.len()).filter(is_candidate).collect();
            let places: Vec<[f64; 3]> = candidates.iter().map(|&point| points[point]).collect();
            for (point, offset) in candidates.into_iter().zip(distance.offsets(&places)) {
                let offset = Vector::from_array(offset);
                if offset.length_squared() < nearest[point].length_squared() {
                    nearest[point] = offset;
                }
            }
        }
        nearest
    }

    /// The mesh with vertices that are too far moved straight towards their nearest point on the surface, up to the bound.
    pub fn clamp(&self, mesh: &TriangleMesh) -> TriangleMesh {
        self.clamped(mesh).0
    }

    /// The same, and for each vertex whether it has moved.
    fn clamped(&self, mesh: &TriangleMesh) -> (TriangleMesh, Vec<bool>) {
        let offsets = self.offsets(&mesh.vertices);
        let clamped = mesh.vertices.par_iter().zip(offsets).map(|(&x, offset)| {
            let far = offset.length();
            // Those that were clamped before are not clamped again for the rounding.
            if far.is_finite() && far > (1.0 + ROUNDING) * self.length {
                let back = offset * (1.0 - self.length / far);
                ((Vector::from_array(x) - back).to_array(), true)
            } else {
                (x, false)
            }
        });
        let (vertices, have_moved) = clamped.unzip();
        let clamped = TriangleMesh {
            vertices,
            faces: mesh.faces.clone(),
            normals: mesh.normals.clone(),
        };
        (clamped, have_moved)
    }

    /// The mesh within the bound; `restored` gives back what the bound has taken, such as a volume: it moves vertices of a mesh, but only those of which
    /// its second argument is true, which are those that the bound has not stopped yet. A few rounds of both come as near to it as the bound allows. A mesh
    /// within the bound stays as it is.
    pub fn hold(
        &self,
        mesh: &TriangleMesh,
        restored: impl Fn(&TriangleMesh, &[bool]) -> TriangleMesh,
    ) -> TriangleMesh {
        let (mut held, have_moved) = self.clamped(mesh);
        if !have_moved.contains(&true) {
            return held;
        }
        let mut free = vec![true; mesh.vertices.len()];
        for _ in 0..ROUNDS {
            let wanted = restored(&held, &free);
            let ways = held.vertices.iter().zip(&wanted.vertices);
            let way = |(&from, &to)| Vector::from_array(to) - Vector::from_array(from);
            let ways: Vec<Vector> = ways.map(way).collect();
            let longest = LONGEST * self.length;
            let shortened = ways.iter().map(|way| way.clamp_length_max(longest));
            let moved = held.moved_by(&shortened.collect::<Vec<_>>());
            let (within, are_stopped) = self.clamped(&moved);
            held = within;
            if ways.iter().all(|way| way.length() <= longest) && !are_stopped.contains(&true) {
                break;
            }
            for (free, is_stopped) in free.iter_mut().zip(are_stopped) {
                *free &= !is_stopped;
            }
        }
        held.normals.clone_from(&mesh.normals);
        held
    }
}
