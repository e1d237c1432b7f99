//! Image files in.

pub(crate) mod colours;
pub(crate) mod error;
mod jpeg;
mod orientation;
mod png;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::image::{LARGEST_IMAGE, pixels};
use crate::{Error, Image};
use error::FormatError;
use orientation::Orientation;

/// Largest image file, in bytes: eight bytes a pixel, as many as the largest image has at 16 bits
/// without compression.
const LARGEST_FILE: u64 = 8 * LARGEST_IMAGE as u64;

/// Reads an image: PNG or JPEG, told by its first bytes and not by its extension.
///
/// - PNG: all colour types and depths, interlaced or not, with transparency; of an animation the
///   first picture.
/// - JPEG: baseline and progressive, grey, YCbCr, RGB, CMYK and YCCK with 8 bits.
///
/// Colours become grey by the luma of JPEG, `0.299 R + 0.587 G + 0.114 B` of the stored values.
/// Colour profiles are passed over. Images that Exif says are turned or mirrored are set upright.
///
/// Memory: at most [`LARGEST_IMAGE`] pixels are read, with up to 16 bytes each while decoding; beside
/// them four times the size of the file, which is at most eight bytes for each of these pixels, and
/// 32 MiB. The size is checked before anything is decoded.
///
/// # Errors
/// [`Error::Geometry`] if the file cannot be read; [`Error::Format`] for everything that is wrong
/// with its contents.
pub fn read(path: impl AsRef<Path>) -> Result<Image, Error> {
    let path = path.as_ref();
    let io = |source| geometry::Error::Io {
        action: "read",
        path: path.into(),
        source,
    };
    let format = |problem| Error::Format {
        path: path.into(),
        problem,
    };
    let file = File::open(path).map_err(io)?;
    let mut length = file.metadata().map_err(io)?.len();
    let mut bytes = Vec::new();
    if length <= LARGEST_FILE {
        // What is no ordinary file does not tell its length.
        let read = file.take(LARGEST_FILE + 1).read_to_end(&mut bytes);
        length = read.map_err(io)? as u64;
    }
    if length > LARGEST_FILE {
        return Err(format(FormatError::TooLong {
            limit: LARGEST_FILE,
        }));
    }
    decode(&bytes).map_err(format)
}

/// The image in the bytes of a file; see [`read`].
///
/// # Errors
/// Whatever is wrong with them, in one line.
pub fn decode(bytes: &[u8]) -> Result<Image, FormatError> {
    let (pixels, orientation) = match bytes {
        [] => return Err(FormatError::Empty),
        [0x89, b'P', b'N', b'G', ..] => png::decode(bytes)?,
        [0xff, 0xd8, 0xff, ..] => jpeg::decode(bytes)?,
        _ => {
            return Err(FormatError::UnknownFormat {
                start: bytes.iter().take(8).copied().collect(),
            });
        }
    };
    let size = orientation.size(pixels.size);
    let [grey, opacity] =
        [Some(pixels.grey), pixels.opacity].map(|v| v.map(|v| orientation.apply(pixels.size, v)));
    let image = Image::new(size[0], size[1], grey.unwrap_or_default(), opacity);
    Ok(image.expect("the decoders check the size and fill all pixels"))
}

/// What the decoders give.
struct Pixels {
    size: [u32; 2],
    grey: Vec<u16>,
    opacity: Option<Vec<u16>>,
}

/// The number of pixels, if it is accepted.
fn checked(width: u32, height: u32) -> Result<usize, FormatError> {
    pixels(width, height).ok_or(FormatError::Size {
        width,
        height,
        limit: LARGEST_IMAGE,
    })
}

/// The luma `0.299 R + 0.587 G + 0.114 B`, rounded.
fn luma([r, g, b]: [u16; 3]) -> u16 {
    let sum = 299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b);
    ((sum + 500) / 1000) as u16
}

/// From 8 to 16 bits: 255 becomes 65535.
fn widen(value: u8) -> u16 {
    257 * u16::from(value)
}

/// The message of a library.
fn said(message: &str) -> String {
    files::shortened(message, 160)
}
