//! Image files in.

mod jpeg;

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use render::Picture;

use crate::image::pixels;
use crate::limits::{LARGEST_FILE, LARGEST_IMAGE};
use crate::{Error, FormatError, Image};

/// Most bytes for each pixel of a decoded image,
const DEEPEST: u64 = 16;
/// and most bytes while decoding.
const MOST_BYTES: u64 = 24 * LARGEST_IMAGE as u64;

/// Reads an image, of a format that is told by its first bytes and not by its extension.
///
/// - PNG: all colour types and depths, interlaced or not, with transparency.
/// - JPEG: baseline and progressive, grey, YCbCr, RGB, CMYK and YCCK with 8 bits.
/// - WebP, GIF, TIFF and BMP, as the crate `image` reads them.
///
/// Of an animation it is the first picture.
///
/// Colours become grey by the luma of JPEG, `0.299 R + 0.587 G + 0.114 B` of the stored values.
/// Colour profiles are passed over. Images that Exif says are turned or mirrored are set upright.
///
/// Memory: at most [`LARGEST_IMAGE`] pixels are read, with up to 24 bytes for each of so many while decoding; beside
/// them four times the size of the file, which is at most eight bytes for each of these pixels, and
/// 32 MiB. The size is checked before anything is decoded. TIFF with colours and opacities in floats may have
/// three quarters of these pixels.
pub fn read(path: impl AsRef<Path>) -> Result<Image, Error> {
    let path = path.as_ref();
    let io = |source| files::Error::of("read", path)(source);
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
        return Err(format(FormatError::TooLong));
    }
    decode(&bytes).map_err(format)
}

/// The image in the bytes of a file; see [`read`].
pub fn decode(bytes: &[u8]) -> Result<Image, FormatError> {
    upright(bytes, Wanted::Grey).map(converted)
}

/// The image in the bytes of a file with its colours and opacities, 8 bits each; `path` is for messages.
pub fn colours(path: impl AsRef<Path>, bytes: &[u8]) -> Result<Picture, Error> {
    let format = |problem| Error::Format {
        path: path.as_ref().into(),
        problem,
    };
    let image = upright(bytes, Wanted::Colours)
        .map_err(format)?
        .into_rgba8();
    let pixels = image.pixels().map(|pixel| pixel.0).collect();
    let picture = Picture::new([image.width(), image.height()], pixels);
    picture.map_err(|error| format(FormatError::damaged("image", &error.to_string())))
}

/// Whether the image in the bytes of a file has more than 8 bits for a value, which [`colours`] leaves out.
pub fn is_deep(bytes: &[u8]) -> bool {
    upright(bytes, Wanted::Colours).is_ok_and(|image| {
        let colour = image.color();
        colour.bytes_per_pixel() > colour.channel_count()
    })
}

/// What is wanted of an image.
#[derive(Clone, Copy, PartialEq)]
enum Wanted {
    /// Its luma.
    Grey,
    Colours,
}

/// The decoded image, set upright.
fn upright(bytes: &[u8], tones: Wanted) -> Result<DynamicImage, FormatError> {
    if bytes.is_empty() {
        return Err(FormatError::Empty);
    }
    let unknown = || FormatError::UnknownFormat {
        start: bytes.iter().take(8).copied().collect(),
    };
    let (mut image, orientation) = match image::guess_format(bytes).map_err(|_| unknown())? {
        ImageFormat::Jpeg => jpeg::decode(bytes, tones)?,
        ImageFormat::Png => other("PNG", bytes)?,
        ImageFormat::WebP => other("WebP", bytes)?,
        ImageFormat::Gif => other("GIF", bytes)?,
        ImageFormat::Tiff => other("TIFF", bytes)?,
        ImageFormat::Bmp => other("BMP", bytes)?,
        _ => return Err(unknown()),
    };
    image.apply_orientation(orientation.unwrap_or(Orientation::NoTransforms));
    Ok(image)
}

/// What the crate `image` reads.
fn other(
    format: &'static str,
    bytes: &[u8],
) -> Result<(DynamicImage, Option<Orientation>), FormatError> {
    let refused = |error: image::ImageError| FormatError::damaged(format, &error.to_string());
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = reader.expect("reading from memory does not fail");
    let mut limits = Limits::default();
    limits.max_alloc = Some(DEEPEST * LARGEST_IMAGE as u64);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(refused)?;
    let size = decoder.dimensions().into();
    checked(size)?;
    if format == "TIFF" {
        // The decoder has a buffer as large as the image beside it.
        let bytes = decoder.total_bytes();
        if 2 * bytes > MOST_BYTES {
            return Err(FormatError::Deep { size, bytes });
        }
        let mut limits = Limits::default();
        limits.max_alloc = Some(MOST_BYTES - bytes);
        decoder.set_limits(limits).map_err(refused)?;
    }
    let orientation = decoder.orientation().map_err(refused)?;
    let image = DynamicImage::from_decoder(decoder).map_err(refused)?;
    Ok((image, Some(orientation)))
}

/// Grey values and opacities of 16 bits. Values of 8 bits are multiplied by 257: 255 becomes 65535.
fn converted(image: DynamicImage) -> Image {
    let image = image.into_rgba16();
    let pixels = || image.pixels().map(|pixel| pixel.0);
    let grey = pixels().map(|[r, g, b, _]| luma([r, g, b])).collect();
    let opacity = pixels().map(|[.., alpha]| alpha).collect();
    let image = Image::new([image.width(), image.height()], grey, Some(opacity));
    image.expect("the size is checked and all pixels are filled")
}

/// The number of pixels, if it is accepted.
fn checked(size: [u32; 2]) -> Result<usize, FormatError> {
    pixels(size).ok_or(FormatError::Size(size))
}

/// The luma `0.299 R + 0.587 G + 0.114 B`, rounded.
fn luma([r, g, b]: [u16; 3]) -> u16 {
    let sum = 299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b);
    ((sum + 500) / 1000) as u16
}
