//! Wavefront OBJ.
//!
//! Not by a library: of those, `tobj` takes polylines for faces, splits vertices between groups,
//! and tells no line numbers; `obj` reads single precision.

use super::{FormatError, Polygons, position, shortened};
use crate::TriangleMesh;
use crate::colours::level;
use crate::vector::Vector;

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

/// The colours behind the coordinates of the vertices, if all have some.
pub(crate) fn colours(bytes: &[u8]) -> Option<Vec<[u8; 3]>> {
    let text = String::from_utf8_lossy(bytes);
    let vertices = text
        .lines()
        .filter_map(|line| line.trim_start().strip_prefix("v "));
    let colour = |vertex: &str| {
        let numbers: Option<Vec<f64>> = vertex
            .split_whitespace()
            .map(|word| word.parse().ok())
            .collect();
        match numbers?[..] {
            [_, _, _, r, g, b] => Some([r, g, b].map(level)),
            _ => None,
        }
    };
    vertices.map(colour).collect()
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

/// The text with other coordinates of vertices, and with normals to fit them.
pub(crate) fn rewrite(bytes: &[u8], moved: &TriangleMesh) -> Result<Vec<u8>, FormatError> {
    let mut normals = normals(bytes, moved)?.into_iter();
    let mut vertices = moved.vertices.iter();
    let mut out = Vec::with_capacity(bytes.len());
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        let text = String::from_utf8_lossy(line);
        let mut words = text.split_whitespace();
        let (keyword, numbers) = match words.next() {
            Some("v") => ("v", vertices.next().copied()),
            Some("vn") => ("vn", normals.next().map(|n| n.to_array())),
            _ => ("", None),
        };
        let Some([x, y, z]) = numbers else {
            out.extend_from_slice(line);
            continue;
        };
        out.extend_from_slice(format!("{keyword} {x} {y} {z}").as_bytes());
        // Weights and colours.
        for word in words.skip(3) {
            out.push(b' ');
            out.extend_from_slice(word.as_bytes());
        }
        out.extend_from_slice(&line[line.trim_ascii_end().len()..]);
    }
    Ok(out)
}

/// For every normal in the text the unit normal of the corners that refer to it, which tells flat faces from smooth ones.
fn normals(bytes: &[u8], moved: &TriangleMesh) -> Result<Vec<Vector>, FormatError> {
    let text = String::from_utf8_lossy(bytes);
    let mut sums = Vec::new();
    let (mut vertices, mut uses) = (0, Vec::new());
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => vertices += 1,
            Some("vn") => sums.push(Vector::ZERO),
            Some("f") => {
                let mut polygon = Vec::new();
                for word in words {
                    let vertex = corner(word, number + 1, vertices)? - 1;
                    let normal = word.split('/').nth(2).and_then(|n| n.parse::<i64>().ok());
                    let normal = normal.map(|n| if n < 0 { n + sums.len() as i64 } else { n - 1 });
                    let position = moved.vertices.get(vertex as usize).copied();
                    polygon.push((Vector::from_array(position.unwrap_or_default()), normal));
                }
                // Twice the vector area.
                let area: Vector = (0..polygon.len())
                    .map(|i| polygon[i].0.cross(polygon[(i + 1) % polygon.len()].0))
                    .sum();
                uses.extend(polygon.into_iter().map(|(_, normal)| (normal, area)));
            }
            _ => {}
        }
    }
    for (normal, area) in uses {
        let sum = normal.and_then(|n| sums.get_mut(usize::try_from(n).ok()?));
        if let Some(sum) = sum {
            *sum += area;
        }
    }
    Ok(sums.into_iter().map(Vector::normalize_or_zero).collect())
}
