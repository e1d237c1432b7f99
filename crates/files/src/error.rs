//! The one error type of the crate.

use std::io;
use std::path::PathBuf;

/// Something that could not be done to a file or folder. A file that was to be replaced is
/// untouched, except if its folder could not be flushed: then the new one is in place, but a power
/// failure may undo it.
#[derive(Debug, thiserror::Error)]
#[error("could not {action} {}: {source}", path.display())]
pub struct Error {
    /// What was attempted, in words that a path can follow.
    pub action: &'static str,
    /// The file as its caller knows it, not the temporary one.
    pub path: PathBuf,
    /// What the operating system, or the producer of the content, said.
    pub source: io::Error,
}

impl Error {
    /// For `map_err`: the attempt that failed, such as `read`, and its file.
    pub fn of(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self {
            action,
            path,
            source,
        }
    }
}
