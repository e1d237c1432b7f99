//! What the description of a stack tells: that of OME-TIFF, that of ImageJ, or any other.

use std::io::{Read, Seek};

use files::Number;
use glam::DVec3;
use tiff::decoder::Decoder;
use tiff::decoder::ifd::Value;
use tiff::tags::{ResolutionUnit, Tag};

use super::planes::Planes;
use super::{bad, ome};
use crate::{FormatError, Warning};

/// Millimetres.
const INCH: f64 = 25.4;
const CENTIMETRE: f64 = 10.0;
const UNSCALED: [f64; 2] = [1.0, 0.0];

/// What is told of the pages.
pub struct Description {
    /// The order of the pages; without one all are sections of one volume.
    pub planes: Option<Planes>,
    /// The sides of voxels.
    pub sides: DVec3,
    /// The value of a number `x` is `scale[0] x + scale[1]`.
    pub scale: [f64; 2],
    pub warnings: Vec<Warning>,
}

impl Description {
    /// That of the first page, whose pixels are such numbers.
    pub fn of(
        reader: &mut Decoder<impl Read + Seek>,
        element: Number,
    ) -> Result<Self, FormatError> {
        let text = match reader
            .find_tag(Tag::ImageDescription)?
            .map(Value::into_string)
        {
            None => String::new(),
            Some(Ok(text)) => text,
            Some(Err(_)) => return Self::damaged(reader, "it is no text".to_owned()),
        };
        if text.starts_with("ImageJ=") {
            return Self::by_imagej(reader, &text, element);
        }
        let pixels = match ome::is_meant(&text).then(|| ome::Pixels::of(&text)) {
            None => return Self::other(reader),
            Some(Ok(pixels)) => pixels,
            Some(Err(problem)) => return Self::damaged(reader, problem),
        };
        if !pixels.is_in_order {
            let requirement = "that of DimensionOrder: save the stack anew, in one file";
            return bad("order of the pages", &"another one", requirement);
        }
        let other = Self::other(reader)?;
        Ok(Self {
            planes: Some(pixels.planes),
            sides: pixels.sides.unwrap_or(other.sides),
            warnings: if pixels.lacks_distance {
                vec![Warning::NoDistance]
            } else {
                Vec::new()
            },
            ..other
        })
    }

    /// Without what it tells.
    fn other(reader: &mut Decoder<impl Read + Seek>) -> Result<Self, FormatError> {
        // Without one it is the inch, by TIFF 6.0.
        let unit = reader.find_tag_unsigned::<u16>(Tag::ResolutionUnit)?;
        let unit = match unit.map_or(Some(ResolutionUnit::Inch), ResolutionUnit::from_u16) {
            Some(ResolutionUnit::Centimeter) => CENTIMETRE,
            Some(ResolutionUnit::Inch) => INCH,
            _ => 1.0,
        };
        let [x, y] = resolution(reader, unit);
        Ok(Self {
            planes: None,
            sides: DVec3::new(x, y, y),
            scale: UNSCALED,
            warnings: Vec::new(),
        })
    }

    fn damaged(
        reader: &mut Decoder<impl Read + Seek>,
        problem: String,
    ) -> Result<Self, FormatError> {
        let mut other = Self::other(reader)?;
        other.warnings.push(Warning::Description { problem });
        Ok(other)
    }

    /// The numbers of pages, the distance of sections, and the scale of values.
    fn by_imagej(
        reader: &mut Decoder<impl Read + Seek>,
        text: &str,
        element: Number,
    ) -> Result<Self, FormatError> {
        let note = |name: &str| {
            let mut lines = text.lines().filter_map(|line| line.split_once('='));
            lines.find(|(key, _)| *key == name).map(|(_, value)| value)
        };
        let count = |name| {
            note(name)
                .and_then(|n| n.parse().ok())
                .filter(|n: &u64| *n > 0)
        };
        let number = |name| note(name).and_then(|n| n.parse::<f64>().ok());
        let [channels, times] = ["channels", "frames"].map(|name| count(name).unwrap_or(1));
        let sections = count("images").map(|all| all / channels.saturating_mul(times).max(1));
        let axes = |sections: u64| [('C', channels), ('Z', sections.max(1)), ('T', times)];
        if sections.is_none() && (channels > 1 || times > 1) {
            return bad("number of images", &"missing", "what ImageJ notes");
        }
        let [x, y] = resolution(reader, 1.0);
        // A distance of 1 is not noted.
        let z = number("spacing").map(f64::abs).filter(|&z| z > 0.0);
        Ok(Self {
            planes: sections.and_then(|sections| Planes::new(&axes(sections))),
            sides: DVec3::new(x, y, z.unwrap_or(1.0)),
            scale: match element {
                Number::U8 | Number::U16 => calibrated(["cf", "c0", "c1"].map(number))?,
                _ => UNSCALED,
            },
            warnings: Vec::new(),
        })
    }
}

/// The sides of pixels by the resolution, of which there are so many to a unit of this length, or else 1.
fn resolution(reader: &mut Decoder<impl Read + Seek>, unit: f64) -> [f64; 2] {
    [Tag::XResolution, Tag::YResolution].map(|tag| {
        let pixels = match reader.get_tag(tag) {
            Ok(Value::Rational(n, d)) => f64::from(n) / f64::from(d),
            _ => 0.0,
        };
        let side = unit / pixels;
        if side.is_normal() { side } else { 1.0 }
    })
}

/// The scale by the function that ImageJ notes for numbers of up to 16 bits, and its first two coefficients. Numbers with a sign are a
/// straight line of those without.
fn calibrated(noted: [Option<f64>; 3]) -> Result<[f64; 2], FormatError> {
    match noted {
        [Some(0.0), Some(shift), Some(slope)] => Ok([slope, shift]),
        // None is also noted as 20, or without coefficients.
        [None | Some(0.0 | 20.0), ..] => Ok(UNSCALED),
        [Some(function), ..] => {
            let requirement = "0, a straight line; convert the stack to 32 bits in ImageJ";
            bad("calibration function", &function, requirement)
        }
    }
}
