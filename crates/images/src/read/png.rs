//! PNG in.

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations};

use super::{FormatError, Orientation, Pixels, checked, luma, said, widen};

/// Memory for everything but pixels: palettes, colour profiles, rows.
const LARGEST_CHUNKS: usize = 1 << 24;

pub(super) fn decode(bytes: &[u8]) -> Result<(Pixels, Orientation), FormatError> {
    let limits = Limits {
        bytes: LARGEST_CHUNKS,
    };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let header = decoder.read_header_info().map_err(refused)?;
    let size = [header.width, header.height];
    let count = checked(size[0], size[1])?;
    // Palettes become colours, transparent colours opacities, and 1 to 4 bits 8.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(refused)?;
    let length = reader.output_buffer_size().ok_or(FormatError::Size {
        width: size[0],
        height: size[1],
        limit: crate::LARGEST_IMAGE,
    })?;
    let mut data = vec![0; length];
    reader.next_frame(&mut data).map_err(refused)?;
    let exif = reader.info().exif_metadata.as_deref().unwrap_or(&[]);
    let orientation = Orientation::from_exif(exif);

    let (colour, depth) = reader.output_color_type();
    let (colours, opaque) = match colour {
        ColorType::Grayscale => (1, true),
        ColorType::GrayscaleAlpha => (1, false),
        ColorType::Rgb => (3, true),
        ColorType::Rgba => (3, false),
        ColorType::Indexed => {
            return Err(FormatError::Png {
                message: "it has no palette".into(),
            });
        }
    };
    let channels = colours + usize::from(!opaque);
    let sample = |pixel: usize, channel: usize| match depth {
        BitDepth::Sixteen => {
            let at = 2 * (pixel * channels + channel);
            u16::from_be_bytes([data[at], data[at + 1]])
        }
        _ => widen(data[pixel * channels + channel]),
    };
    let grey = |pixel: usize| match colours {
        1 => sample(pixel, 0),
        _ => luma([0, 1, 2].map(|channel| sample(pixel, channel))),
    };
    let pixels = Pixels {
        size,
        grey: (0..count).map(grey).collect(),
        opacity: (!opaque).then(|| (0..count).map(|p| sample(p, colours)).collect()),
    };
    Ok((pixels, orientation))
}

#[allow(clippy::needless_pass_by_value, reason = "for map_err")]
fn refused(error: DecodingError) -> FormatError {
    FormatError::Png {
        message: said(&error.to_string()),
    }
}
