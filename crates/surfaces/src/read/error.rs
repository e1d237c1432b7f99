//! What can be wrong with a file.

#![allow(missing_docs, reason = "messages and names say it")]

/// What is wrong with the contents of a mesh file. Lines are counted from one, all else from zero.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    #[error("the file is empty")]
    Empty,
    #[error("the text is UTF-16; save it as UTF-8")]
    Utf16,
    #[error("binary OFF is not read; save it as text, or as PLY")]
    BinaryOff,
    #[error("{0} is not read: its vertices have four or any number of coordinates; save it as OFF")]
    Dimension(String),
    #[error("line {line} has {found:?} where {expected} is expected")]
    Line {
        line: usize,
        found: String,
        expected: &'static str,
    },
    /// The last line, and what is missing.
    #[error("the file ends in line {0} where {1} is expected: it is truncated")]
    EndOfText(usize, &'static str),
    #[error(
        "the header announces {count} {elements}, which take at least {expected} bytes, but the \
         file has {found}: truncated, or another format"
    )]
    Length {
        elements: String,
        count: u64,
        /// Bytes of the whole file according to the header; saturates at `u64::MAX`.
        expected: u64,
        found: u64,
    },
    #[error("vertex {vertex} has the coordinate {value}; all coordinates must be finite")]
    NonFinite { vertex: usize, value: f64 },
    #[error(
        "face {face} refers to vertex {index}, but the file has {vertices} vertices, the first of \
         which is {first}"
    )]
    Index {
        face: usize,
        index: i64,
        vertices: usize,
        first: u8,
    },
    /// A face with fewer than three corners, or an STL facet with another number than three.
    #[error("face {face} has {corners} corners; {expected}")]
    Corners {
        face: usize,
        corners: usize,
        expected: &'static str,
    },
    #[error("the file has {vertices} vertices and no faces: no mesh, or another format")]
    NoFaces { vertices: usize },
    #[error("{vertices} vertices are more than 32-bit indices can count; use a coarser mesh")]
    TooManyVertices { vertices: usize },
    #[error("the header does not declare {0}")]
    Undeclared(&'static str),
    #[error("the header announces {count} elements {element:?} without properties")]
    NoProperties { element: String, count: usize },
}

impl FormatError {
    /// Something else in a line of text than it should have.
    pub(super) fn line(line: usize, found: &str, expected: &'static str) -> Self {
        let found = files::shortened(found, 60);
        Self::Line {
            line,
            found,
            expected,
        }
    }
}
