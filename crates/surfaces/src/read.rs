//! Mesh files in.

pub(crate) mod error;
mod obj;
mod off;
mod ply;
mod stl;
mod text;

use std::path::Path;

use crate::format::Format;
use crate::vector::Vector;
use crate::{Error, TriangleMesh};
use error::FormatError;

/// Reads a mesh; the extension (`.obj`, `.off`, `.ply`, `.stl`) tells the format.
///
/// - OBJ: `v` and `f`, with relative indices, lines that go on behind a backslash, and comments; groups, normals, colours and everything else are
///   passed over.
/// - OFF: text, also with normals, colours and texture coordinates of vertices (`STCNOFF`), and colours of faces, which are passed over.
/// - PLY: ASCII and binary of both byte orders; `x y z` of `vertex`, with `nx ny nz` if they are
///   there, and `vertex_indices` (or `vertex_index`) of `face` and of `tristrips`, where -1 ends a strip; everything else is passed over.
/// - STL: binary and ASCII; corners with exactly equal coordinates become one vertex. Bytes behind the
///   facets are passed over.
///
/// Text may begin with the byte order mark of UTF-8.
///
/// Polygons are cut into triangles from their first corner, which is right for convex ones.
///
/// Memory: at most 64 times the size of the file and 1 MiB, whatever its header announces (the most
/// is taken by binary PLY files with elements of a byte; usual files take two to six times their
/// size).
///
/// # Errors
/// [`Error::UnknownFormat`]; [`Error::Io`] if the file cannot be read; [`Error::Format`] for
/// everything that is wrong with its contents. Whether the surface is closed is another matter: see
/// [`ClosedMesh`](crate::ClosedMesh).
pub fn read(path: impl AsRef<Path>) -> Result<TriangleMesh, Error> {
    let path = path.as_ref();
    // Before a long file is read in vain.
    Format::of(path)?;
    let bytes = files::read(path)?;
    decode(&bytes, path)
}

/// The mesh in the bytes of a file of that name; see [`read`].
///
/// # Errors
/// [`Error::UnknownFormat`] and [`Error::Format`].
pub fn decode(bytes: &[u8], path: impl AsRef<Path>) -> Result<TriangleMesh, Error> {
    if bytes.is_empty() {
        return by_format(path.as_ref(), |_| Err(FormatError::Empty));
    }
    by_contents(bytes, path.as_ref(), |format, bytes| match format {
        Format::Obj => obj::decode(bytes),
        Format::Off => off::decode(bytes),
        Format::Ply => ply::decode(bytes),
        Format::Stl => stl::decode(bytes),
    })
}

/// The colours (red, green, blue, from 0 to 255) of the vertices in a mesh file, in the order of [`decode`]: `red`, `green` and `blue`
/// of PLY, as integers or as parts of 1, three numbers from 0 to 1 after the coordinates in OBJ, and the colours of COFF. `None` where a vertex has none, as
/// in all STL files.
///
/// # Errors
/// [`Error::UnknownFormat`], and [`Error::Format`] for bytes that are no such mesh.
pub fn vertex_colours(bytes: &[u8], path: impl AsRef<Path>) -> Result<Option<Vec<[u8; 3]>>, Error> {
    by_contents(bytes, path.as_ref(), |format, bytes| match format {
        Format::Obj => Ok(obj::colours(bytes)),
        Format::Off => off::colours(bytes),
        Format::Ply => ply::colours(bytes),
        Format::Stl => Ok(None),
    })
}

/// The bytes of a mesh file with the vertices moved to those of `moved`, which has the vertices and faces that [`decode`] finds in
/// `bytes`, in the same order.
///
/// Everything else stays as it is: polygons, texture coordinates, colours, groups, materials, attributes, comments. Normals in the
/// file are made anew from the faces that refer to them, weighted by area in OBJ and by angle in PLY, on the side of the old ones.
/// Coordinates are rounded to the type that the file has.
///
/// # Errors
/// [`Error::UnknownFormat`]; [`Error::Format`] for bytes that are no such mesh, and for a PLY file whose coordinates are integers.
pub fn rewrite(
    bytes: &[u8],
    path: impl AsRef<Path>,
    moved: &TriangleMesh,
) -> Result<Vec<u8>, Error> {
    let mark = text::mark(bytes);
    let rewritten = by_contents(bytes, path.as_ref(), |format, bytes| match format {
        Format::Obj => obj::rewrite(bytes, moved),
        Format::Off => off::rewrite(bytes, moved),
        Format::Ply => ply::rewrite(bytes, moved),
        Format::Stl => Ok(stl::rewrite(bytes, moved)),
    })?;
    Ok([mark, &rewritten].concat())
}

