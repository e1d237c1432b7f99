//! Files in.

mod mrc;
mod nifti;
mod stack;

use std::io::Read;
use std::path::Path;

use files::Number;
use flate2::read::MultiGzDecoder;
use glam::DAffine3;

use crate::volume::Voxels;
use crate::{Error, FormatError, Volume};

pub use stack::is_stack;

/// Most bytes of voxels of a file that has fewer itself.
const MOST_BYTES: u64 = 1 << 31;
/// As many bytes at the beginning as have all headers.
const HEAD: usize = 1024;
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads a volume of a format that is told by its contents, not by its extension.
///
/// - NIfTI-1 and NIfTI-2 in one file, also compressed by gzip: voxels are placed by the `sform`, or else by the `qform`, or else by
///   their sizes alone, in the units of the file. Values are scaled by `scl_slope` and `scl_inter`.
/// - MRC and CCP4 maps of modes 0, 1, 2 and 6, with cells of right angles, also compressed: the axes are as `MAPC`, `MAPR` and `MAPS` say,
///   and the first voxel is at `ORIGIN`, or else at `NXSTART`, `NYSTART`, `NZSTART`.
/// - Stacks of TIFF images with one number per pixel, as it is in the file also where white is zero. The axes are columns, rows and pages;
///   pixels have the sizes of the resolution, in millimetres where that is per inch, as without a unit, or centimetre. Pages have the
///   distance of rows, and those of ImageJ the one that it notes, or else 1; its values are calibrated by a straight line.
///
/// Memory: four times the bytes of the voxels, of which there may be as many as the file has, or 2^31 if it has fewer, and 1 GiB.
/// Truncated and overlong files are refused, and values that are not finite.
pub fn read(path: impl AsRef<Path>) -> Result<Volume, Error> {
    let path = path.as_ref();
    let bytes = files::read(path)?;
    decode(&bytes).map_err(|problem| Error::Format {
        path: path.into(),
        problem,
    })
}

/// The volume in the bytes of a file; see [`read`].
pub fn decode(bytes: &[u8]) -> Result<Volume, FormatError> {
    let limit = MOST_BYTES.max(bytes.len() as u64);
    if stack::is_tiff(bytes) {
        return stack::decode(bytes, limit);
    }
    if bytes.starts_with(&GZIP) {
        unpacked(MultiGzDecoder::new(bytes), limit)
    } else {
        unpacked(bytes, limit)
    }
}

/// A header with the voxels behind it, while they are unpacked.
fn unpacked(mut packed: impl Read, limit: u64) -> Result<Volume, FormatError> {
    let damaged = |error: std::io::Error| FormatError::damaged("gzip", &error);
    let mut bytes = Vec::new();
    let mut head = packed.by_ref().take(HEAD as u64);
    head.read_to_end(&mut bytes).map_err(damaged)?;
    let header = match nifti::header(&bytes) {
        // What begins with the number of columns may begin as NIfTI does.
        refused @ (None | Some(Err(_))) => mrc::header(&bytes).or(refused),
        header => header,
    };
    let start = bytes.iter().take(8).copied().collect();
    let header = header.ok_or(FormatError::Unknown { start })??;
    let length = length(header.size, header.element, limit)?;
    if header.start > limit {
        return Err(FormatError::Length {
            expected: header.start,
            found: HEAD as u64,
            longer: true,
        });
    }
    let expected = header.start + length;
    // One more than announced tells that there are more.
    let rest = (expected + 1).saturating_sub(bytes.len() as u64);
    packed.take(rest).read_to_end(&mut bytes).map_err(damaged)?;
    let found = bytes.len() as u64;
    if found != expected {
        return Err(FormatError::Length {
            expected,
            found,
            longer: found > expected,
        });
    }
    bytes.drain(..header.start as usize);
    let voxels = Voxels {
        bytes,
        element: header.element,
        big_endian: header.big_endian,
        scale: header.scale,
    };
    Volume::new(header.size.map(|n| n as usize), header.frame, voxels)
}

/// Numbers in a header.
struct Fields<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl<'a> Fields<'a> {
    /// The fields of a header of `length` bytes, refused if there are fewer.
    fn new(bytes: &'a [u8], length: usize, big_endian: bool) -> Result<Self, FormatError> {
        if bytes.len() < length {
            return Err(FormatError::Length {
                expected: length as u64,
                found: bytes.len() as u64,
                longer: false,
            });
        }
        Ok(Self { bytes, big_endian })
    }

    fn number(&self, at: usize, number: Number) -> f64 {
        number.decode(&self.bytes[at..at + number.size()], self.big_endian)
    }

    /// Numbers in a row.
    fn numbers<const N: usize>(&self, at: usize, number: Number) -> [f64; N] {
        std::array::from_fn(|i| self.number(at + number.size() * i, number))
    }
}

/// What comes before the voxels.
struct Header {
    size: [u64; 3],
    element: Number,
    big_endian: bool,
    scale: [f64; 2],
    frame: DAffine3,
    /// Where the voxels begin.
    start: u64,
}

/// Numbers of voxels.
fn size(format: &'static str, size: [f64; 3]) -> Result<[u64; 3], FormatError> {
    match size.iter().find(|&&n| n < 2.0) {
        Some(n) => FormatError::entry(format, "number of voxels", n, "2 at least along each axis"),
        None => Ok(size.map(|n| n as u64)),
    }
}

/// Bytes of so many voxels.
fn length(size: [u64; 3], element: Number, limit: u64) -> Result<u64, FormatError> {
    let bytes = element.size() as u64;
    let length = size.iter().try_fold(bytes, |all, &n| all.checked_mul(n));
    let some = size.iter().all(|&n| n >= 2);
    (length.filter(|&length| some && length <= limit)).ok_or(FormatError::Size {
        size,
        bytes,
        limit,
    })
}
