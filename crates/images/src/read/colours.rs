//! Images in their colours.

use std::io::Cursor;

use png::{Decoder, Transformations};
use render::Picture;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::{FormatError, Orientation, decode, said};

/// The image in the bytes of a file with its colours and opacities, 8 bits each, upright; formats other than PNG and JPEG in grey.
///
/// # Errors
/// As [`decode`].
pub fn colours(bytes: &[u8]) -> Result<Picture, FormatError> {
    // Refuses what is too large or damaged.
    let image = decode(bytes)?;
    let narrow = |value: u16| (value / 257) as u8;
    let (stored, orientation, pixels) = match bytes {
        [0x89, b'P', b'N', b'G', ..] => png(bytes)?,
        [0xff, 0xd8, 0xff, ..] => jpeg(bytes)?,
        _ => {
            let opacity = |pixel: usize| image.opacity().map_or(u16::MAX, |o| o[pixel]);
            let pixel = |(k, &grey): (usize, &u16)| {
                let grey = narrow(grey);
                [grey, grey, grey, narrow(opacity(k))]
            };
            let pixels = image.grey().iter().enumerate().map(pixel).collect();
            let size = [image.width(), image.height()];
            (size, Orientation::from_exif(&[]), pixels)
        }
    };
    let [width, height] = orientation.size(stored);
    let pixels = orientation.apply(stored, pixels);
    Picture::new(width, height, pixels).map_err(|error| FormatError::Png {
        message: said(&error.to_string()),
    })
}

type Stored = ([u32; 2], Orientation, Vec<[u8; 4]>);

fn png(bytes: &[u8]) -> Result<Stored, FormatError> {
    let refused = |error: png::DecodingError| FormatError::Png {
        message: said(&error.to_string()),
    };
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::normalize_to_color8() | Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(refused)?;
    let mut data = vec![0; reader.output_buffer_size().unwrap_or(0)];
    let frame = reader.next_frame(&mut data).map_err(refused)?;
    let exif = reader.info().exif_metadata.as_deref().unwrap_or(&[]);
    let channels = frame.color_type.samples();
    let pixel = |p: &[u8]| match p {
        [grey, opacity] => [*grey, *grey, *grey, *opacity],
        p => [p[0], p[1], p[2], p[3]],
    };
    let pixels = data[..frame.buffer_size()].chunks_exact(channels);
    Ok((
        [frame.width, frame.height],
        Orientation::from_exif(exif),
        pixels.map(pixel).collect(),
    ))
}

fn jpeg(bytes: &[u8]) -> Result<Stored, FormatError> {
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
    let refused = |message: String| FormatError::Jpeg {
        message: said(&message),
    };
    let data = decoder
        .decode()
        .map_err(|error| refused(error.to_string()))?;
    let (width, height) = (decoder.dimensions()).ok_or_else(|| refused("no size".into()))?;
    let exif = decoder.exif().map_or(&[][..], |exif| exif);
    let pixels = data.as_chunks::<3>().0.iter();
    Ok((
        [width, height].map(|n| n as u32),
        Orientation::from_exif(exif),
        pixels.map(|&[r, g, b]| [r, g, b, u8::MAX]).collect(),
    ))
}
