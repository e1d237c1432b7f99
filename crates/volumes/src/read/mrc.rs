//! Headers of MRC files and CCP4 maps.
//!
//! MRC2014: A. Cheng et al.: MRC2014: Extensions to the MRC format header for electron cryo-microscopy and tomography. J. Struct. Biol.
//! 192 (2015), <https://www.ccpem.ac.uk/mrc-format/mrc2014/>.

use files::Number;
use glam::{DAffine3, DMat3, DVec3};

use super::{Fields, Frames, HEAD, Header, size};
use crate::FormatError;

/// Angles of cells may differ from right ones by so many degrees.
const SKEW: f64 = 1e-3;

/// Unless it is none.
pub(super) fn header(head: &[u8]) -> Option<Result<Header, FormatError>> {
    if head.get(208..212)? != b"MAP " {
        return None;
    }
    // The stamp of the machine; some programs write none, and all machines of theirs are little-endian.
    let big_endian = head.get(212) == Some(&0x11);
    let fields = Fields::new(head, HEAD, big_endian);
    Some(fields.and_then(|fields| entries(&fields)))
}

fn entries(fields: &Fields<'_>) -> Result<Header, FormatError> {
    let bad = |entry, value: &dyn ToString, requirement| {
        FormatError::entry("MRC", entry, &value.to_string(), requirement)
    };
    let whole = |at: usize| fields.number(at, Number::I32) as i32;
    let i32s = |at: usize| fields.numbers::<3>(at, Number::I32);
    let f32s = |at: usize| fields.numbers::<3>(at, Number::F32);
    let element = match whole(12) {
        0 => Number::I8,
        1 => Number::I16,
        2 => Number::F32,
        6 => Number::U16,
        mode => return bad("mode", &mode, "0, 1, 2 or 6: real numbers"),
    };
    let extended = whole(92);
    if extended < 0 {
        return bad("NSYMBT", &extended, "the length of what follows the header");
    }
    let angles = f32s(52);
    let is_right = |angle: &f64| *angle == 0.0 || (angle - 90.0).abs() < SKEW;
    if !angles.iter().all(is_right) {
        return bad("CELLB", &format!("{angles:?}"), "right angles");
    }
    // For columns, rows and sections, the axis in space; without any they are x, y, z.
    let axes = match i32s(64).map(|axis| axis as i32) {
        [0, 0, 0] => [0, 1, 2],
        axes => {
            let mut sorted = axes;
            sorted.sort_unstable();
            if sorted != [1, 2, 3] {
                return bad("MAPC", &format!("{axes:?}"), "an order of 1, 2, 3");
            }
            axes.map(|axis| axis as usize - 1)
        }
    };
    let (intervals, cell) = (i32s(28), f32s(40));
    let sides = [0, 1, 2].map(|axis| match (cell[axis], intervals[axis]) {
        // What is not written is one.
        (side, count) if side == 0.0 || count <= 0.0 => 1.0,
        (side, count) => side / count,
    });
    let (starts, origin) = (i32s(16), f32s(196));
    let mut matrix = DMat3::ZERO;
    let mut first = DVec3::ZERO;
    for (own, &axis) in axes.iter().enumerate() {
        matrix.col_mut(own)[axis] = sides[axis];
        first[axis] = starts[own] * sides[axis];
    }
    if origin.iter().any(|x| *x != 0.0) {
        first = origin.into();
    }
    let size = size("MRC", i32s(0))?;
    Ok(Header {
        size,
        frames: Frames::in_turn(1, size),
        element,
        big_endian: fields.big_endian,
        scale: [1.0, 0.0],
        affine: DAffine3::from_mat3_translation(matrix, first),
        start: HEAD as u64 + extended as u64,
        has_footer: false,
    })
}
