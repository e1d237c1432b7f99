//! Stacks of TIFF images, by the crate `tiff`.

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::Path;

use files::Number;
use glam::{DAffine3, DVec3};
use tiff::decoder::ifd::Value;
use tiff::decoder::{BufferLayoutPreference, Decoder, DecodingSampleType, Limits};
use tiff::tags::{PhotometricInterpretation, ResolutionUnit, Tag};
use tiff::{ColorType, TiffResult};

use super::length;
use crate::volume::Voxels;
use crate::{FormatError, Volume};

/// Most bytes of a page, and of what it is unpacked from.
const LARGEST_PAGE: usize = 1 << 29;
/// Millimetres.
const INCH: f64 = 25.4;
const CENTIMETRE: f64 = 10.0;

/// Whether the first bytes are those of a TIFF file, also of a large one.
pub(super) fn is_tiff(bytes: &[u8]) -> bool {
    let starts: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];
    starts.iter().any(|start| bytes.starts_with(start))
}

/// Whether a file is TIFF with several images of the same size: it is a volume, and not an image.
pub fn is_stack(path: impl AsRef<Path>) -> bool {
    let same = || -> TiffResult<bool> {
        let mut reader = Decoder::new(BufReader::new(File::open(path)?))?;
        let first = reader.dimensions()?;
        if !reader.more_images() {
            return Ok(false);
        }
        reader.next_image()?;
        Ok(reader.dimensions()? == first)
    };
    same().unwrap_or(false)
}

impl From<tiff::TiffError> for FormatError {
    fn from(error: tiff::TiffError) -> Self {
        Self::damaged("TIFF", &error)
    }
}

fn bad<T>(
    entry: &'static str,
    value: &impl ToString,
    requirement: &'static str,
) -> Result<T, FormatError> {
    FormatError::entry("TIFF", entry, value, requirement)
}

pub(super) fn decode(bytes: &[u8], limit: u64) -> Result<Volume, FormatError> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = LARGEST_PAGE;
    limits.intermediate_buffer_size = LARGEST_PAGE;
    let mut reader = Decoder::new(Cursor::new(bytes))?.with_limits(limits);
    let (first, element, _) = page(&mut reader)?;
    let (noted, sides, scale) = described(&mut reader, element)?;
    let (mut data, mut pages) = (Vec::new(), 0);
    loop {
        let (size, kind, white_is_zero) = page(&mut reader)?;
        if (size, kind) != (first, element) {
            let shown = format!("{} x {} as {kind:?}", size[0], size[1]);
            return bad("page", &shown, "like the first one");
        }
        pages += 1;
        // A page more than there is, so that one alone is no reason yet.
        length([size[0], size[1], pages + 1], element, limit)?;
        let layout = reader.image_buffer_layout()?;
        if layout.len != (size[0] * size[1]) as usize * element.size() {
            return bad("page", &format!("{} bytes long", layout.len), "one plane");
        }
        let start = data.len();
        data.resize(start + layout.len, 0);
        reader.read_image_bytes(&mut data[start..])?;
        if white_is_zero {
            // The crate takes numbers from the largest one; these are those in the file.
            data[start..].iter_mut().for_each(|byte| *byte = !*byte);
        }
        if !reader.more_images() {
            break;
        }
        reader.next_image()?;
    }
    if noted.is_some_and(|noted| noted != pages) {
        return bad("number of pages", &pages, "what ImageJ notes");
    }
    let size = [first[0], first[1], pages].map(|n| n as usize);
    let voxels = Voxels {
        bytes: data,
        element,
        big_endian: cfg!(target_endian = "big"),
        scale,
    };
    Volume::new(size, DAffine3::from_scale(sides), voxels)
}

