//! Files that options name.

use crate::prelude::*;

/// The extensions of meshes, the usual one first.
pub const MESHES: [&str; 4] = ["ply", "obj", "stl", "off"];

/// The path of a file from wherever the program may run later.
///
/// # Errors
/// Where the current folder is not known.
pub fn absolute(path: impl AsRef<Path>) -> Result<PathBuf> {
    let path = path.as_ref();
    Ok(std::path::absolute(path).map_err(files::Error::of("find", path))?)
}

/// The extension of a file in lower case.
pub fn extension(path: &Path) -> String {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    extension.to_ascii_lowercase()
}
