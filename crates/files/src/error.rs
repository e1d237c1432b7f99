//! The one error type of the crate.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// A file that could not be written, listed or removed. An old file of that name is untouched,
/// except after [`Step::FlushFolder`]: then the new one is in place, but a power failure may undo it.
#[derive(Debug, thiserror::Error)]
#[error("could not {step} {}: {source}", path.display())]
pub struct Error {
    /// What was attempted.
    pub step: Step,
    /// The file as its caller knows it, not the temporary one; or the folder that was searched.
    pub path: PathBuf,
    /// What the operating system, or the producer of the content, said.
    pub source: io::Error,
}

/// The steps of writing a file, and of removing what an earlier attempt has left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Step {
    /// Making the temporary file.
    Create,
    /// Writing the content.
    Write,
    /// Flushing the content to the disk.
    Flush,
    /// Giving the file its name.
    Rename,
    /// Flushing the folder, which makes the name last.
    FlushFolder,
    /// Searching a folder for stale temporary files.
    Search,
    /// Removing a stale temporary file.
    Remove,
}

impl Step {
    /// The step in words that a path can follow.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Create => "create a file beside",
            Self::Write => "write",
            Self::Flush => "flush to disk",
            Self::Rename => "replace",
            Self::FlushFolder => "flush the folder of",
            Self::Search => "search",
            Self::Remove => "remove",
        }
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}
