//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

use crate::read::error::FormatError;

/// Errors of images, outlines, placement and drawings, each with the numbers needed to act on it.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A file is no usable image.
    #[error("{path} cannot be read as an image: {problem}", path = path.display())]
    Format { path: PathBuf, problem: FormatError },
    /// Grids, fields and the operating system.
    Geometry(#[from] geometry::Error),
    /// Pictures and their encoding.
    Picture(#[from] render::Error),
    /// A number is outside the range in which the formula makes sense.
    #[error("{name} = {value} is not allowed: it must be {requirement}")]
    InvalidParameter {
        name: &'static str,
        value: f64,
        requirement: &'static str,
    },
    /// An image without pixels, or with more than are accepted.
    #[error(
        "an image of {width} x {height} pixels cannot be used; it needs at least one pixel and \
         may have up to {limit}"
    )]
    ImageSize {
        width: u32,
        height: u32,
        limit: usize,
    },
    /// The number of values is not that of the pixels.
    #[error("{width} x {height} pixels were announced, but {actual} {values} given")]
    PixelCount {
        width: u32,
        height: u32,
        /// What is given: grey values or opacities.
        values: &'static str,
        actual: usize,
    },
    /// All pixels are on the chosen side of the threshold, or none is.
    #[error(
        "{inside} is inside: {inside} is {side}; {quantity} ranges from {low:.4} to {high:.4}, so choose \
         a threshold in between, or another side"
    )]
    OneSided {
        /// "everything" or "nothing".
        inside: &'static str,
        side: String,
        quantity: &'static str,
        low: f64,
        high: f64,
    },
    /// An outline with too many segments: noise, or a photograph.
    #[error(
        "the outline would have about {segments} segments, more than {limit}: this is noise and \
         no shape; blur the image or make it smaller"
    )]
    Noise { segments: usize, limit: usize },
    /// A field without an interface.
    #[error(
        "the phase field has no interface: its values range from {low:.4} to {high:.4}, and do \
         not change sign"
    )]
    NoInterface { low: f64, high: f64 },
    /// Curves that bound nothing.
    #[error("no curve was given; an outline needs at least one closed curve")]
    NoCurves,
    /// A curve that bounds nothing.
    #[error(
        "curve {curve} has {points} points and is {state}; an outline is made of closed curves of \
         at least 3 points"
    )]
    OpenCurve {
        /// Which curve, from 0.
        curve: usize,
        points: usize,
        /// Open or closed.
        state: &'static str,
    },
    /// A point of a curve is NaN or infinite, or so large that squares overflow.
    #[error(
        "point {point} of curve {curve} is {position:?}; coordinates must be finite and below \
         {limit:e}"
    )]
    CurvePoint {
        /// Which curve, from 0.
        curve: usize,
        /// Which of its points, from 0.
        point: usize,
        position: [f64; 2],
        limit: f64,
    },
    /// A region that contains no node.
    #[error(
        "no node of the grid of {nodes} nodes is in the region, so nothing could move; check where \
         it is placed, or use a finer grid"
    )]
    EmptyMask { nodes: usize },
}

/// Accepts numbers for which `condition` holds.
pub(crate) fn require(
    name: &'static str,
    value: f64,
    requirement: &'static str,
    condition: impl FnOnce(f64) -> bool,
) -> Result<f64, Error> {
    if value.is_finite() && condition(value) {
        Ok(value)
    } else {
        Err(Error::InvalidParameter {
            name,
            value,
            requirement,
        })
    }
}

/// Accepts finite positive numbers.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64, Error> {
    require(name, value, "finite and positive", |v| v > 0.0)
}