/// Columns and rows of the page, its numbers, and whether white is zero.
fn page(reader: &mut Decoder<impl Read + Seek>) -> Result<([u64; 2], Number, bool), FormatError> {
    let colours = reader.colortype()?;
    let ColorType::Gray(8 | 16 | 32 | 64) = colours else {
        let shown = format!("{colours:?}");
        return bad("kind of pixels", &shown, "one number of 8 to 64 bits each");
    };
    let BufferLayoutPreference { sample_type, .. } = reader.image_buffer_layout()?;
    let element = match sample_type {
        Some(DecodingSampleType::U8) => Number::U8,
        Some(DecodingSampleType::U16) => Number::U16,
        Some(DecodingSampleType::U32) => Number::U32,
        Some(DecodingSampleType::U64) => Number::U64,
        Some(DecodingSampleType::I8) => Number::I8,
        Some(DecodingSampleType::I16) => Number::I16,
        Some(DecodingSampleType::I32) => Number::I32,
        Some(DecodingSampleType::I64) => Number::I64,
        Some(DecodingSampleType::F32) => Number::F32,
        Some(DecodingSampleType::F64) => Number::F64,
        _ => return bad("kind of numbers", &"unusual", "whole, or of 32 or 64 bits"),
    };
    let (width, height) = reader.dimensions()?;
    let size = [width, height].map(u64::from);
    length([size[0], size[1], 2], element, 2 * LARGEST_PAGE as u64)?;
    let meaning = reader.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation)?;
    let white_is_zero = meaning == Some(PhotometricInterpretation::WhiteIsZero.to_u16());
    let unsigned = [Number::U8, Number::U16, Number::U32, Number::U64].contains(&element);
    if white_is_zero && !unsigned {
        let shown = format!("{element:?} with white as zero");
        return bad("kind of numbers", &shown, "whole and without sign");
    }
    Ok((size, element, white_is_zero))
}

/// The number of pages, if ImageJ notes it in the description of the first one, the sides of voxels, and the scale of their values.
fn described(
    reader: &mut Decoder<impl Read + Seek>,
    element: Number,
) -> Result<(Option<u64>, DVec3, [f64; 2]), FormatError> {
    let text = reader.get_tag_ascii_string(Tag::ImageDescription);
    let text = text.unwrap_or_default();
    let is_by_imagej = text.starts_with("ImageJ=");
    let note = |name: &str| {
        let mut lines = text.lines().filter_map(|line| line.split_once('='));
        let line = lines.find(|(key, _)| is_by_imagej && *key == name);
        line.map(|(_, value)| value)
    };
    let count = |name| note(name).and_then(|n| n.parse::<u64>().ok());
    for axis in ["channels", "frames"] {
        if let Some(n) = count(axis).filter(|&n| n > 1) {
            return bad("number of channels or times", &n, "1: save one of them");
        }
    }
    // Without one it is the inch, by TIFF 6.0.
    let unit = reader.find_tag_unsigned::<u16>(Tag::ResolutionUnit)?;
    let unit = match unit.map_or(Some(ResolutionUnit::Inch), ResolutionUnit::from_u16) {
        Some(ResolutionUnit::Centimeter) if !is_by_imagej => CENTIMETRE,
        Some(ResolutionUnit::Inch) if !is_by_imagej => INCH,
        _ => 1.0,
    };
    let mut side = |tag| {
        let pixels = match reader.get_tag(tag) {
            Ok(Value::Rational(n, d)) => f64::from(n) / f64::from(d),
            _ => 0.0,
        };
        let side = unit / pixels;
        if side.is_normal() { side } else { 1.0 }
    };
    let (x, y) = (side(Tag::XResolution), side(Tag::YResolution));
    let number = |name| note(name).and_then(|n| n.parse::<f64>().ok());
    let spacing = number("spacing");
    // ImageJ does not note a distance of 1.
    let usual = if is_by_imagej { 1.0 } else { y };
    let z = spacing.map(f64::abs).filter(|&z| z > 0.0).unwrap_or(usual);
    let scale = match element {
        Number::U8 | Number::U16 => calibrated(["cf", "c0", "c1"].map(number))?,
        _ => [1.0, 0.0],
    };
    Ok((count("images"), DVec3::new(x, y, z), scale))
}

/// The scale by the function that ImageJ notes for numbers of up to 16 bits, and its first two coefficients. Numbers with a sign are a
/// straight line of those without.
fn calibrated(noted: [Option<f64>; 3]) -> Result<[f64; 2], FormatError> {
    match noted {
        [Some(0.0), Some(shift), Some(slope)] => Ok([slope, shift]),
        // None is also noted as 20, or without coefficients.
        [None | Some(0.0 | 20.0), ..] => Ok([1.0, 0.0]),
        [Some(function), ..] => {
            let requirement = "0, a straight line; convert the stack to 32 bits in ImageJ";
            bad("calibration function", &function, requirement)
        }
    }
}
