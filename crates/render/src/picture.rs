//! Pictures, and animations of them, as PNG files.

use std::path::Path;

use files::write_atomically;

use crate::Error;

/// Largest side of a picture, in pixels.
pub(crate) const LARGEST_SIDE: u32 = 8192;
/// How long each picture of an animation is shown, in milliseconds.
const DELAY: u16 = 200;

/// Accepts sizes that can be drawn.
///
/// # Errors
/// [`Error::PictureSize`].
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
    /// Takes over pixels.
    ///
    /// # Errors
    /// The sides must be from 1 to 8192, and the pixels as many as their product.
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
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        encode_png(std::slice::from_ref(self), false)
    }

    /// Writes a PNG file, atomically (see [`write_atomically`]).
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let bytes = self.to_png()?;
        Ok(write_atomically(path, |out| out.write_all(&bytes))?)
    }
}

/// The bytes of an animated PNG file (APNG): pictures shown one after the other, for ever, five a
/// second. Viewers that know no APNG show the first picture.
///
/// # Errors
/// There must be a picture, and all must have one size; [`Error::Encode`].
pub fn animation(frames: &[Picture]) -> Result<Vec<u8>, Error> {
    let first = frames.first().ok_or(Error::NoFrames)?;
    if let Some(index) = frames.iter().position(|frame| frame.size != first.size) {
        return Err(Error::FrameSize {
            index,
            size: frames[index].size,
            first: first.size,
        });
    }
    encode_png(frames, true)
}

/// A PNG file. Opaque pictures are stored without opacity.
fn encode_png(frames: &[Picture], animated: bool) -> Result<Vec<u8>, Error> {
    let mut pixels = frames.iter().flat_map(|frame| &frame.pixels);
    let (colour, channels) = if pixels.all(|pixel| pixel[3] == 255) {
        (png::ColorType::Rgb, 3)
    } else {
        (png::ColorType::Rgba, 4)
    };
    let ([width, height], mut bytes) = (frames[0].size, Vec::new());
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    if animated {
        encoder.set_animated(frames.len() as u32, 0)?;
        encoder.set_frame_delay(DELAY, 1000)?;
    }
    let mut writer = encoder.write_header()?;
    for frame in frames {
        let channels = frame.pixels.iter().flat_map(|pixel| &pixel[..channels]);
        writer.write_image_data(&channels.copied().collect::<Vec<u8>>())?;
    }
    writer.finish()?;
    Ok(bytes)
}
