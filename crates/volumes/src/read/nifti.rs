//! NIfTI headers.
//!
//! NIfTI-1: <https://nifti.nimh.nih.gov/pub/dist/src/niftilib/nifti1.h>, NIfTI-2: `nifti2.h` beside it.

use files::Number;
use glam::{DAffine3, DMat3, DVec3};

use super::{Fields, Frames, Header, size};
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
    let fields = Fields::new(head, length as usize, big_endian);
    Some(fields.and_then(|fields| entries(&fields, length == LENGTHS[0])))
}

fn entries(fields: &Fields<'_>, is_first: bool) -> Result<Header, FormatError> {
    use Number::{F32, F64, I16, I32, I64};
    let bad = |entry, value: &dyn ToString, requirement| {
        FormatError::entry("NIfTI", entry, &value.to_string(), requirement)
    };
    // Places in the headers of both versions.
    let at = |first: usize, second: usize| if is_first { first } else { second };
    let (wanted, least, [whole, code, real, offset]): (&[u8], f64, _) = if is_first {
        (b"n+1\0", 352.0, [I16, I16, F32, F32])
    } else {
        (b"n+2\0\r\n\x1a\n", 544.0, [I64, I32, F64, I64])
    };
    let magic = &fields.bytes[at(344, 4)..at(348, 12)];
    if magic != wanted {
        let magic = magic.escape_ascii();
        return bad("magic", &magic, "n+1 or n+2: header and voxels in one file");
    }
    let dimensions: [f64; 8] = fields.numbers(at(40, 16), whole);
    let [axes, nx, ny, nz, more @ ..] = dimensions;
    if !(3.0..=7.0).contains(&axes) {
        let shown = format!("{:?}", dimensions.map(|n| n as i64));
        return bad("dim", &shown, "that of a volume with three axes or more");
    }
    // Axes beyond those that are counted say nothing.
    let more = more[..axes as usize - 3].iter().map(|n| n.max(1.0) as u64);
    let frames = more.fold(1, u64::saturating_mul);
    let element = match fields.number(at(70, 12), I16) as i16 {
        2 => Number::U8,
        4 => I16,
        8 => I32,
        16 => F32,
        64 => F64,
        256 => Number::I8,
        512 => Number::U16,
        768 => Number::U32,
        1024 => I64,
        1280 => Number::U64,
        other => return bad("datatype", &other, "a real number of up to 64 bits"),
    };
    let start = fields.number(at(108, 168), offset);
    if !(start >= least && start <= 2_f64.powi(40) && start.fract() == 0.0) {
        let requirement = "a whole number behind the header";
        return bad("vox_offset", &start, requirement);
    }
    let scale = match fields.numbers::<2>(at(112, 176), real) {
        // Without a slope there is none.
        [slope, _] if slope == 0.0 || slope.is_nan() => [1.0, 0.0],
        [slope, shift] if slope.is_finite() && shift.is_finite() => [slope, shift],
        [slope, shift] => return bad("scl_slope", &format!("{slope} {shift}"), "finite"),
    };
    let size = size("NIfTI", [nx, ny, nz])?;
    Ok(Header {
        size,
        frames: Frames::in_turn(frames, size),
        element,
        big_endian: fields.big_endian,
        scale,
        affine: affine(fields, at, [code, real]),
        start: start as u64,
        has_footer: false,
    })
}

/// The map from indices to positions, by rows, by a quaternion, or by the sides of voxels; `at` tells places in the headers of both versions.
fn affine(
    fields: &Fields<'_>,
    at: impl Fn(usize, usize) -> usize,
    [code, real]: [Number; 2],
) -> DAffine3 {
    let [handed, x, y, z] = fields.numbers(at(76, 104), real);
    // What is not written is one.
    let sides = DVec3::new(x, y, z).abs();
    let sides = DVec3::select(sides.cmpeq(DVec3::ZERO), DVec3::ONE, sides);
    let [by_quaternion, by_rows] = fields.numbers(at(252, 344), code);
    if by_rows > 0.0 {
        let rows: [[f64; 4]; 3] =
            [0, 1, 2].map(|row| fields.numbers(at(280 + 16 * row, 400 + 32 * row), real));
        let column = |i: usize| DVec3::from_array(rows.map(|row| row[i]));
        DAffine3::from_cols(column(0), column(1), column(2), column(3))
    } else if by_quaternion > 0.0 {
        let [b, c, d] = fields.numbers(at(256, 352), real);
        let a = (1.0 - (b * b + c * c + d * d)).max(0.0).sqrt();
        let turn = DMat3::from_quat(glam::DQuat::from_xyzw(b, c, d, a));
        let last = if handed < 0.0 { -1.0 } else { 1.0 };
        let matrix = turn * DMat3::from_diagonal(sides * DVec3::new(1.0, 1.0, last));
        let offset: [f64; 3] = fields.numbers(at(268, 376), real);
        DAffine3::from_mat3_translation(matrix, offset.into())
    } else {
        DAffine3::from_scale(sides)
    }
}
