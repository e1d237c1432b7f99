//! What can be wrong with a file.

#![allow(missing_docs, reason = "messages and names say it")]

/// What is wrong with a VTI file. Texts from the file are shortened.
#[derive(Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VtiError {
    /// The XML cannot be parsed.
    #[error("it is not well-formed XML: {reason}")]
    Xml { reason: String },
    /// More elements, or more attributes, than such files have.
    #[error(
        "it has {count} elements or attributes, and may have {limit}: not a file of VTK image data"
    )]
    TooManyElements {
        /// How many, counted by the characters `<` and `=`.
        count: usize,
        limit: usize,
    },
    /// More values than are accepted.
    #[error(
        "it has {arrays} arrays of {nodes} values each, and may have {limit} values in all; save \
         fewer arrays at a time, without compression"
    )]
    TooManyValues {
        arrays: usize,
        nodes: u64,
        limit: u64,
    },
    /// An element is missing.
    #[error("there is no element {element}: not a file of VTK image data")]
    NoElement { element: &'static str },
    /// An attribute is missing or has a value that is not understood.
    #[error("attribute {attribute} of {element} is {value:?}, but must be {requirement}")]
    Attribute {
        element: &'static str,
        attribute: &'static str,
        /// Its value; empty if it is missing.
        value: String,
        requirement: &'static str,
    },
    /// The image is in several pieces, or in none.
    #[error("the image has {count} pieces; save it as one file with one piece")]
    Pieces { count: usize },
    /// The piece is not the whole image.
    #[error("the piece spans nodes {piece}, but the image {whole}; save the whole image")]
    PartialPiece {
        /// First and last node of the piece along x, y and z, as written.
        piece: String,
        /// Of the image.
        whole: String,
    },
    /// The image is not a cube of the wanted dimension.
    #[error(
        "the image has {nodes:?} nodes along x, y, z; needed are equal numbers (of two or more) \
         along the first {dimension} and one along the rest"
    )]
    NotCubical {
        /// Nodes along x, y and z.
        nodes: [u64; 3],
        dimension: usize,
    },
    /// The nodes are not equally far apart in all directions.
    #[error("the spacing is {spacing:?}, but must be positive and equal along the used axes")]
    Spacing {
        /// Along x, y and z.
        spacing: [f64; 3],
    },
    /// There are no point data.
    #[error("there are no point data{}", if *.cell_data {
        ", only cell data: convert them (`Cell Data to Point Data` in ParaView)"
    } else {
        ""
    })]
    NoPointData { cell_data: bool },
    /// An array is not scalar.
    #[error("array {name:?} has {components} components; save scalar arrays alone")]
    Components { name: String, components: String },
    /// Two arrays have one name, or one has none.
    #[error("array name {name:?} is empty or used twice")]
    Name { name: String },
    /// The data of an array are shorter or longer than its nodes need.
    #[error("array {name:?} has {found} bytes (as text: numbers) where {expected} are needed")]
    Length {
        name: String,
        expected: u64,
        found: u64,
    },
    /// The data of an array cannot be decoded.
    #[error("the data of array {name:?} cannot be decoded: {reason}")]
    Data { name: String, reason: &'static str },
}
