//! Animations: several pictures in one PNG file.

use std::path::Path;
use std::time::Duration;

use geometry::file::write_atomically;

use crate::error::require;
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
        encode(&self.frames, Some(self.delay))
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

/// A PNG file of the first picture or, with a delay, of all. Opaque pictures are stored without
/// opacity.
pub(crate) fn encode(frames: &[Picture], delay: Option<Duration>) -> Result<Vec<u8>, Error> {
    let opaque = frames
        .iter()
        .all(|f| f.pixels().iter().all(|p| p[3] == 255));
    let (colour, channels) = if opaque {
        (png::ColorType::Rgb, 3)
    } else {
        (png::ColorType::Rgba, 4)
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, frames[0].width(), frames[0].height());
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    if let Some(delay) = delay {
        encoder.set_animated(frames.len() as u32, 0)?;
        encoder.set_frame_delay(delay.as_secs_f64().mul_add(1e3, 0.5) as u16, 1000)?;
    }
    let mut writer = encoder.write_header()?;
    let shown = if delay.is_some() {
        frames
    } else {
        &frames[..1]
    };
    for frame in shown {
        let data: Vec<u8> = frame
            .pixels()
            .iter()
            .flat_map(|pixel| &pixel[..channels])
            .copied()
            .collect();
        writer.write_image_data(&data)?;
    }
    writer.finish()?;
    Ok(bytes)
}
