//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

/// Errors of pages and what they are made of, each saying which file or number is at fault.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    #[error("{0} is missing")]
    Missing(String),
    /// A file that cannot be read, or a page that cannot be written.
    File(#[from] files::Error),
    #[error("{name} is no intact PNG or SVG picture: {problem}")]
    Picture { name: String, problem: String },
    /// A view that cannot be taken.
    Render(#[from] render::Error),
    #[error("{name} is no table: {problem}")]
    Table { name: String, problem: String },
    #[error("{name} is not {expected}: {problem}")]
    Json {
        name: String,
        expected: &'static str,
        problem: String,
    },
    /// The surface of this label has no faces.
    #[error("the surface {0:?} is empty: there is nothing to show")]
    Empty(String),
    #[error("the surface {label:?} cannot be shown: {source}")]
    Surface {
        label: String,
        source: Box<surfaces::Error>,
    },
}

/// Shorthand used throughout the crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;
