//! Mesh files with other positions of their vertices.

use std::path::Path;

use crate::format::Format;
use crate::read::{obj, ply, stl};
use crate::{Error, TriangleMesh};

/// The bytes of a mesh file with the vertices moved to those of `moved`, which has the vertices and faces that
/// [`decode`](crate::decode) finds in `bytes`, in the same order.
///
/// Everything else stays as it is: polygons, texture coordinates, colours, groups, materials, attributes, comments. Normals in the
/// file are made anew from the faces that refer to them, weighted by area in OBJ and by angle in PLY. Coordinates are rounded to the
/// type that the file has.
///
/// # Errors
/// [`Error::UnknownFormat`]; [`Error::Format`] for bytes that are no such mesh, and for a PLY file whose coordinates are integers.
pub fn rewrite(
    bytes: &[u8],
    path: impl AsRef<Path>,
    moved: &TriangleMesh,
) -> Result<Vec<u8>, Error> {
    let path = path.as_ref();
    let rewritten = match Format::of(path)? {
        Format::Obj => obj::rewrite(bytes, moved),
        Format::Ply => ply::rewrite(bytes, moved),
        Format::Stl => Ok(stl::rewrite(bytes, moved)),
    };
    rewritten.map_err(|problem| Error::Format {
        path: path.into(),
        problem,
    })
}
