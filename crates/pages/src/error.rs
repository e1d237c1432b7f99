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
    /// A rendered picture that cannot be encoded.
    #[error(transparent)]
    Render(#[from] render::Error),
    /// A table that cannot be read.
    #[error("{name} is no table: {problem}")]
    Table {
        /// Name of the table.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A row with another number of cells than there are columns.
    #[error("row {row} of the table {name:?} has {found} cells where there are {expected} columns")]
    RowLength {
        /// Name of the table.
        name: String,
        /// Index of the row, from 0.
        row: usize,
        /// Number of columns.
        expected: usize,
        /// Number of cells.
        found: usize,
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
    /// A link that would leave the folder of the page or the computer.
    #[error(
        "the link {link:?} is not allowed: give a relative path with '/', such as \
         \"cross/errors.svg\""
    )]
    Link {
        /// The link as given.
        link: String,
    },
    /// A sequence or a viewer with nothing to show.
    #[error("{what} {title:?} is empty: give it at least one {item}")]
    Empty {
        /// Sequence or viewer.
        what: &'static str,
        /// Its title.
        title: String,
        /// What it is made of.
        item: &'static str,
    },
    /// A surface without faces.
    #[error("the surface {label:?} has no faces: nothing could be seen")]
    NoFaces {
        /// Label of the surface.
        label: String,
    },
    /// A vertex that is NaN, infinite, or too far away.
    #[error(
        "vertex {vertex} of the surface {label:?} is {position:?}: coordinates must be finite \
         and at most {limit:e}"
    )]
    Vertex {
        /// Label of the surface.
        label: String,
        /// Index of the vertex, from 0.
        vertex: usize,
        /// Its coordinates.
        position: [f64; 3],
        /// Largest magnitude.
        limit: f64,
    },
    /// A face with a vertex that does not exist.
    #[error(
        "face {face} of the surface {label:?} refers to vertex {vertex}, but there are {vertices}"
    )]
    Index {
        /// Label of the surface.
        label: String,
        /// Index of the face, from 0.
        face: usize,
        /// The vertex it refers to.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Another number of normals than of vertices.
    #[error(
        "the surface {label:?} has {normals} normals for {vertices} vertices: every vertex needs \
         one, or the mesh none"
    )]
    Normals {
        /// Label of the surface.
        label: String,
        /// Number of normals.
        normals: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// An angle that is no number, or beyond the poles.
    #[error("the view of {title:?} has {name} {value}, but it must be {requirement}")]
    View {
        /// Title of the viewer.
        title: String,
        /// Azimuth or elevation.
        name: &'static str,
        /// Its value in degrees.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
}

/// Shorthand used throughout the crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;