/// Whether these are all facets of a binary STL file.
pub fn is_binary_stl(bytes: &[u8]) -> bool {
    stl::is_binary(bytes)
}

/// What a reader of the format makes of the contents of a file of that name, without the mark of a text.
fn by_contents<T>(
    bytes: &[u8],
    path: &Path,
    read: impl FnOnce(Format, &[u8]) -> Result<T, FormatError>,
) -> Result<T, Error> {
    by_format(path, |format| {
        let is_binary = format == Format::Stl && stl::is_binary(bytes);
        let bytes = if is_binary {
            bytes
        } else {
            text::without_mark(bytes)?
        };
        read(format, bytes)
    })
}

/// What a reader of the format makes of a file of that name.
fn by_format<T>(
    path: &Path,
    read: impl FnOnce(Format) -> Result<T, FormatError>,
) -> Result<T, Error> {
    read(Format::of(path)?).map_err(|problem| Error::Format {
        path: path.into(),
        problem,
    })
}

/// 1, or -1 if the normals in a file, the second ones, point against most of those that its faces have by the way they wind.
fn side_of(normals: impl Iterator<Item = (Vector, Vector)>) -> f64 {
    let agreement: f64 = normals
        .map(|(by_faces, read)| by_faces.normalize_or_zero().dot(read.normalize_or_zero()))
        .sum();
    if agreement < 0.0 { -1.0 } else { 1.0 }
}

/// The normals of moved vertices, on the side of most of those in the file.
fn normals_like(file: TriangleMesh, moved: &TriangleMesh) -> Vec<[f64; 3]> {
    let by_faces = file.vertex_normals().into_iter().map(Vector::from_array);
    let read = file.normals.into_iter().flatten().map(Vector::from_array);
    let side = side_of(by_faces.zip(read));
    let mut normals = moved.vertex_normals();
    for normal in &mut normals {
        *normal = normal.map(|x| side * x);
    }
    normals
}

/// A part of 1 in 255 steps.
fn level(part: f64) -> u8 {
    (255.0 * part.clamp(0.0, 1.0)).round() as u8
}

/// The three coordinates that follow in a line of text.
fn position<'a>(
    mut words: impl Iterator<Item = &'a str>,
    line: usize,
    vertex: usize,
) -> Result<[f64; 3], FormatError> {
    let mut position = [0.0; 3];
    for coordinate in &mut position {
        let word = words.next().unwrap_or_default();
        let wrong = |_| FormatError::line(line, word, "a coordinate");
        *coordinate = word.parse().map_err(wrong)?;
    }
    finite(position, vertex)
}

/// The position of a vertex, if all its coordinates are numbers.
fn finite(position: [f64; 3], vertex: usize) -> Result<[f64; 3], FormatError> {
    match position.into_iter().find(|v| !v.is_finite()) {
        None => Ok(position),
        Some(value) => Err(FormatError::NonFinite { vertex, value }),
    }
}

/// Polygons cut into triangles, with their indices checked.
struct Polygons {
    faces: Vec<[u32; 3]>,
    vertices: usize,
    first: u8,
}

impl Polygons {
    fn new(vertices: usize, first: u8) -> Result<Self, FormatError> {
        if u32::try_from(vertices).is_err() {
            return Err(FormatError::TooManyVertices { vertices });
        }
        Ok(Self {
            faces: Vec::new(),
            vertices,
            first,
        })
    }

    /// Adds face number `face`; its corners are counted from `self.first`.
    fn push(&mut self, face: usize, corners: &[i64]) -> Result<(), FormatError> {
        let index = |&index: &i64| {
            let vertex = index.checked_sub(i64::from(self.first));
            let vertex = vertex.and_then(|v| u32::try_from(v).ok());
            vertex
                .filter(|&v| (v as usize) < self.vertices)
                .ok_or(FormatError::Index {
                    face,
                    index,
                    vertices: self.vertices,
                    first: self.first,
                })
        };
        if corners.len() < 3 {
            return Err(FormatError::Corners {
                face,
                corners: corners.len(),
                expected: "a face needs at least three",
            });
        }
        let first = index(&corners[0])?;
        for pair in corners[1..].windows(2) {
            self.faces.push([first, index(&pair[0])?, index(&pair[1])?]);
        }
        Ok(())
    }

    fn finish(self) -> Result<Vec<[u32; 3]>, FormatError> {
        if self.faces.is_empty() {
            let vertices = self.vertices;
            return Err(FormatError::NoFaces { vertices });
        }
        Ok(self.faces)
    }
}
