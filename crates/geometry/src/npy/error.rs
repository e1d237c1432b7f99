//! What can be wrong with a file.

#![allow(missing_docs, reason = "messages and names say it")]

/// What is wrong with an NPY file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NpyError {
    #[error("this is not an NPY file (it does not begin with \\x93NUMPY)")]
    NotNpy,
    #[error("NPY format {major}.{minor} is not supported; use 1.0, 2.0 or 3.0")]
    Version { major: u8, minor: u8 },
    #[error("the header has {length} bytes, and may have {limit}")]
    HeaderLength { length: usize, limit: usize },
    #[error("the header is malformed: {reason}")]
    Header { reason: String },
    #[error(
        "elements have type {found}; save a field as float64 or float32, and labels in 3D as integers or bool"
    )]
    DataType {
        /// The type as written in the header, shortened.
        found: String,
    },
    #[error("the array has shape {shape:?}, but {expected} axes are needed")]
    Rank { expected: usize, shape: Vec<u64> },
    #[error("the array has shape {shape:?}, but all its sides must be equal")]
    NotCubical { shape: Vec<u64> },
    #[error("the file has {found} bytes where {expected} are needed: truncated, or not one array")]
    Length {
        /// Bytes according to the header; saturates at `u64::MAX`.
        expected: u64,
        found: u64,
    },
    #[error("element {index} (row-major) is {value}; all values must be finite")]
    NonFinite { index: usize, value: f64 },
}
