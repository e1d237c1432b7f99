//! What can be wrong with a file.

#![allow(missing_docs, reason = "messages and names say it")]

/// What is wrong with an NPY file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NpyError {
    /// The magic bytes are missing.
    #[error("this is not an NPY file (it does not begin with \\x93NUMPY)")]
    NotNpy,
    /// A version of the format that does not exist yet.
    #[error("NPY format {major}.{minor} is not supported; use 1.0, 2.0 or 3.0")]
    Version { major: u8, minor: u8 },
    /// The header is longer than that of any array.
    #[error("the header has {length} bytes, and may have {limit}")]
    HeaderLength { length: usize, limit: usize },
    /// The header is not the dictionary that the format prescribes.
    #[error("the header is malformed: {reason}")]
    Header { reason: String },
    /// The element type is not a floating-point number of 4 or 8 bytes.
    #[error("elements have type {found}; save the array as float64 (float32 is accepted too)")]
    DataType {
        /// The type as written in the header, shortened.
        found: String,
    },
    /// The array has the wrong number of axes.
    #[error("the array has shape {shape:?}, but {expected} axes are needed")]
    Rank { expected: usize, shape: Vec<u64> },
    /// The sides of the array differ.
    #[error("the array has shape {shape:?}, but all its sides must be equal")]
    NotCubical { shape: Vec<u64> },
    /// The file ends early, or goes on after the data.
    #[error("the file has {found} bytes where {expected} are needed: truncated, or not one array")]
    Length {
        /// Bytes according to the header; saturates at `u64::MAX`.
        expected: u64,
        found: u64,
    },
    /// A value is NaN or infinite.
    #[error("element {index} (row-major) is {value}; all values must be finite")]
    NonFinite { index: usize, value: f64 },
}
