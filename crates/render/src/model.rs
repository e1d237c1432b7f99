//! What is drawn: triangles of the surface and of tubes.

use std::f64::consts::{FRAC_PI_2, TAU};

use geometry::require;
use glam::DVec3;
use srgb::Rgb;
use surfaces::TriangleMesh;

use crate::Error;

/// Sides of a tube.
const AROUND: usize = 12;
/// Rows of triangles of each of its round ends.
const ROWS: usize = 3;

/// A round tube along a polyline, with round ends and joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Tube {
    /// The points of the polyline. Repeated ones are passed over.
    pub points: Vec<[f64; 3]>,
    /// Whether the last point is joined to the first.
    pub closed: bool,
    /// Radius, in the units of the surface. Tubes much thinner than a pixel have gaps.
    pub radius: f64,
    /// The colour of the whole tube.
    pub colour: Rgb,
}

impl Tube {
    /// An open tube, near-black; for others, `Tube { closed: true, ..Tube::new(points, radius) }`.
    pub fn new(points: impl Into<Vec<[f64; 3]>>, radius: f64) -> Self {
        Self {
            points: points.into(),
            closed: false,
            radius,
            colour: Rgb::INK,
        }
    }

    /// The twelve edges of a box.
    pub fn edges_of_box(low: [f64; 3], high: [f64; 3], radius: f64) -> Vec<Self> {
        let corner =
            |k: usize| -> [f64; 3] { std::array::from_fn(|axis| [low, high][k >> axis & 1][axis]) };
        let ends = (0..8_usize).flat_map(|k| (0..3).map(move |axis| (k, k | 1 << axis)));
        ends.filter(|(a, b)| a != b)
            .map(|(a, b)| Self::new([corner(a), corner(b)], radius))
            .collect()
    }
}

/// A corner of triangles.
pub(crate) struct Vertex {
    pub place: DVec3,
    pub normal: DVec3,
    /// Index of its colour.
    pub colour: usize,
}

/// All triangles of a scene.
pub(crate) struct Model {
    pub vertices: Vec<Vertex>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Model {
    /// The surface, of colour 0.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let normals = match &mesh.normals {
            Some(normals) => normals,
            None => &mesh.vertex_normals(),
        };
        let vertices = mesh.vertices.iter().zip(normals);
        Self {
            vertices: vertices
                .map(|(&place, &normal)| Vertex {
                    place: place.into(),
                    normal: normal.into(),
                    colour: 0,
                })
                .collect(),
            triangles: mesh.faces.clone(),
        }
    }

    /// Adds a tube; `index` is for messages.
    pub fn push(&mut self, tube: &Tube, index: usize, colour: usize) -> Result<(), Error> {
        require("radius of a tube", tube.radius, "positive", |v| v > 0.0)?;
        for value in tube.points.iter().flatten() {
            require("coordinate of a tube", *value, "finite", |_| true)?;
        }
        let mut points: Vec<DVec3> = tube.points.iter().map(|&p| p.into()).collect();
        if tube.closed {
            points.extend(points.first().copied());
        }
        points.dedup();
        if points.len() < 2 {
            return Err(Error::TubePoints {
                index,
                points: points.len(),
            });
        }
        for ends in points.windows(2) {
            self.push_capsule([ends[0], ends[1]], tube.radius, colour);
        }
        Ok(())
    }

    /// A sphere around each end, cut in two halves, joined by a cylinder.
    fn push_capsule(&mut self, ends: [DVec3; 2], radius: f64, colour: usize) {
        let axis = (ends[1] - ends[0]).normalize();
        let (u, v) = axis.any_orthonormal_pair();
        let first = self.vertices.len();
        let latitudes = (0..=ROWS).map(|row| FRAC_PI_2 * (row as f64 / ROWS as f64 - 1.0));
        let latitudes: Vec<f64> = latitudes.collect();
        let rows = latitudes.iter().map(|&latitude| (ends[0], latitude));
        let rows = rows.chain((latitudes.iter().rev()).map(|&latitude| (ends[1], -latitude)));
        for (end, latitude) in rows {
            for side in 0..AROUND {
                let (sin, cos) = (TAU * side as f64 / AROUND as f64).sin_cos();
                let normal = latitude.sin() * axis + latitude.cos() * (cos * u + sin * v);
                self.vertices.push(Vertex {
                    place: end + radius * normal,
                    normal,
                    colour,
                });
            }
        }
        for row in 0..=2 * ROWS {
            for side in 0..AROUND {
                let [below, above] = [row, row + 1].map(|row| first + row * AROUND);
                let next = (side + 1) % AROUND;
                let quad = [below + side, below + next, above + next, above + side];
                let [a, b, c, d] = quad.map(|vertex| vertex as u32);
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
}
