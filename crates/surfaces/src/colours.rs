//! The colours of vertices in mesh files.

use std::path::Path;

use crate::Error;
use crate::format::Format;
use crate::read::{obj, ply};

/// The colours (red, green, blue, from 0 to 255) of the vertices in a mesh file, in the order of [`decode`](crate::decode): `red`, `green`
/// and `blue` of PLY, as integers or as parts of 1, and three numbers from 0 to 1 after the coordinates in OBJ. `None` where a vertex
/// has none, as in all STL files.
///
/// # Errors
/// [`Error::UnknownFormat`], and [`Error::Format`] for bytes that are no such mesh.
pub fn vertex_colours(bytes: &[u8], path: impl AsRef<Path>) -> Result<Option<Vec<[u8; 3]>>, Error> {
    let path = path.as_ref();
    let colours = match Format::of(path)? {
        Format::Obj => Ok(obj::colours(bytes)),
        Format::Ply => ply::colours(bytes),
        Format::Stl => Ok(None),
    };
    colours.map_err(|problem| Error::Format {
        path: path.into(),
        problem,
    })
}

/// A part of 1 in 255 steps.
pub(crate) fn level(part: f64) -> u8 {
    (255.0 * part.clamp(0.0, 1.0)).round() as u8
}
