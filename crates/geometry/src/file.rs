//! Files that are either complete or absent.

use std::io::{self, Write};
use std::path::Path;

use crate::Error;

/// Writes a file through a temporary one in the same folder (see [`files::write_atomically`]).
///
/// # Errors
/// [`Error::Io`] with the step that failed.
pub fn write_atomically(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    files::write_atomically(path, write).map_err(|error| Error::Io {
        action: error.action,
        path: error.path,
        source: error.source,
    })
}
