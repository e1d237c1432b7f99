//! Files in.

mod mgh;
mod mrc;
mod nifti;
mod npy;
mod nrrd;
mod stack;
mod stream;

use std::io::{BufReader, Read};
use std::path::Path;

use files::Number;
use flate2::read::MultiGzDecoder;
use glam::DAffine3;

use crate::{Error, FormatError, Volume};
use stream::Stream;

pub use stack::{holds_stack, is_stack};

/// Most bytes of voxels of a file that has fewer itself.
const MOST_BYTES: u64 = 1 << 31;
/// As many bytes at the beginning as have all headers but that of NRRD, which is text.
const HEAD: usize = 1024;
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads a volume of a format that is told by its contents, not by its extension.
///
/// - NIfTI-1 and NIfTI-2 in one file, also compressed by gzip: voxels are placed by the `sform`, or else by the `qform`, or else by
///   their sizes alone, in the units of the file. Values are scaled by `scl_slope` and `scl_inter`.
/// - NRRD with three axes in space, raw, compressed by gzip or as text, in the same file or in one beside it: voxels are placed by `space
///   directions` and `space origin`, or else by `spacings` from 0. Left and posterior axes are turned to right and anterior ones, as NIfTI
///   has them.
/// - MGH of FreeSurfer, also compressed (MGZ): voxels are placed by the directions and the centre in its header.
/// - MRC and CCP4 maps of modes 0, 1, 2 and 6, with cells of right angles, also compressed: the axes are as `MAPC`, `MAPR` and `MAPS` say,
///   and the first voxel is at `ORIGIN`, or else at `NXSTART`, `NYSTART`, `NZSTART`.
/// - Stacks of TIFF images with one number per pixel, as it is in the file also where white is zero. The axes are columns, rows and pages.
///   Voxels of OME-TIFF have the sizes `PhysicalSizeX`, `PhysicalSizeY` and `PhysicalSizeZ`, in the unit of the first of them. Other pixels have
///   the sizes of the resolution, in millimetres where that is per inch, as without a unit, or centimetre. Pages have the
///   distance of rows, and those of ImageJ the one that it notes, or else 1; its values are calibrated by a straight line.
/// - NPY arrays of three axes: voxels of side 1 from 0, the first index along x.
///
/// Voxels that are not a number (NaN) are outside, and a [warning](Volume::warnings) has their number. Infinite values are refused, and so
/// are truncated and overlong files, and files of several volumes: see [`read_frame`].
///
/// Memory: four times the bytes of the voxels, of which there may be as many as the file has, or 2^31 if it has fewer, and 1 GiB. Numbers
/// in text count as eight bytes.
pub fn read(path: impl AsRef<Path>) -> Result<Volume, Error> {
    read_frame(path, None)
}

/// Reads one of several volumes in a file, such as those of several times, counted from 0: all axes of NIfTI beyond the third, the axis of
/// NRRD that is not in space, the frames of MGH, the channels and times of TIFF. See [`read`], which this is without a frame; memory is taken
/// for this volume alone.
pub fn read_frame(path: impl AsRef<Path>, frame: Option<u64>) -> Result<Volume, Error> {
    let path = path.as_ref();
    let bytes = files::read(path)?;
    let format = |problem| Error::Format {
        path: path.into(),
        problem,
    };
    let beside = match nrrd::data_file(&bytes).map_err(format)? {
        Some(name) => Some(files::read(path.with_file_name("").join(name))?),
        None => None,
    };
    let contents = Contents {
        bytes: &bytes,
        beside: beside.as_deref(),
        frame,
        room: MOST_BYTES,
    };
    contents.volume().map_err(format)
}

/// The volume in the bytes of a file; see [`read`].
pub fn decode(bytes: &[u8]) -> Result<Volume, FormatError> {
    decode_frame(bytes, None)
}

/// One of several volumes in the bytes of a file; see [`read_frame`].
pub fn decode_frame(bytes: &[u8], frame: Option<u64>) -> Result<Volume, FormatError> {
    let contents = Contents {
        bytes,
        beside: None,
        frame,
        room: MOST_BYTES,
    };
    contents.volume()
}

/// What is read.
#[derive(Clone, Copy)]
struct Contents<'a> {
    bytes: &'a [u8],
    /// The bytes of the file with the voxels, if that is another one.
    beside: Option<&'a [u8]>,
    /// Which of several volumes.
    frame: Option<u64>,
    /// Most bytes of voxels, if there are fewer in the file itself.
    room: u64,
}

impl Contents<'_> {
    fn volume(self) -> Result<Volume, FormatError> {
        let bytes = self.bytes;
        if stack::is_tiff(bytes) {
            stack::decode(self)
        } else if npy::is_npy(bytes) {
            npy::decode(self)
        } else if nrrd::is_nrrd(bytes) {
            nrrd::decode(self)
        } else if bytes.starts_with(&GZIP) {
            self.unpacked(MultiGzDecoder::new(bytes))
        } else {
            self.unpacked(bytes)
        }
    }

    /// Most bytes of voxels.
    fn limit(self) -> u64 {
        let data = self.beside.unwrap_or(self.bytes);
        self.room.max(data.len() as u64)
    }

    /// A header with the voxels behind it, while they are unpacked.
    fn unpacked(self, mut packed: impl Read) -> Result<Volume, FormatError> {
        let mut head = Vec::new();
        let mut first = packed.by_ref().take(HEAD as u64);
        (first.read_to_end(&mut head)).map_err(|error| FormatError::damaged("gzip", &error))?;
        let header = match nifti::header(&head) {
            // What begins with the number of columns may begin as NIfTI does, and as MGH.
            refused @ (None | Some(Err(_))) => {
                (mrc::header(&head).or(refused)).or_else(|| mgh::header(&head))
            }
            header => header,
        };
        let start = head.iter().take(8).copied().collect();
        let header = header.ok_or(FormatError::Unknown { start })??;
        let all = head.as_slice().chain(BufReader::new(packed));
        Stream::new(all).volume(&header, self)
    }
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
    /// Of one volume.
    size: [u64; 3],
    frames: Frames,
    element: Number,
    big_endian: bool,
    scale: [f64; 2],
    /// From coordinates in voxels to positions.
    affine: DAffine3,
    /// Where the voxels begin.
    start: u64,
    /// Whether something may follow behind the voxels.
    has_footer: bool,
}

/// Several volumes in a file.
#[derive(Clone, Copy)]
struct Frames {
    /// How many there are.
    count: u64,
    /// So many voxels of one are in a row before those of the next one: all of them, unless the volumes are interleaved.
    row: u64,
}

impl Frames {
    /// Volumes of this size one after the other.
    fn in_turn(count: u64, size: [u64; 3]) -> Self {
        let row = size.iter().fold(1, |all: u64, &n| all.saturating_mul(n));
        Self { count, row }
    }

    /// The volume that is wanted; of one alone it need not be said.
    fn chosen(self, wanted: Option<u64>) -> Result<u64, FormatError> {
        let count = self.count;
        match wanted {
            None if count == 1 => Ok(0),
            None => Err(FormatError::SeveralFrames { count }),
            Some(frame) if frame < count => Ok(frame),
            Some(frame) => Err(FormatError::NoFrame { frame, count }),
        }
    }
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
