//! Pictures, and animations of them, as PNG files.

use std::path::Path;

use files::write_atomically;

use crate::Error;
use crate::error::LARGEST_SIDE;

/// How long each picture of an animation is shown, in milliseconds.
const DELAY: u16 = 200;

/// Accepts sizes that can be drawn: sides from 1 to 8192.
pub fn checked_size(size: [u32; 2]) -> Result<[u32; 2], Error> {
    if size.iter().all(|side| (1..=LARGEST_SIDE).contains(side)) {
        return Ok(size);
    }
    Err(Error::PictureSize(size))
}

/// A picture: 8-bit sRGB with straight (not premultiplied) opacity, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    size: [u32; 2],
    pixels: Vec<[u8; 4]>,
}

impl Picture {
    /// Takes over pixels, which must be as many as the [size](checked_size) says.
    pub fn new(size: [u32; 2], pixels: Vec<[u8; 4]>) -> Result<Self, Error> {
        let [width, height] = checked_size(size)?.map(|side| side as usize);
        let actual = pixels.len();
        if actual != width * height {
            return Err(Error::PixelCount { size, actual });
        }
        Ok(Self { size, pixels })
    }

    /// Pixels in a row, and rows.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// All pixels, row by row from the top.
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }

    /// One pixel: red, green, blue, opacity.
    ///
    /// # Panics
    /// If there is no such pixel.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        assert!(x < self.size[0], "x = {x} is not below {}", self.size[0]);
        self.pixels[y as usize * self.size[0] as usize + x as usize]
    }

    /// The bytes of a PNG file.
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        let (mut bytes, opaque) = (Vec::new(), self.is_opaque());
        let mut writer = encoder(&mut bytes, self.size, opaque).write_header()?;
        writer.write_image_data(&self.channels(opaque))?;
        writer.finish()?;
        Ok(bytes)
    }

    fn is_opaque(&self) -> bool {
        self.pixels.iter().all(|pixel| pixel[3] == 255)
    }

    /// All of its numbers, without opacity if it is opaque.
    fn channels(&self, opaque: bool) -> Vec<u8> {
        let channels = if opaque { 3 } else { 4 };
        let pixels = self.pixels.iter();
        pixels
            .flat_map(|pixel| &pixel[..channels])
            .copied()
            .collect()
    }

    /// Writes a PNG file, atomically (see [`write_atomically`]).
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let bytes = self.to_png()?;
        Ok(write_atomically(path, |out| out.write_all(&bytes))?)
    }
}

/// The bytes of an animated PNG file (APNG): `count` pictures, one at least and all of one size, shown one after the other, for ever,
/// five a second. Viewers that know no APNG show the first picture. Each is made twice, so that there is never more than one in memory.
pub fn animation<E: From<Error>>(
    count: usize,
    frame: impl Fn(usize) -> Result<Picture, E>,
) -> Result<Vec<u8>, E> {
    let (mut first, mut opaque) = (None, true);
    for index in 0..count {
        let frame = frame(index)?;
        let (size, first) = (frame.size, *first.get_or_insert(frame.size));
        if size != first {
            return Err(Error::FrameSize { index, size, first }.into());
        }
        opaque &= frame.is_opaque();
    }
    let size = first.ok_or(Error::NoFrames)?;
    let mut bytes = Vec::new();
    let failed = |error: png::EncodingError| Error::from(error);
    let mut encoder = encoder(&mut bytes, size, opaque);
    encoder.set_animated(count as u32, 0).map_err(failed)?;
    encoder.set_frame_delay(DELAY, 1000).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    for index in 0..count {
        let channels = frame(index)?.channels(opaque);
        writer.write_image_data(&channels).map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// A PNG file. Opaque pictures are stored without opacity.
fn encoder(
    bytes: &mut Vec<u8>,
    [width, height]: [u32; 2],
    opaque: bool,
) -> png::Encoder<'_, &mut Vec<u8>> {
    let mut encoder = png::Encoder::new(bytes, width, height);
    encoder.set_color(if opaque {
        png::ColorType::Rgb
    } else {
        png::ColorType::Rgba
    });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder
}
