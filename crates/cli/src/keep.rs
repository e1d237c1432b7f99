//! What `--keep` leaves where it is.

use std::collections::HashSet;

use crate::paths::{MESHES, extension};
use crate::prelude::*;

/// Nodes this many cells from a vertex along an axis may belong to it.
const REACH: f64 = 6.0;

pub enum Keep {
    /// What is inside a region or a mask,
    Inside(Box<dyn SignedDistance<3>>),
    /// or vertices by the [keys](key) of their positions.
    At(HashSet<[u64; 3]>),
}

/// The coordinates as bits, by which equal positions are found; -0 is 0.
pub fn key(x: [f64; 3]) -> [u64; 3] {
    x.map(|v| (v + 0.0).to_bits())
}

impl Keep {
    /// The file of the mask, if it is one.
    pub fn mask(text: &str) -> Option<&Path> {
        let path = Path::new(text);
        MESHES.contains(&&*extension(path)).then_some(path)
    }

    /// From what was typed, with the bytes of the mask, for a mesh and its file.
    pub fn parse(
        text: &str,
        mask: Option<&[u8]>,
        mesh: &TriangleMesh,
        (bytes, file): (&[u8], &str),
    ) -> Result<Self> {
        let wrong = |reason: String| Error::options(format!("--keep {text}: {reason}"));
        if let Some(colour) = text.strip_prefix("colour:") {
            let digits = colour.strip_prefix('#').unwrap_or(colour);
            let value = u32::from_str_radix(digits, 16).ok();
            let Some(value) = value.filter(|_| digits.len() == 6) else {
                refuse!("--keep {text}: give six hexadecimal digits, as colour:ff0000");
            };
            let [_, colour @ ..] = value.to_be_bytes();
            let Some(colours) = surfaces::vertex_colours(bytes, file)? else {
                refuse!(
                    "--keep colour:... needs a mesh whose vertices have colours, in PLY or OBJ"
                );
            };
            let vertices = mesh.vertices.iter().zip(colours);
            let kept = vertices.filter(|(_, of)| *of == colour);
            return Ok(Self::At(kept.map(|(x, _)| key(*x)).collect()));
        }
        if let Some(mask) = mask {
            let mesh = surfaces::decode(mask, text)?;
            let (mesh, _) = ClosedMesh::new(mesh).map_err(|error| wrong(error.to_string()))?;
            return Ok(Self::Inside(Box::new(MeshDistance::new(&mesh))));
        }
        let region: Region = text.parse().map_err(wrong)?;
        Ok(Self::Inside(region.shape::<3>()?))
    }

    /// Whether a vertex stays.
    pub fn holds(&self, x: [f64; 3]) -> bool {
        match self {
            Self::Inside(shape) => shape.signed_distance(x) <= 0.0,
            Self::At(kept) => kept.contains(&key(x)),
        }
    }

    /// The nodes of a grid that move: as the vertex that is nearest to them, where vertices are kept.
    pub fn moving_nodes(&self, grid: &Grid<3>, vertices: &[[f64; 3]]) -> NodeSet {
        if let Self::Inside(shape) = self {
            return NodeSet::inside(grid, &|x| -shape.signed_distance(x));
        }
        let (cells, origin, spacing) = (grid.cells(), grid.origin(), grid.spacing());
        // By the planes of nodes that they reach: what is nearest is known of one plane at a time, for the sake of the memory.
        let (mut reaching, mut planes) = (Vec::new(), vec![Vec::new(); cells]);
        for (vertex, &x) in vertices.iter().enumerate() {
            let at = [0, 1, 2].map(|axis| (x[axis] - origin[axis]) / spacing);
            let end = |end: f64| end.clamp(0.0, cells as f64 - 1.0) as usize;
            let ends = at.map(|at| end(at - REACH)..=end(at + REACH));
            for plane in &mut planes[ends[0].clone()] {
                plane.push(vertex);
            }
            reaching.push((at, ends, !self.holds(x)));
        }
        let moves = |(i, vertices): (usize, Vec<usize>)| {
            let mut nearest = vec![(f64::INFINITY, true); cells * cells];
            for vertex in vertices {
                let (at, [_, rows, columns], moves) = &reaching[vertex];
                for j in rows.clone() {
                    for k in columns.clone() {
                        let off = [i, j, k].map(|n| n as f64);
                        let distance = (0..3).map(|axis| (off[axis] - at[axis]).powi(2)).sum();
                        let node = &mut nearest[j * cells + k];
                        if distance < node.0 {
                            *node = (distance, *moves);
                        }
                    }
                }
            }
            nearest.into_iter().map(|(_, moves)| moves)
        };
        planes.into_iter().enumerate().flat_map(moves).collect()
    }
}
