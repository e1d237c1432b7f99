//! Triangle meshes as text: positions of 16 bits, faces of few bytes.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use geometry::measure::BoundingBox;
use surfaces::TriangleMesh;

use crate::error::{Error, Result};

/// Steps of the grid that positions are rounded to, along every side of the bounding box.
const STEPS: f64 = u16::MAX as f64;
/// Beyond this the single precision of graphics cards overflows.
const LARGEST: f64 = 1e18;

/// A mesh as the page carries it. Vertices are numbered by their first use, and those that no face
/// uses are left out.
///
/// The data are the positions, three little-endian 16-bit numbers each in units of `step` from the
/// lower corner; the normals, if the mesh has them, likewise from -1 to 1; and the corners of the faces. A corner is stored as its distance from the lowest
/// number not used before, zero for a vertex that appears for the first time; seven bits to a byte,
/// low ones first, the eighth bit set if more follow. Neighbouring faces share recent vertices,
/// so most corners take one byte or two.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Surface {
    pub label: String,
    pub vertices: usize,
    pub faces: usize,
    pub bounds: BoundingBox<3>,
    pub has_normals: bool,
    pub data: String,
}

impl Surface {
    pub fn new(label: &str, mesh: &TriangleMesh) -> Result<Self> {
        let label = label.to_owned();
        if mesh.faces.is_empty() {
            return Err(Error::Empty(label));
        }
        if let Err(error) = mesh.check(LARGEST) {
            let source = Box::new(error);
            return Err(Error::Surface { label, source });
        }
        let mut number = vec![None; mesh.vertices.len()];
        let mut order = Vec::with_capacity(mesh.vertices.len());
        let mut corners = Vec::with_capacity(4 * mesh.faces.len());
        for &vertex in mesh.faces.as_flattened() {
            let vertex = vertex as usize;
            let next = order.len();
            let index = *number[vertex].get_or_insert(next);
            if index == next {
                order.push(vertex);
            }
            push_varint(&mut corners, next - index);
        }
        let used: Vec<[f64; 3]> = order.iter().map(|&vertex| mesh.vertices[vertex]).collect();
        let bounds = BoundingBox::around(used.iter().copied()).expect("a face has vertices");
        let (low, extent) = (bounds.lower, bounds.extent());
        let mut bytes = Vec::with_capacity(10 * used.len() + corners.len());
        for position in &used {
            for i in 0..3 {
                // Where the box is flat it is NaN, which becomes 0.
                let part = (position[i] - low[i]) / extent[i];
                bytes.extend(((part * STEPS).round() as u16).to_le_bytes());
            }
        }
        if let Some(normals) = &mesh.normals {
            for value in order.iter().flat_map(|&vertex| normals[vertex]) {
                bytes.extend(((0.5 * (value + 1.0) * STEPS).round() as u16).to_le_bytes());
            }
        }
        bytes.extend(corners);
        Ok(Self {
            label,
            vertices: used.len(),
            faces: mesh.faces.len(),
            bounds,
            has_normals: mesh.normals.is_some(),
            data: STANDARD.encode(bytes),
        })
    }

    /// Sizes of the units of positions.
    pub fn step(&self) -> [f64; 3] {
        self.bounds.extent().map(|side| side / STEPS)
    }
}

