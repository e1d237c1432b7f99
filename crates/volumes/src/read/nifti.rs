//! NIfTI headers.
//!
//! NIfTI-1: <https://nifti.nimh.nih.gov/pub/dist/src/niftilib/nifti1.h>, NIfTI-2: `nifti2.h` beside it.

use files::Number;
use glam::{DAffine3, DMat3, DVec3};

use super::Header;
use super::fields::Fields;
use crate::FormatError;

/// Lengths of the headers, which are their first numbers.
const LENGTHS: [i32; 2] = [348, 540];

/// Unless it is none.
pub(super) fn header(head: &[u8]) -> Option<Result<Header, FormatError>> {
    let first = *head.first_chunk::<4>()?;
    let orders = [
        (i32::from_le_bytes(first), false),
        (i32::from_be_bytes(first), true),
    ];
    let (length, big_endian) = orders.into_iter().find(|(n, _)| LENGTHS.contains(n))?;
    if head.len() < length as usize {
        return Some(Err(FormatError::Length {
            expected: length as u64,
            found: head.len() as u64,
            longer: false,
        }));
    }
    let fields = Fields {
        format: "NIfTI",
        bytes: head,
        big_endian,
    };
    let entries = match length {
        348 => Entries::first(&fields),
        _ => Entries::second(&fields),
    };
    Some(entries.header(&fields))
}

/// The entries that count, of either version.
struct Entries<'a> {
    magic: &'a [u8],
    wanted: &'static [u8],
    dimensions: [i64; 8],
    data_type: i16,
    sides: [f64; 8],
    start: f64,
    scale: [f64; 2],
    /// Whether there is a map by quaternions, and one by rows.
    codes: [i32; 2],
    quaternion: [f64; 3],
    offset: [f64; 3],
    rows: [[f64; 4]; 3],
}

impl<'a> Entries<'a> {
    fn first(fields: &Fields<'a>) -> Self {
        let f32s = |at: usize| move |i: usize| fields.f32(at + 4 * i);
        Self {
            magic: &fields.bytes[344..348],
            wanted: b"n+1\0",
            dimensions: std::array::from_fn(|i| i64::from(fields.i16(40 + 2 * i))),
            data_type: fields.i16(70),
            sides: std::array::from_fn(f32s(76)),
            start: fields.f32(108),
            scale: std::array::from_fn(f32s(112)),
            codes: [fields.i16(252), fields.i16(254)].map(i32::from),
            quaternion: std::array::from_fn(f32s(256)),
            offset: std::array::from_fn(f32s(268)),
            rows: std::array::from_fn(|row| std::array::from_fn(f32s(280 + 16 * row))),
        }
    }

    fn second(fields: &Fields<'a>) -> Self {
        let f64s = |at: usize| move |i: usize| fields.f64(at + 8 * i);
        Self {
            magic: &fields.bytes[4..12],
            wanted: b"n+2\0\r\n\x1a\n",
            dimensions: std::array::from_fn(|i| fields.i64(16 + 8 * i)),
            data_type: fields.i16(12),
            sides: std::array::from_fn(f64s(104)),
            start: fields.i64(168) as f64,
            scale: std::array::from_fn(f64s(176)),
            codes: [fields.i32(344), fields.i32(348)],
            quaternion: std::array::from_fn(f64s(352)),
            offset: std::array::from_fn(f64s(376)),
            rows: std::array::from_fn(|row| std::array::from_fn(f64s(400 + 32 * row))),
        }
    }

    fn header(&self, fields: &Fields<'_>) -> Result<Header, FormatError> {
        if self.magic != self.wanted {
            let magic = self.magic.escape_ascii();
            return fields.bad("magic", &magic, "n+1 or n+2: header and voxels in one file");
        }
        let [axes, nx, ny, nz, more @ ..] = self.dimensions;
        // Axes beyond those that are counted say nothing.
        let several = |n: &usize| more[*n] > 1 && (*n as i64) < axes - 3;
        if !(3..=7).contains(&axes) || (0..4).any(|n| several(&n)) {
            let shown = format!("{:?}", self.dimensions);
            return fields.bad("dim", &shown, "that of one volume with three axes");
        }
        let element = match self.data_type {
            2 => Number::U8,
            4 => Number::I16,
            8 => Number::I32,
            16 => Number::F32,
            64 => Number::F64,
            256 => Number::I8,
            512 => Number::U16,
            768 => Number::U32,
            1024 => Number::I64,
            1280 => Number::U64,
            other => {
                return fields.bad("datatype", &other, "a real number of up to 64 bits");
            }
        };
        let least = if self.wanted.len() == 4 { 352.0 } else { 544.0 };
        if !(self.start >= least && self.start <= 2_f64.powi(40) && self.start.fract() == 0.0) {
            return fields.bad(
                "vox_offset",
                &self.start,
                "a whole number behind the header",
            );
        }
        let scale = match self.scale {
            // Without a slope there is none.
            [0.0, _] => [1.0, 0.0],
            [slope, shift] if slope.is_finite() && shift.is_finite() => [slope, shift],
            [slope, shift] => {
                return fields.bad("scl_slope", &format!("{slope} {shift}"), "finite");
            }
        };
        Ok(Header {
            size: fields.size([nx, ny, nz])?,
            element,
            big_endian: fields.big_endian,
            scale,
            frame: self.frame(),
            start: self.start as u64,
        })
    }

    /// The map from indices to positions: by rows, by a quaternion, or by the sides of voxels.
    fn frame(&self) -> DAffine3 {
        let [handed, x, y, z, ..] = self.sides;
        // What is not written is one.
        let sides = DVec3::new(x, y, z).abs();
        let sides = DVec3::select(sides.cmpeq(DVec3::ZERO), DVec3::ONE, sides);
        if self.codes[1] > 0 {
            let column = |i: usize| DVec3::from_array([0, 1, 2].map(|row| self.rows[row][i]));
            return DAffine3::from_cols(column(0), column(1), column(2), column(3));
        }
        if self.codes[0] <= 0 {
            return DAffine3::from_scale(sides);
        }
        let [b, c, d] = self.quaternion;
        let a = (1.0 - (b * b + c * c + d * d)).max(0.0).sqrt();
        let turn = DMat3::from_quat(glam::DQuat::from_xyzw(b, c, d, a));
        let last = if handed < 0.0 { -1.0 } else { 1.0 };
        let sides = sides * DVec3::new(1.0, 1.0, last);
        DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(sides), self.offset.into())
    }
}
