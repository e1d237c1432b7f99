//! What can be wrong with a file.

#![allow(missing_docs, reason = "messages and names say it")]

/// What is wrong with the contents of an image file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    #[error("the file is empty")]
    Empty,
    #[error("it has more than {limit} bytes; make the image smaller")]
    TooLong { limit: u64 },
    #[error(
        "it begins with the bytes {start:02x?}, which is none of PNG, JPEG, WebP, GIF, TIFF and \
         BMP; save it as one of these"
    )]
    UnknownFormat { start: Vec<u8> },
    #[error("it has {width} x {height} pixels, and may have 1 to {limit}; make it smaller")]
    Size {
        width: u32,
        height: u32,
        limit: usize,
    },
    /// What the library of the format says.
    #[error("damaged, truncated or unusual {format}: {message}; try saving it as PNG")]
    Damaged {
        format: &'static str,
        message: String,
    },
}

impl FormatError {
    /// The message of a library.
    pub(crate) fn damaged(format: &'static str, message: &str) -> Self {
        // Some messages come in quotation marks.
        let message = files::shortened(message, 160).trim_matches('"').to_owned();
        Self::Damaged { format, message }
    }
}
