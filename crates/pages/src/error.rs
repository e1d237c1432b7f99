//! Everything that can go wrong in this crate.

use std::path::PathBuf;

/// Errors of pages and what they are made of, each saying which file or number is at fault.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A figure or folder that should be there.
    #[error("{0} is missing")]
    Missing(String),
    /// A page that cannot be written.
    #[error(transparent)]
    Write(#[from] geometry::Error),
    /// Bytes that are no picture a browser shows, or a damaged one.
    #[error("{name} is no intact PNG or SVG picture: {problem}")]
    Picture {
        /// Name of the picture.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A picture that cannot be encoded, or a view that cannot be taken.
    #[error(transparent)]
    Render(#[from] render::Error),
    /// A table that cannot be read or has rows of different lengths.
    #[error("{name} is no table: {problem}")]
    Table {
        /// Name of the table.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// JSON that is not what it should be.
    #[error("{name} is not {expected}: {problem}")]
    Json {
        /// Name of the file.
        name: String,
        /// What it should hold.
        expected: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// A sequence or a viewer with nothing to show.
    #[error("{what} {title:?} is empty: there is nothing to show")]
    Empty {
        /// Sequence, viewer or surface.
        what: &'static str,
        /// Its title.
        title: String,
    },
    /// A surface with numbers that cannot be drawn.
    #[error("the surface {label:?} cannot be shown: {source}")]
    Surface {
        /// Label of the surface.
        label: String,
        /// What is wrong with it.
        source: Box<surfaces::Error>,
    },
}

/// Shorthand used throughout the crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;
