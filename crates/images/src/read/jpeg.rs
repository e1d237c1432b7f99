//! JPEG in. Not by the crate `image`, which accepts files that end early and fills in grey.

use std::io::Cursor;

use image::DynamicImage;
use image::metadata::Orientation;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::{Wanted, checked};
use crate::FormatError;

/// Progressive files have some ten scans; each takes time for the whole image.
const MOST_SCANS: usize = 64;

pub(super) fn decode(
    bytes: &[u8],
    tones: Wanted,
) -> Result<(DynamicImage, Option<Orientation>), FormatError> {
    let options = DecoderOptions::default()
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX))
        .jpeg_set_max_scans(MOST_SCANS)
        .set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
    decoder.decode_headers()?;
    let (width, height) = decoder.dimensions().ok_or_else(|| unusual("no size"))?;
    let [width, height] = [width, height].map(|n| n as u32);
    let count = checked([width, height])?;
    let (output, channels) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (ColorSpace::Luma, 1),
        Some(ColorSpace::YCbCr) if tones == Wanted::Grey => (ColorSpace::Luma, 1),
        Some(ColorSpace::YCbCr | ColorSpace::RGB | ColorSpace::CMYK | ColorSpace::YCCK) => {
            (ColorSpace::RGB, 3)
        }
        _ => return Err(unusual("unknown colours")),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(output));
    let mut data = vec![0; channels * count];
    decoder.decode_into(&mut data)?;
    let image = match channels {
        1 => image::GrayImage::from_raw(width, height, data).map(DynamicImage::from),
        _ => image::RgbImage::from_raw(width, height, data).map(DynamicImage::from),
    };
    let orientation = decoder
        .exif()
        .and_then(|exif| Orientation::from_exif_chunk(exif));
    Ok((image.expect("as many values as pixels"), orientation))
}

fn unusual(message: &str) -> FormatError {
    FormatError::damaged("JPEG", message)
}

impl From<DecodeErrors> for FormatError {
    fn from(error: DecodeErrors) -> Self {
        unusual(&error.to_string())
    }
}
