//! Wavefront OBJ.
//!
//! Not by a library: of those, `tobj` takes polylines for faces, splits vertices between groups,
//! and tells no line numbers; `obj` reads single precision.

use super::text::{line_end, split_comment};
use super::{FormatError, Polygons, level, position, side_of};
use crate::TriangleMesh;
use crate::vector::Vector;

/// The statements that are read.
const READ: [&str; 3] = ["v", "vn", "f"];

/// A statement with its line, which goes on behind a backslash at its end.
struct Statement<'a> {
    /// The number of its first line, from one.
    number: usize,
    line: &'a [u8],
}

/// The statements of a text, one for each line. Only those that are [read](READ) go on: comments and names may end with a backslash, too.
fn statements(bytes: &[u8]) -> impl Iterator<Item = Statement<'_>> {
    let (mut rest, mut lines) = (bytes, 0);
    std::iter::from_fn(move || {
        let number = lines + 1;
        let is_read = READ
            .iter()
            .any(|keyword| Some(*keyword) == keyword_of(rest));
        let mut length = 0;
        for line in rest.split_inclusive(|&byte| byte == b'\n') {
            length += line.len();
            lines += 1;
            if !is_read || line.contains(&b'#') || !line.trim_ascii_end().ends_with(b"\\") {
                break;
            }
        }
        let (line, behind) = rest.split_at(length);
        rest = behind;
        (!line.is_empty()).then_some(Statement { number, line })
    })
}

/// The first word of a line.
fn keyword_of(line: &[u8]) -> Option<&str> {
    let line = line.split(|&byte| byte == b'\n').next()?;
    let word = line
        .trim_ascii_start()
        .split(u8::is_ascii_whitespace)
        .next()?;
    std::str::from_utf8(word).ok()
}

impl Statement<'_> {
    /// Its words, and its comment. Names and comments may be in any encoding.
    fn split<T>(
        &self,
        read: impl for<'b> FnOnce(&mut dyn Iterator<Item = &'b str>, &'b str) -> T,
    ) -> T {
        let text = String::from_utf8_lossy(self.line);
        let (before, comment) = split_comment(&text);
        let mut words = before.split(|c: char| c.is_whitespace() || c == '\\');
        read(&mut words.by_ref().filter(|word| !word.is_empty()), comment)
    }
}

/// What counts of a text; all other statements are passed over.
#[derive(Default)]
struct Statements {
    vertices: Vec<[f64; 3]>,
    normals: Vec<Vector>,
    /// All corners of faces in a row: the vertex, counted from one, and the normal, counted from zero, that it refers to.
    corners: Vec<(i64, Option<usize>)>,
    /// Where each face ends.
    ends: Vec<usize>,
}

impl Statements {
    fn of(bytes: &[u8]) -> Result<Self, FormatError> {
        let mut found = Self::default();
        for statement in statements(bytes) {
            statement.split(|words, _| found.add(statement.number, words))?;
        }
        Ok(found)
    }

    fn add<'a>(
        &mut self,
        line: usize,
        mut words: impl Iterator<Item = &'a str>,
    ) -> Result<(), FormatError> {
        let vertices = self.vertices.len();
        match words.next() {
            Some("v") => self.vertices.push(position(words, line, vertices)?),
            Some("vn") => {
                let mut numbers = words.map(|word| word.parse().unwrap_or(0.0));
                let normal = std::array::from_fn(|_| numbers.next().unwrap_or(0.0));
                self.normals.push(Vector::from_array(normal));
            }
            Some("f") => {
                for word in words {
                    let vertex = corner(word, line, vertices)?;
                    self.corners.push((vertex, self.normal(word)));
                }
                self.ends.push(self.corners.len());
            }
            _ => {}
        }
        Ok(())
    }

    /// The corners of each face.
    fn faces(&self) -> impl Iterator<Item = &[(i64, Option<usize>)]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        (starts.zip(&self.ends)).map(|(&start, &end)| &self.corners[start..end])
    }

    /// For every normal twice the vector area of the faces that refer to it, each as often as its corners do, with the vertices at these places.
    fn normal_areas(&self, vertices: &[[f64; 3]]) -> Vec<Vector> {
        let mut sums = vec![Vector::ZERO; self.normals.len()];
        for face in self.faces() {
            let place = |&(vertex, _): &(i64, Option<usize>)| {
                let position = vertices.get((vertex - 1) as usize);
                Vector::from_array(position.copied().unwrap_or_default())
            };
            // From a corner: far from the origin products of places lose all digits.
            let first = face.first().map_or(Vector::ZERO, place);
            let next = face.iter().cycle().skip(1);
            let area: Vector = (face.iter().zip(next))
                .map(|(a, b)| (place(a) - first).cross(place(b) - first))
                .sum();
            for normal in face.iter().filter_map(|(_, normal)| *normal) {
                if let Some(sum) = sums.get_mut(normal) {
                    *sum += area;
                }
            }
        }
        sums
    }

    /// The normal of a corner `v//vn` or `v/vt/vn`; negative ones count backwards from the last normal so far.
    fn normal(&self, word: &str) -> Option<usize> {
        let normal: i64 = word.split('/').nth(2)?.parse().ok()?;
        let first = if normal < 0 {
            self.normals.len() as i64
        } else {
            -1
        };
        usize::try_from(first.checked_add(normal)?).ok()
    }
}

