//! JPEG in.

use std::io::Cursor;

use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::{FormatError, Orientation, Pixels, checked, luma, said, widen};

/// Progressive files have some ten scans; each takes time for the whole image.
const MOST_SCANS: usize = 64;

pub(super) fn decode(bytes: &[u8]) -> Result<(Pixels, Orientation), FormatError> {
    // Strict: what is missing from a file is not to become grey.
    let options = DecoderOptions::default()
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX))
        .jpeg_set_max_scans(MOST_SCANS)
        .set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
    decoder.decode_headers().map_err(refused)?;
    let (width, height) = decoder.dimensions().ok_or_else(|| unusual("no size"))?;
    let size = [width, height].map(|n| n as u32);
    let count = checked(size[0], size[1])?;
    let (output, channels) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma | ColorSpace::YCbCr) => (ColorSpace::Luma, 1),
        Some(ColorSpace::RGB | ColorSpace::CMYK | ColorSpace::YCCK) => (ColorSpace::RGB, 3),
        _ => return Err(unusual("unknown colours")),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(output));
    let mut data = vec![0; channels * count];
    decoder.decode_into(&mut data).map_err(refused)?;
    let grey = match channels {
        1 => data.into_iter().map(widen).collect(),
        _ => data
            .as_chunks::<3>()
            .0
            .iter()
            .map(|colour| luma(colour.map(widen)))
            .collect(),
    };
    let orientation = Orientation::from_exif(decoder.exif().map_or(&[], |exif| exif));
    let pixels = Pixels {
        size,
        grey,
        opacity: None,
    };
    Ok((pixels, orientation))
}

fn unusual(message: &str) -> FormatError {
    FormatError::Jpeg {
        message: message.into(),
    }
}

#[allow(clippy::needless_pass_by_value, reason = "for map_err")]
fn refused(error: DecodeErrors) -> FormatError {
    // Some messages come in quotation marks.
    unusual(said(&error.to_string()).trim_matches('"'))
}
