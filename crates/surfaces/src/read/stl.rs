//! STL, binary and ASCII.
//!
//! Not by a library: `stl_io` takes binary files whose comment begins with `solid` for ASCII,
//! refuses `solid` without a name, reads the first of several solids only, and rounds ASCII to
//! single precision.

use super::{FormatError, Polygons, finite, position};
use crate::TriangleMesh;
use crate::mesh::merge_coincident;
use crate::vector::{Vector, scaled_normal};

/// Comment and number of facets.
const HEADER: usize = 84;
/// Normal, three corners, and two bytes of attributes.
const FACET: usize = 50;

pub(super) fn decode(bytes: &[u8]) -> Result<TriangleMesh, FormatError> {
    let corners = match binary_length(bytes) {
        _ if is_binary(bytes) => binary(facets(bytes))?,
        _ if is_text(bytes) => ascii(&String::from_utf8_lossy(bytes))?,
        Some((count, expected)) => {
            return Err(FormatError::Length {
                elements: "facets".into(),
                count,
                expected,
                found: bytes.len() as u64,
            });
        }
        None => {
            let expected = "\"solid\", or a binary header of 84 bytes,";
            return Err(FormatError::line(
                1,
                &String::from_utf8_lossy(bytes),
                expected,
            ));
        }
    };
    let (first, index) = merge_coincident(&corners);
    let mut polygons = Polygons::new(first.len(), 0)?;
    polygons.faces = index.as_chunks().0.to_vec();
    Ok(TriangleMesh {
        vertices: first.iter().map(|&v| corners[v]).collect(),
        faces: polygons.finish()?,
        normals: None,
    })
}

/// Number of facets and length of the file according to a binary header.
fn binary_length(bytes: &[u8]) -> Option<(u64, u64)> {
    let (_, count) = bytes.get(..HEADER)?.split_last_chunk()?;
    let count = u64::from(u32::from_le_bytes(*count));
    Some((count, HEADER as u64 + FACET as u64 * count))
}

/// Whether all facets of a binary header are there: this tells binary files from ASCII, since the comment of a binary one may begin with
/// "solid" as well, and letters in place of the number of facets announce more than a gigabyte. Bytes behind the facets are passed over.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let length = bytes.len() as u64;
    binary_length(bytes)
        .is_some_and(|(count, expected)| expected == length || count > 0 && expected < length)
}

/// The bytes of the facets of a binary file.
fn facets(bytes: &[u8]) -> &[u8] {
    let length = binary_length(bytes).map_or(0, |(_, length)| length as usize);
    &bytes[HEADER.min(length)..length]
}

fn is_text(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    start.len() >= 5 && start[..5].eq_ignore_ascii_case(b"solid")
}

/// Three corners for every facet.
fn binary(facets: &[u8]) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut corners = Vec::with_capacity(3 * facets.len() / FACET);
    for facet in facets.as_chunks::<FACET>().0 {
        // The normal comes first; it follows from the corners.
        for corner in facet[12..48].as_chunks::<12>().0 {
            let numbers = corner.as_chunks().0;
            let position = [0, 1, 2].map(|i| f64::from(f32::from_le_bytes(numbers[i])));
            corners.push(finite(position, corners.len())?);
        }
    }
    Ok(corners)
}

/// Three corners for every facet, of all solids.
fn ascii(text: &str) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut corners = Vec::new();
    let mut facet = 0;
    let mut open = false;
    let (mut last, mut complete) = (0, false);
    // Editors of old end texts with a control character, and blocks of a disk are filled up with zeros.
    let text = text.trim_end_matches(['\0', '\x1a']);
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else {
            continue;
        };
        last = number + 1;
        let keyword = keyword.to_ascii_lowercase();
        complete = keyword == "endsolid";
        match (keyword.as_str(), open) {
            ("facet", false) => open = true,
            ("vertex", true) => corners.push(position(words, last, corners.len())?),
            ("endfacet", true) => {
                let count = corners.len() - 3 * facet;
                if count != 3 {
                    return Err(FormatError::Corners {
                        face: facet,
                        corners: count,
                        expected: "an STL facet has three",
                    });
                }
                facet += 1;
                open = false;
            }
            ("outer" | "endloop", true) | ("solid" | "endsolid", false) => {}
            _ => {
                let expected = if open {
                    "outer loop, vertex, endloop or endfacet"
                } else {
                    "facet or endsolid"
                };
                return Err(FormatError::line(last, line, expected));
            }
        }
    }
    if !complete {
        return Err(FormatError::EndOfText(last, "endsolid"));
    }
    Ok(corners)
}

/// The file with other corners of its facets, and normals to fit them.
pub(super) fn rewrite(bytes: &[u8], moved: &TriangleMesh) -> Vec<u8> {
    let corners = |face: &[u32; 3]| moved.corners(*face);
    let normal = |face| scaled_normal(corners(face)).normalize_or_zero();
    if is_binary(bytes) {
        let mut out = bytes.to_vec();
        // One face for each facet.
        for (facet, face) in out[HEADER..].chunks_exact_mut(FACET).zip(&moved.faces) {
            let vectors = std::iter::once(normal(face)).chain(corners(face));
            let numbers = vectors.flat_map(|v| v.to_array());
            for (bytes, number) in facet.as_chunks_mut().0.iter_mut().zip(numbers) {
                *bytes = (number as f32).to_le_bytes();
            }
        }
        return out;
    }
    let mut faces = moved.faces.iter();
    let mut vertices = Vec::new().into_iter();
    let mut out = Vec::with_capacity(bytes.len());
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        let text = String::from_utf8_lossy(line);
        let keyword = text.split_whitespace().next().unwrap_or_default();
        let numbers = if keyword.eq_ignore_ascii_case("facet") {
            let face = faces.next();
            vertices = face.map_or(Vec::new(), |f| corners(f).to_vec()).into_iter();
            face.map(|face| ("facet normal", normal(face)))
        } else if keyword.eq_ignore_ascii_case("vertex") {
            vertices.next().map(|x| ("vertex", x))
        } else {
            None
        };
        let Some((words, Vector { x, y, z })) = numbers else {
            out.extend_from_slice(line);
            continue;
        };
        let indent = line.len() - line.trim_ascii_start().len();
        out.extend_from_slice(&line[..indent]);
        out.extend_from_slice(format!("{words} {x:e} {y:e} {z:e}").as_bytes());
        out.extend_from_slice(&line[line.trim_ascii_end().len()..]);
    }
    out
}
