//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

/// Largest side of a picture, in pixels.
pub(crate) const LARGEST_SIDE: u32 = 8192;

/// Errors of scenes and pictures, each with the numbers needed to act on it.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A field, or a number outside its allowed range.
    Geometry(#[from] geometry::Error),
    /// A file cannot be written.
    Io(#[from] files::Error),
    /// A surface cannot be found.
    Surface(#[from] surfaces::Error),
    #[error("the picture could not be encoded as PNG")]
    Encode(#[from] png::EncodingError),
    #[error(
        "there is no surface and no tube, so nothing can be framed; say within which box for a \
         picture that may be empty"
    )]
    NothingToFrame,
    #[error("tube {index} has {points} points; it needs at least 2")]
    TubePoints {
        /// Which tube, from 0.
        index: usize,
        points: usize,
    },
    #[error("a picture of {} x {} pixels cannot be drawn; use 1 to {LARGEST_SIDE} a side", _0[0], _0[1])]
    PictureSize([u32; 2]),
    #[error("{} x {} pixels were announced, but {actual} given", size[0], size[1])]
    PixelCount { size: [u32; 2], actual: usize },
    #[error("an animation needs at least one picture")]
    NoFrames,
    #[error(
        "picture {index} of the animation has {} x {} pixels, but the first has {} x {}",
        size[0], size[1], first[0], first[1]
    )]
    FrameSize {
        /// Which picture, from 0.
        index: usize,
        size: [u32; 2],
        first: [u32; 2],
    },
}
