//! Surfaces of several labels at once, with walls that two labels share.

mod junctions;
mod marching;
mod volumes;
mod write;

use rayon::prelude::*;

use crate::closed::drop_unreferenced;
use crate::vector::Vector;
use crate::{Bound, TriangleMesh};

pub use marching::LabelLattice;

/// The number of the background among the labels.
pub const BACKGROUND: u32 = 0;

/// In a round a vertex moves by this part of the way to the middle of its neighbours.
const RELAXED: f64 = 0.7;
/// Newton steps that take a vertex back to its wall in a round, and in the end.
const STEPS: usize = 1;
const LAST_STEPS: usize = 6;
/// Differences of distances have gradients of length two where walls are smooth; one below this points nowhere.
const FLAT: f64 = 0.1;

/// By how much a point is deeper in the first of two labels than in the second, and the gradient of this.
pub type DepthDifference<'a> = dyn Fn([u32; 2], [f64; 3]) -> (f64, [f64; 3]) + Sync + 'a;

/// The walls between labels, as one mesh: every point of space belongs to one label, and a wall is there once, with a label on either side.
/// Labels are counted from 0, which is the [`BACKGROUND`].
#[must_use]
#[derive(Clone, Debug)]
pub struct LabelMesh {
    /// The triangles. Their normals point from the first label of their sides to the second.
    pub mesh: TriangleMesh,
    /// For every face the labels behind it and ahead of it. The background is ahead of all walls that it has; of others the smaller number is
    /// behind.
    pub sides: Vec<[u32; 2]>,
    /// For every vertex the labels that meet there, in ascending order.
    meeting: Vec<Vec<u32>>,
    /// The side of a cell of the lattice.
    spacing: f64,
}

impl LabelMesh {
    /// The boundary of one label: a closed surface, counter-clockwise seen from outside, with those vertices of the walls that it has.
    pub fn of_label(&self, label: u32) -> TriangleMesh {
        let faces = self.mesh.faces.iter().zip(&self.sides);
        let faces = faces.filter_map(|(&[a, b, c], sides)| match sides {
            [behind, _] if *behind == label => Some([a, b, c]),
            [_, ahead] if *ahead == label => Some([a, c, b]),
            _ => None,
        });
        let mut surface = TriangleMesh {
            vertices: self.mesh.vertices.clone(),
            faces: faces.collect(),
            normals: None,
        };
        drop_unreferenced(&mut surface);
        surface
    }

    /// The walls with triangles of better shapes, where labels are equally deep: in every round vertices move towards the middle of their neighbours
    /// on the wall, those on a curve where three labels meet towards the middle of their neighbours on the curve, and back to where the depths of
    /// their labels are the same. None goes further than a cell from where it was.
    pub fn relaxed(&self, rounds: usize, deeper: &DepthDifference<'_>) -> Self {
        let (around, first) = (self.neighbours(), self.mesh.points());
        let moved = |from: &[Vector], part: f64, steps: usize| -> Vec<Vector> {
            let vertices = (0..from.len()).into_par_iter();
            let one = vertices.map(|vertex| {
                let near = &around[vertex];
                let mut x = from[vertex];
                if !near.is_empty() && part > 0.0 {
                    let sum: Vector = near.iter().map(|&near| from[near as usize]).sum();
                    x = x.lerp(sum / near.len() as f64, part);
                }
                let x = self.on_walls(vertex, x, steps, deeper);
                first[vertex] + (x - first[vertex]).clamp_length_max(self.spacing)
            });
            one.collect()
        };
        let mut x = moved(&first, 0.0, STEPS);
        for _ in 0..rounds {
            x = moved(&x, RELAXED, STEPS);
        }
        x = moved(&x, 0.0, LAST_STEPS);
        self.with_mesh(self.mesh.on(&x))
    }

    /// Near a point, where the labels that meet at a vertex are equally deep.
    fn on_walls(
        &self,
        vertex: usize,
        from: Vector,
        steps: usize,
        deeper: &DepthDifference<'_>,
    ) -> Vector {
        let labels = &self.meeting[vertex];
        let mut x = from;
        for _ in 0..steps {
            // With three labels or four, one pair after the other.
            for (place, &a) in labels.iter().enumerate() {
                for &b in &labels[place + 1..] {
                    let (difference, slope) = deeper([a, b], x.to_array());
                    let slope = Vector::from_array(slope);
                    let squared = slope.length_squared();
                    if squared > FLAT * FLAT {
                        let step = slope * (-difference / squared);
                        x += step.clamp_length_max(0.5 * self.spacing);
                    }
                }
            }
        }
        x
    }

    /// The walls with their vertices within a bound; `restored` is as that of [`Bound::hold`].
    pub fn held(&self, bound: &Bound, restored: impl Fn(&Self, &[bool]) -> Self) -> Self {
        let held = bound.hold(&self.mesh, |mesh, free| {
            restored(&self.with_mesh(mesh.clone()), free).mesh
        });
        self.with_mesh(held)
    }

    fn with_mesh(&self, mesh: TriangleMesh) -> Self {
        Self {
            mesh,
            ..self.clone()
        }
    }
}
