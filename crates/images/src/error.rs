//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

use crate::limits::{LARGEST_FILE, LARGEST_IMAGE, LARGEST_OUTLINE};

/// Errors of images, outlines, placement and drawings, each with the numbers needed to act on it.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    #[error("{path} cannot be read as an image: {problem}", path = path.display())]
    Format { path: PathBuf, problem: FormatError },
    /// Grids and fields, and numbers outside their range.
    Geometry(#[from] geometry::Error),
    /// The operating system refused.
    Io(#[from] files::Error),
    /// Pictures and their encoding.
    Picture(#[from] render::Error),
    #[error(
        "an image of {} x {} pixels cannot be used; it needs at least one pixel and may have up to {LARGEST_IMAGE}",
        _0[0], _0[1]
    )]
    ImageSize([u32; 2]),
    #[error("{} x {} pixels were announced, but {actual} {values} given", size[0], size[1])]
    PixelCount {
        size: [u32; 2],
        /// What is given: grey values or opacities.
        values: &'static str,
        actual: usize,
    },
    #[error(
        "{inside} is inside: {inside} is {side}; {quantity} ranges from {low:.4} to {high:.4}, so choose \
         a threshold in between, or another side"
    )]
    OneSided {
        /// "everything" or "nothing".
        inside: &'static str,
        side: String,
        quantity: &'static str,
        low: f64,
        high: f64,
    },
    #[error(
        "the outline would have about {segments} segments, more than {LARGEST_OUTLINE}: this is noise and \
         no shape; blur the image or make it smaller"
    )]
    Noise { segments: usize },
    #[error(
        "the phase field has no interface: its values range from {low:.4} to {high:.4}, and do \
         not change sign"
    )]
    NoInterface { low: f64, high: f64 },
}

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
    #[error(
        "its {} x {} pixels take {bytes} bytes, twice as many while they are decoded, and there may be {}; save it with 8 or 16 bits for a value, \
         or make it smaller",
        size[0], size[1], 24 * LARGEST_IMAGE
    )]
    Deep {
        size: [u32; 2],
        /// Bytes of all pixels.
        bytes: u64,
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
