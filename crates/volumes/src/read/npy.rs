//! Arrays of `NumPy`, by the crate `geometry`.

use geometry::npy::{Array, NpyError};
use glam::DAffine3;

use super::{Contents, Frames, length};
use crate::volume::Voxels;
use crate::{FormatError, Volume};

pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

pub(super) fn decode(contents: Contents<'_>) -> Result<Volume, FormatError> {
    let array = Array::of(contents.bytes)?;
    let Ok(size) = <[u64; 3]>::try_from(&*array.shape) else {
        return Err(FormatError::Npy(NpyError::Rank {
            expected: 3,
            shape: array.shape,
        }));
    };
    length(size, array.number, contents.limit())?;
    array.check_length()?;
    Frames::in_turn(1, size).chosen(contents.frame)?;
    let size = size.map(|n| n as usize);
    let voxels = Voxels {
        bytes: if array.fortran_order {
            array.data.to_vec()
        } else {
            turned(&array, size)
        },
        element: array.number,
        big_endian: array.big_endian,
        scale: [1.0, 0.0],
    };
    Volume::new(size, DAffine3::IDENTITY, voxels)
}

/// The elements with the first axis fastest, of which the last one is.
fn turned(array: &Array<'_>, [nx, ny, nz]: [usize; 3]) -> Vec<u8> {
    let element = array.number.size();
    let mut bytes = Vec::with_capacity(array.data.len());
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let at = element * (k + nz * (j + ny * i));
                bytes.extend_from_slice(&array.data[at..at + element]);
            }
        }
    }
    bytes
}
