//! What can be wrong with a file.

/// What is wrong with the contents of an image file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// Nothing in it.
    #[error("the file is empty")]
    Empty,
    /// More bytes than an image can need.
    #[error("it has more than {limit} bytes; make the image smaller")]
    TooLong {
        /// Largest number of bytes.
        limit: u64,
    },
    /// The first bytes are not those of a known format.
    #[error(
        "it begins with the bytes {start:02x?}, which is neither PNG nor JPEG; save it as one of \
         these"
    )]
    UnknownFormat {
        /// Up to eight bytes.
        start: Vec<u8>,
    },
    /// No pixels, or more than are accepted.
    #[error("it has {width} x {height} pixels, and may have 1 to {limit}; make it smaller")]
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Largest number of pixels.
        limit: usize,
    },
    /// What the PNG library says.
    #[error("damaged or truncated PNG: {message}")]
    Png {
        /// In one line, shortened.
        message: String,
    },
    /// What the JPEG library says.
    #[error("damaged, truncated or unusual JPEG: {message}; try saving it as PNG")]
    Jpeg {
        /// In one line, shortened.
        message: String,
    },
}
