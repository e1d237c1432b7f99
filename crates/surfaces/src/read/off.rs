//! OFF of Geomview, as text.
//!
//! <http://www.geomview.org/docs/html/OFF.html>. Every vertex and every face has a line of its own, as in all files that programs write.

use super::text::{line_end, split_comment};
use super::{FormatError, Polygons, level, normals_like, position};
use crate::TriangleMesh;

/// What the first lines announce.
struct Header {
    vertices: usize,
    faces: usize,
    /// What vertices have behind their coordinates.
    has_normals: bool,
    has_colours: bool,
}

/// The lines that are neither blank nor a comment, with their numbers from one.
fn rows(bytes: &[u8]) -> impl Iterator<Item = (usize, String)> {
    let lines = bytes.split_inclusive(|&byte| byte == b'\n').enumerate();
    lines.filter_map(|(number, line)| {
        let text = String::from_utf8_lossy(line);
        let row = split_comment(&text).0;
        is_row(row).then(|| (number + 1, row.to_owned()))
    })
}

fn is_row(line: &str) -> bool {
    !split_comment(line).0.trim().is_empty()
}

impl Header {
    /// The header, of which the rows behind it remain.
    fn parse(rows: &mut impl Iterator<Item = (usize, String)>) -> Result<Self, FormatError> {
        let (mut line, mut row) = rows.next().ok_or(FormatError::EndOfText(1, "OFF"))?;
        let mut header = Self {
            vertices: 0,
            faces: 0,
            has_normals: false,
            has_colours: false,
        };
        // Files that begin with the counts are OFF, too.
        let word = row.split_whitespace().next().unwrap_or_default().to_owned();
        // Some have no blank before the counts.
        let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
        if let Some(kind) = letters.strip_suffix("OFF") {
            header.add_kind(kind, line, &word)?;
            row = row.trim_start()[letters.len()..].trim().to_owned();
            if row.starts_with("BINARY") {
                return Err(FormatError::BinaryOff);
            }
        }
        if row.is_empty() {
            let counts = FormatError::EndOfText(line, "the numbers of vertices and faces");
            (line, row) = rows.next().ok_or(counts)?;
        }
        let mut counts = row.split_whitespace().map(str::parse);
        let (Some(Ok(vertices)), Some(Ok(faces))) = (counts.next(), counts.next()) else {
            let expected = "OFF, or the numbers of vertices, faces and edges,";
            return Err(FormatError::line(line, &row, expected));
        };
        (header.vertices, header.faces) = (vertices, faces);
        Ok(header)
    }

    /// Reads the letters before `OFF`.
    fn add_kind(&mut self, kind: &str, line: usize, word: &str) -> Result<(), FormatError> {
        let mut rest = kind.strip_prefix("ST").unwrap_or(kind);
        for (letter, has) in [('C', &mut self.has_colours), ('N', &mut self.has_normals)] {
            let without = rest.strip_prefix(letter);
            *has = without.is_some();
            rest = without.unwrap_or(rest);
        }
        match rest {
            "" => Ok(()),
            "4" | "n" | "4n" => Err(FormatError::Dimension(word.to_owned())),
            _ => Err(FormatError::line(line, word, "OFF")),
        }
    }

    /// The lines of the vertices.
    fn vertices(
        &self,
        rows: &mut impl Iterator<Item = (usize, String)>,
        mut each: impl FnMut(
            usize,
            usize,
            &mut std::str::SplitWhitespace<'_>,
        ) -> Result<(), FormatError>,
    ) -> Result<usize, FormatError> {
        let mut last = 1;
        for vertex in 0..self.vertices {
            let end = FormatError::EndOfText(last, "a vertex");
            let (line, row) = rows.next().ok_or(end)?;
            each(vertex, line, &mut row.split_whitespace())?;
            last = line;
        }
        Ok(last)
    }
}

/// Three numbers that nothing needs; zero where they are none.
fn numbers<'a>(words: &mut impl Iterator<Item = &'a str>) -> [f64; 3] {
    [(); 3].map(|()| {
        words
            .next()
            .and_then(|word| word.parse().ok())
            .unwrap_or(0.0)
    })
}

fn index(line: usize, word: &str, expected: &'static str) -> Result<i64, FormatError> {
    let wrong = |_| FormatError::line(line, word, expected);
    word.parse().map_err(wrong)
}

/// Adds the indices in a line until there are so many.
fn take_corners<'a>(
    line: usize,
    words: impl Iterator<Item = &'a str>,
    count: usize,
    corners: &mut Vec<i64>,
) -> Result<(), FormatError> {
    for word in words.take(count - corners.len()) {
        corners.push(index(line, word, "the index of a vertex")?);
    }
    Ok(())
}

