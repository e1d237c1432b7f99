//! The formats, by extension.

use std::path::Path;

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
