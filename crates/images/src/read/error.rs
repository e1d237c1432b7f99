//! What can be wrong with a file.

#![allow(missing_docs, reason = "messages and names say it")]

use super::LARGEST_FILE;
use crate::image::LARGEST_IMAGE;

/// What is wrong with the contents of an image file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    #[error("the file is empty")]
    Empty,
    #[error("it has more than {LARGEST_FILE} bytes; make the image smaller")]
    TooLong,
    #[error(
        "it begins with the bytes {start:02x?}, which is none of PNG, JPEG, WebP, GIF, TIFF and \
         BMP; save it as one of these"
    )]
    UnknownFormat { start: Vec<u8> },
    #[error("it has {} x {} pixels, and may have 1 to {LARGEST_IMAGE}; make it smaller", _0[0], _0[1])]
    Size([u32; 2]),
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