pub(super) fn decode(bytes: &[u8]) -> Result<TriangleMesh, FormatError> {
    let mut rows = rows(bytes);
    let header = Header::parse(&mut rows)?;
    let mut mesh = TriangleMesh::default();
    let mut normals = Vec::new();
    let mut last = header.vertices(&mut rows, |vertex, line, words| {
        mesh.vertices.push(position(&mut *words, line, vertex)?);
        if header.has_normals {
            normals.push(numbers(words));
        }
        Ok(())
    })?;
    let mut polygons = Polygons::new(header.vertices, 0)?;
    let mut corners = Vec::new();
    for face in 0..header.faces {
        let end = FormatError::EndOfText(last, "a face");
        let (mut line, mut row) = rows.next().ok_or(end)?;
        corners.clear();
        let mut words = row.split_whitespace();
        let count = "the number of corners of a face";
        let count = index(line, words.next().unwrap_or_default(), count)?;
        let count = usize::try_from(count).unwrap_or(0);
        take_corners(line, words, count, &mut corners)?;
        // What is behind the corners is the colour, but they may go on in the next lines.
        while corners.len() < count {
            let end = FormatError::EndOfText(line, "the index of a vertex");
            (line, row) = rows.next().ok_or(end)?;
            take_corners(line, row.split_whitespace(), count, &mut corners)?;
        }
        last = line;
        polygons.push(face, &corners)?;
    }
    mesh.faces = polygons.finish()?;
    let usable = header.has_normals && normals.as_flattened().iter().all(|v: &f64| v.is_finite());
    mesh.normals = usable.then_some(normals);
    Ok(mesh)
}

/// The colours of the vertices of COFF: whole numbers up to 255, or parts of 1.
pub(super) fn colours(bytes: &[u8]) -> Result<Option<Vec<[u8; 3]>>, FormatError> {
    let mut rows = rows(bytes);
    let header = Header::parse(&mut rows)?;
    if !header.has_colours {
        return Ok(None);
    }
    let before = if header.has_normals { 6 } else { 3 };
    let (mut whole, mut parts) = (Some(Vec::new()), Some(Vec::new()));
    header.vertices(&mut rows, |_, _, words| {
        let words: Vec<&str> = words.skip(before).take(3).collect();
        push_colour(&mut whole, &words, |word| word.parse().ok());
        push_colour(&mut parts, &words, |word| word.parse().ok().map(level));
        Ok(())
    })?;
    Ok(whole.or(parts))
}

/// Adds a colour, if all have been read so far and this one can be.
fn push_colour(
    colours: &mut Option<Vec<[u8; 3]>>,
    words: &[&str],
    read: impl Fn(&str) -> Option<u8>,
) {
    let values: Option<Vec<u8>> = words.iter().map(|word| read(word)).collect();
    let colour = values.and_then(|values| <[u8; 3]>::try_from(values).ok());
    match (colours.as_mut(), colour) {
        (Some(colours), Some(colour)) => colours.push(colour),
        _ => *colours = None,
    }
}

/// The text with other coordinates of vertices, and with normals to fit them.
pub(super) fn rewrite(bytes: &[u8], moved: &TriangleMesh) -> Result<Vec<u8>, FormatError> {
    let mut behind = rows(bytes);
    let header = Header::parse(&mut behind)?;
    let first = behind.next().map_or(0, |(line, _)| line);
    let normals = header
        .has_normals
        .then(|| Ok(normals_like(decode(bytes)?, moved)))
        .transpose()?;
    let mut out = Vec::with_capacity(bytes.len());
    let mut vertex = 0;
    for (number, line) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
        let text = String::from_utf8_lossy(line);
        let position = moved.vertices.get(vertex);
        let (Some([x, y, z]), true) = (position, number + 1 >= first && is_row(&text)) else {
            out.extend_from_slice(line);
            continue;
        };
        let normal = normals.as_ref().and_then(|normals| normals.get(vertex));
        let (mut new, read) = match normal {
            Some([nx, ny, nz]) => (format!("{x} {y} {z} {nx} {ny} {nz}"), 6),
            None => (format!("{x} {y} {z}"), 3),
        };
        // Colours and texture coordinates.
        let (row, comment) = split_comment(&text);
        let behind = row.split_whitespace().skip(read);
        for word in behind.chain(Some(comment).filter(|text| !text.is_empty())) {
            new = new + " " + word;
        }
        out.extend_from_slice(new.as_bytes());
        out.extend_from_slice(line_end(line));
        vertex += 1;
    }
    Ok(out)
}
