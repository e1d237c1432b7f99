//! Animations: several pictures in one PNG file.

use std::path::Path;
use std::time::Duration;

use geometry::file::write_atomically;

use crate::error::require;
use crate::picture::encode_png;
use crate::{Error, Picture};

/// Pictures shown one after the other, for ever, as an animated PNG (APNG).
///
/// Viewers that know no APNG show the first picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Animation {
    frames: Vec<Picture>,
    delay: Duration,
}

impl Animation {
    /// An animation of the given pictures, each shown for `delay`, rounded to milliseconds.
    ///
    /// # Errors
    /// There must be a picture, all must have one size, and the delay must be from one millisecond
    /// to a minute.
    pub fn new(frames: Vec<Picture>, delay: Duration) -> Result<Self, Error> {
        let first = frames.first().ok_or(Error::NoFrames)?;
        let [first_width, first_height] = [first.width(), first.height()];
        let other =
            |(_, p): &(usize, &Picture)| [p.width(), p.height()] != [first_width, first_height];
        if let Some((index, picture)) = frames.iter().enumerate().find(other) {
            return Err(Error::FrameSize {
                index,
                width: picture.width(),
                height: picture.height(),
                first_width,
                first_height,
            });
        }
        let milliseconds = 1e3 * delay.as_secs_f64();
        require(
            "delay in milliseconds",
            milliseconds,
            "between 1 and 60000",
            |v| (1.0..=60e3).contains(&v),
        )?;
        Ok(Self { frames, delay })
    }

    /// The pictures.
    pub fn frames(&self) -> &[Picture] {
        &self.frames
    }

    /// The bytes of an APNG file.
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn to_apng(&self) -> Result<Vec<u8>, Error> {
        encode_png(&self.frames, Some(self.delay))
    }

    /// Writes an APNG file, atomically (see [`write_atomically`]).
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_apng(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let bytes = self.to_apng()?;
        Ok(write_atomically(path, |out| out.write_all(&bytes))?)
    }
}
