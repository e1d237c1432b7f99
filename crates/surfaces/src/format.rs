//! The formats, by extension.

use std::path::Path;

use geometry::UpAxis;

use crate::Error;

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Obj,
    Ply,
    Stl,
}

impl Format {
    /// From the extension, in either case.
    pub(crate) fn of(path: &Path) -> Result<Self, Error> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        match extension.to_ascii_lowercase().as_str() {
            "obj" => Ok(Self::Obj),
            "ply" => Ok(Self::Ply),
            "stl" => Ok(Self::Stl),
            _ => Err(Error::UnknownFormat { path: path.into() }),
        }
    }
}

/// The axis that points up in most meshes of that format, by the extension: `y` in OBJ files, which
/// come from animation, `z` in PLY and STL files, which come from scanners and for printers.
///
/// # Errors
/// [`Error::UnknownFormat`].
pub fn usual_up_axis(path: impl AsRef<Path>) -> Result<UpAxis, Error> {
    Ok(match Format::of(path.as_ref())? {
        Format::Obj => UpAxis::Y,
        Format::Ply | Format::Stl => UpAxis::Z,
    })
}
