//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

/// Errors of volumes, their files and what is taken of them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error(transparent)]
    Io(#[from] files::Error),
    #[error("{path} cannot be read as a volume: {problem}", path = path.display())]
    Format { path: PathBuf, problem: FormatError },
    /// The number of values is not that of the voxels, or one of them is no number, or they have no place in space.
    #[error("no volume: {0}")]
    Volume(FormatError),
    #[error("no voxel is {what}: the values range from {low} to {high}")]
    NothingInside { what: String, low: f64, high: f64 },
    #[error("{path} must end in .nii or .nii.gz: volumes are written as NIfTI", path = path.display())]
    UnknownFormat { path: PathBuf },
    #[error(
        "{path} cannot be written: the volume has {} x {} x {} voxels, and NIfTI-1 has up to {most} along each axis; take fewer",
        size[0], size[1], size[2], path = path.display()
    )]
    TooManyVoxels {
        path: PathBuf,
        size: [usize; 3],
        most: usize,
    },
    #[error(transparent)]
    Surfaces(#[from] surfaces::Error),
}

/// What is wrong with the contents of a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    #[error(
        "it begins with the bytes {start:02x?}, and is none of NIfTI (.nii, .nii.gz), NRRD (.nrrd, .nhdr), MGH (.mgh, .mgz), MRC (.mrc, .map), \
         stacks of TIFF images and NPY"
    )]
    Unknown { start: Vec<u8> },
    #[error("{entry} of the {format} header is {value}; it must be {requirement}")]
    Header {
        format: &'static str,
        entry: &'static str,
        value: String,
        requirement: &'static str,
    },
    #[error("it should have {expected} bytes by its header, and has {found}{}", if *longer { " or more" } else { "" })]
    Length {
        expected: u64,
        found: u64,
        longer: bool,
    },
    #[error(
        "it has {} x {} x {} voxels of {bytes} bytes, and may have up to {limit} bytes of voxels, with two along each axis at least",
        size[0], size[1], size[2]
    )]
    Size {
        size: [u64; 3],
        bytes: u64,
        limit: u64,
    },
    #[error(
        "voxel {index:?} has the value {value}; values must be finite, or NaN outside of a body"
    )]
    Infinite { index: [usize; 3], value: f64 },
    #[error("no voxel has a value: all are NaN")]
    NoValues,
    #[error("it holds {count} volumes, such as those of several times: give `frame` N of one of them, from 0 to {}", count - 1)]
    SeveralFrames { count: u64 },
    #[error("there is no `frame` {frame}: it holds {count} {}", up_to(*count))]
    NoFrame { frame: u64, count: u64 },
    #[error(transparent)]
    Npy(#[from] geometry::npy::NpyError),
    #[error("damaged, truncated or unusual {format}: {message}")]
    Damaged {
        format: &'static str,
        message: String,
    },
}

/// Which volumes there are.
fn up_to(count: u64) -> String {
    match count {
        1 => "volume: leave it out".to_owned(),
        _ => format!("volumes, from 0 to {}", count - 1),
    }
}

impl FormatError {
    /// An entry of a header that cannot be used.
    pub(crate) fn entry<T>(
        format: &'static str,
        entry: &'static str,
        value: &impl ToString,
        requirement: &'static str,
    ) -> Result<T, Self> {
        Err(Self::Header {
            format,
            entry,
            value: value.to_string(),
            requirement,
        })
    }

    pub(crate) fn damaged(format: &'static str, error: &impl ToString) -> Self {
        Self::Damaged {
            format,
            message: files::shortened(&error.to_string(), 160),
        }
    }
}
