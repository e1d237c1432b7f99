//! What a killed process leaves behind.

use std::fs;
use std::path::{Path, PathBuf};

use crate::{Error, Step};

/// How the names of temporary files begin.
pub const TEMPORARY_PREFIX: &str = ".partial-";

/// The temporary files directly in a folder, sorted by name.
///
/// They are stale only if no process is writing there now.
///
/// # Errors
/// [`Error`] with [`Step::Search`].
pub fn stale(folder: impl AsRef<Path>) -> Result<Vec<PathBuf>, Error> {
    let folder = folder.as_ref();
    let search = || {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name();
            let ours = name
                .as_encoded_bytes()
                .starts_with(TEMPORARY_PREFIX.as_bytes());
            if ours && entry.file_type()?.is_file() {
                found.push(entry.path());
            }
        }
        found.sort();
        Ok(found)
    };
    search().map_err(|source| Error {
        step: Step::Search,
        path: folder.into(),
        source,
    })
}

/// Removes the temporary files directly in a folder and returns them.
///
/// To be called only while no process writes there, or its file vanishes under its hands.
///
/// # Errors
/// [`Error`] with [`Step::Search`] or [`Step::Remove`].
pub fn remove_stale(folder: impl AsRef<Path>) -> Result<Vec<PathBuf>, Error> {
    let found = stale(folder)?;
    for path in &found {
        fs::remove_file(path).map_err(|source| Error {
            step: Step::Remove,
            path: path.clone(),
            source,
        })?;
    }
    Ok(found)
}
