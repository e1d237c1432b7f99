//! Headers of MGH files of FreeSurfer, which compressed are MGZ.
//!
//! <https://surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat>.

use files::Number;
use glam::{DAffine3, DMat3, DVec3};

use super::{Fields, Frames, Header, size};
use crate::FormatError;

/// Where voxels begin.
const START: usize = 284;

/// Unless it is none: the first number is the version, 1, and all numbers are big-endian.
pub(super) fn header(head: &[u8]) -> Option<Result<Header, FormatError>> {
    if head.get(..4)? != [0, 0, 0, 1] {
        return None;
    }
    let fields = Fields::new(head, START, true);
    Some(fields.and_then(|fields| entries(&fields)))
}

fn entries(fields: &Fields<'_>) -> Result<Header, FormatError> {
    let bad =
        |entry, value: f64, requirement| FormatError::entry("MGH", entry, &value, requirement);
    let [width, height, depth, frames] = fields.numbers(4, Number::I32);
    if frames < 1.0 {
        return bad("nframes", frames, "1 at least");
    }
    let element = match fields.number(20, Number::I32) as i32 {
        0 => Number::U8,
        1 => Number::I32,
        3 => Number::F32,
        4 => Number::I16,
        10 => Number::U16,
        other => return bad("type", other.into(), "0, 1, 3, 4 or 10: real numbers"),
    };
    let size = size("MGH", [width, height, depth])?;
    Ok(Header {
        size,
        frames: Frames::in_turn(frames as u64, size),
        element,
        big_endian: true,
        scale: [1.0, 0.0],
        affine: affine(fields, size),
        start: START as u64,
        // Times of the scanner, and notes.
        has_footer: true,
    })
}

/// The map from indices to positions: steps along the axes, and the position half-way along all of them. Without any it is that of coronal slices.
fn affine(fields: &Fields<'_>, size: [u64; 3]) -> DAffine3 {
    let vector = |at: usize| DVec3::from_array(fields.numbers(at, Number::F32));
    let (sides, directions, centre) = if fields.number(28, Number::I16) > 0.0 {
        (vector(30), [42, 54, 66].map(vector), vector(78))
    } else {
        (DVec3::ONE, [-DVec3::X, -DVec3::Z, DVec3::Y], DVec3::ZERO)
    };
    let [x, y, z] = directions;
    let steps = DMat3::from_cols(x, y, z) * DMat3::from_diagonal(sides);
    let half = DVec3::from_array(size.map(|n| 0.5 * n as f64));
    DAffine3::from_mat3_translation(steps, centre - steps * half)
}