fn push_varint(bytes: &mut Vec<u8>, mut value: usize) {
    while value > 0x7f {
        bytes.push((value & 0x7f) as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// As the script of the page does it.
    fn decoded(surface: &Surface) -> TriangleMesh {
        let bytes = STANDARD.decode(&surface.data).unwrap();
        let (positions, rest) = bytes.split_at(6 * surface.vertices);
        let length = positions.len() * usize::from(surface.has_normals);
        let (normals, mut rest) = rest.split_at(length);
        let triples = |bytes: &[u8]| -> Vec<[f64; 3]> {
            let value = |bytes: &[u8]| f64::from(u16::from_le_bytes([bytes[0], bytes[1]]));
            let triples = bytes.chunks_exact(6);
            triples
                .map(|x| [0, 2, 4].map(|at| value(&x[at..])))
                .collect()
        };
        let (low, step) = (surface.bounds.lower, surface.step());
        let vertices = triples(positions).into_iter();
        let vertices = vertices.map(|x| [0, 1, 2].map(|i| low[i] + step[i] * x[i]));
        let normals = triples(normals).into_iter();
        let normals = normals.map(|n| n.map(|value| 2.0 * value / STEPS - 1.0));
        let (mut next, mut corners) = (0, Vec::new());
        while let [_, ..] = rest {
            let (mut distance, mut shift) = (0, 0);
            loop {
                let (&byte, tail) = rest.split_first().unwrap();
                rest = tail;
                distance |= u32::from(byte & 0x7f) << shift;
                shift += 7;
                if byte & 0x80 == 0 {
                    break;
                }
            }
            corners.push(next - distance);
            next += u32::from(distance == 0);
        }
        assert_eq!(next as usize, surface.vertices);
        let faces = corners.chunks_exact(3).map(|f| [f[0], f[1], f[2]]);
        TriangleMesh {
            vertices: vertices.collect(),
            faces: faces.collect(),
            normals: surface.has_normals.then(|| normals.collect()),
        }
    }

    /// Largest distance of corners over the step along their axis; the faces must agree.
    fn largest_error(mesh: &TriangleMesh, surface: &Surface) -> f64 {
        let back = decoded(surface);
        assert_eq!(back.faces.len(), mesh.faces.len());
        let step = surface.step().map(|s| if s > 0.0 { s } else { 1.0 });
        let corners = mesh.faces.as_flattened().iter();
        let errors = corners.zip(back.faces.as_flattened()).flat_map(|(&a, &b)| {
            let (x, y) = (mesh.vertices[a as usize], back.vertices[b as usize]);
            [0, 1, 2].map(|i| (x[i] - y[i]).abs() / step[i])
        });
        errors.fold(0.0, f64::max)
    }

    #[test]
    fn a_scanned_figure_survives_and_is_small() {
        let figure = surfaces::samples::figure(48).unwrap();
        let mesh = figure.mesh();
        let surface = Surface::new("figure", mesh).unwrap();
        assert!(largest_error(mesh, &surface) <= 0.5 + 1e-6);
        assert_eq!(surface.faces, mesh.faces.len());
        let (back, pairs) = (decoded(&surface), mesh.faces.as_flattened().iter());
        let (before, after) = (mesh.normals.as_ref().unwrap(), back.normals.unwrap());
        for (&a, &b) in pairs.zip(back.faces.as_flattened()) {
            let (n, m) = (before[a as usize], after[b as usize]);
            let difference = (0..3).map(|i| (n[i] - m[i]).abs()).fold(0.0, f64::max);
            assert!(difference < 2e-5, "{n:?} {m:?}");
        }
        // In place of 12 bytes for positions, 12 for normals, and 24 for the corners of two faces.
        let per_vertex = 0.75 * surface.data.len() as f64 / surface.vertices as f64;
        assert!(per_vertex < 21.0, "{per_vertex} bytes");
    }

    #[test]
    fn unused_vertices_do_not_count() {
        let mesh = TriangleMesh {
            vertices: vec![[9e9; 3], [0.0; 3], [1.0, 0.0, 5.0], [0.0, 2.0, 5.0]],
            faces: vec![[3, 1, 2]],
            normals: None,
        };
        let surface = Surface::new("one", &mesh).unwrap();
        assert_eq!(
            (surface.vertices, surface.bounds.upper),
            (3, [1.0, 2.0, 5.0])
        );
        assert!(largest_error(&mesh, &surface) < 0.5);
    }

    #[test]
    fn what_cannot_be_shown_is_refused() {
        let mesh = |vertices: &[[f64; 3]], faces: &[[u32; 3]]| TriangleMesh {
            vertices: vertices.to_vec(),
            faces: faces.to_vec(),
            normals: None,
        };
        let error = Surface::new("none", &mesh(&[[0.0; 3]], &[])).unwrap_err();
        assert!(matches!(&error, Error::Empty(label) if label == "none"));
        for value in [f64::NAN, f64::INFINITY, 1e300] {
            let vertices = [[0.0; 3], [0.0, value, 0.0]];
            let error = Surface::new("far", &mesh(&vertices, &[[0, 1, 0]])).unwrap_err();
            assert!(
                error.to_string().contains("\"far\"") && error.to_string().contains("vertex 1"),
                "{error}"
            );
        }
        let mut bare = mesh(&[[0.0; 3]; 2], &[[0, 1, 0]]);
        bare.normals = Some(vec![[0.0, 0.0, 1.0]]);
        let error = Surface::new("bare", &bare).unwrap_err();
        assert!(
            error.to_string().contains("1 normals for 2 vertices"),
            "{error}"
        );
        let error = Surface::new("x", &mesh(&[[0.0; 3]; 2], &[[0, 1, 0], [0, 2, 1]])).unwrap_err();
        assert!(matches!(error, Error::Surface { .. }), "{error}");
    }

    proptest! {
        #[test]
        fn positions_are_within_half_a_step(
            vertices in prop::collection::vec(prop::array::uniform3(-1e3..1e3), 1..300),
            corners in prop::collection::vec(prop::array::uniform3(any::<u32>()), 1..400),
        ) {
            let count = vertices.len() as u32;
            let faces = corners.into_iter().map(|f| f.map(|v| v % count)).collect();
            let mesh = TriangleMesh { vertices, faces, normals: None };
            let surface = Surface::new("random", &mesh).unwrap();
            prop_assert!(largest_error(&mesh, &surface) <= 0.5 + 1e-6);
        }
    }
}
