//! Wavefront OBJ.
//!
//! Not by a library: of those, `tobj` takes polylines for faces, splits vertices between groups,
//! and tells no line numbers; `obj` reads single precision.

use super::{FormatError, Polygons, position, shortened};
use crate::TriangleMesh;

/// Vertices and faces; all other statements are passed over.
pub(super) fn decode(bytes: &[u8]) -> Result<TriangleMesh, FormatError> {
    // Names and comments may be in any encoding.
    let text = String::from_utf8_lossy(bytes);
    let mut vertices = Vec::new();
    // All corners in a row, counted from one, and where each face ends.
    let (mut corners, mut ends) = (Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => vertices.push(position(words, number + 1, vertices.len())?),
            Some("f") => {
                for word in words {
                    corners.push(corner(word, number + 1, vertices.len())?);
                }
                ends.push(corners.len());
            }
            _ => {}
        }
    }
    let mut polygons = Polygons::new(vertices.len(), 1)?;
    let mut start = 0;
    for (face, &end) in ends.iter().enumerate() {
        polygons.push(face, &corners[start..end])?;
        start = end;
    }
    Ok(TriangleMesh {
        faces: polygons.finish()?,
        vertices,
        normals: None,
    })
}

/// The vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative ones count backwards from the
/// last vertex so far, which is -1.
fn corner(word: &str, line: usize, so_far: usize) -> Result<i64, FormatError> {
    let vertex = word.split('/').next().unwrap_or_default();
    let index: i64 = vertex.parse().map_err(|_| FormatError::Line {
        line,
        found: shortened(word),
        expected: "the index of a vertex",
    })?;
    if index >= 0 {
        return Ok(index);
    }
    let resolved = index.checked_add(so_far as i64 + 1);
    resolved.filter(|&v| v >= 1).ok_or(FormatError::Line {
        line,
        found: shortened(word),
        expected: "a relative index of a vertex above",
    })
}