/// Vertices and faces.
pub(super) fn decode(bytes: &[u8]) -> Result<TriangleMesh, FormatError> {
    let found = Statements::of(bytes)?;
    let mut polygons = Polygons::new(found.vertices.len(), 1)?;
    let mut corners = Vec::new();
    for (number, face) in found.faces().enumerate() {
        corners.clear();
        corners.extend(face.iter().map(|(vertex, _)| vertex));
        polygons.push(number, &corners)?;
    }
    Ok(TriangleMesh {
        faces: polygons.finish()?,
        vertices: found.vertices,
        normals: None,
    })
}

/// The colours behind the coordinates of the vertices, if all have some.
pub(super) fn colours(bytes: &[u8]) -> Option<Vec<[u8; 3]>> {
    let vertices = statements(bytes).filter(|statement| keyword_of(statement.line) == Some("v"));
    let colour = |statement: Statement<'_>| {
        let parsed = |words: &mut dyn Iterator<Item = &str>| {
            words.skip(1).map(|word| word.parse().ok()).collect()
        };
        let numbers: Option<Vec<f64>> = statement.split(|words, _| parsed(words));
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
    let wrong = |expected| FormatError::line(line, word, expected);
    let index: i64 = (vertex.parse()).map_err(|_| wrong("the index of a vertex"))?;
    if index >= 0 {
        return Ok(index);
    }
    let resolved = index.checked_add(so_far as i64 + 1);
    let resolved = resolved.filter(|&v| v >= 1);
    resolved.ok_or_else(|| wrong("a relative index of a vertex above"))
}

/// The text with other coordinates of vertices, and with normals to fit them.
pub(super) fn rewrite(bytes: &[u8], moved: &TriangleMesh) -> Result<Vec<u8>, FormatError> {
    let mut normals = normals(bytes, moved)?.into_iter();
    let mut vertices = moved.vertices.iter();
    let mut out = Vec::with_capacity(bytes.len());
    for statement in statements(bytes) {
        let (keyword, numbers) = match keyword_of(statement.line) {
            Some("v") => ("v", vertices.next().copied()),
            Some("vn") => ("vn", normals.next().flatten()),
            _ => ("", None),
        };
        let Some([x, y, z]) = numbers else {
            out.extend_from_slice(statement.line);
            continue;
        };
        out.extend_from_slice(format!("{keyword} {x} {y} {z}").as_bytes());
        // Weights and colours.
        statement.split(|words, comment| {
            let behind = words
                .skip(4)
                .chain(Some(comment).filter(|text| !text.is_empty()));
            for word in behind {
                out.push(b' ');
                out.extend_from_slice(word.as_bytes());
            }
        });
        out.extend_from_slice(line_end(statement.line));
    }
    Ok(out)
}

/// For every normal in the text the unit normal of the corners that refer to it, which tells flat faces from smooth ones; none where no face
/// with an area does. They point to the side to which most of the old ones do, whichever way the faces wind.
fn normals(bytes: &[u8], moved: &TriangleMesh) -> Result<Vec<Option<[f64; 3]>>, FormatError> {
    let found = Statements::of(bytes)?;
    let areas = found.normal_areas(&found.vertices).into_iter();
    let side = side_of(areas.zip(found.normals.iter().copied()));
    // Without the sign of zero.
    let unit = |sum: Vector| Some((side * sum.try_normalize()? + Vector::ZERO).to_array());
    let areas = found.normal_areas(&moved.vertices);
    Ok(areas.into_iter().map(unit).collect())
}
