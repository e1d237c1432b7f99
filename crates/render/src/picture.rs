//! Pictures: light in, sRGB pixels out.

use std::ops::{Add, Mul};
use std::path::Path;
use std::time::Duration;

use geometry::file::write_atomically;
use srgb::{Rgb, decode, encode};

use crate::Error;

/// Largest side of a picture, in pixels.
pub const LARGEST_SIDE: u32 = 8192;

/// Accepts sizes that can be drawn.
pub(crate) fn checked(size: [u32; 2]) -> Result<[u32; 2], Error> {
    if size.iter().all(|side| (1..=LARGEST_SIDE).contains(side)) {
        return Ok(size);
    }
    Err(Error::PictureSize {
        width: size[0],
        height: size[1],
        limit: LARGEST_SIDE,
    })
}

/// Linear intensities, multiplied by the opacity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Light {
    rgb: [f32; 3],
    alpha: f32,
}

impl Light {
    pub fn opaque(rgb: [f32; 3]) -> Self {
        Self { rgb, alpha: 1.0 }
    }

    pub fn black(alpha: f32) -> Self {
        Self {
            rgb: [0.0; 3],
            alpha,
        }
    }

    fn decode([r, g, b, a]: [u8; 4]) -> Self {
        let alpha = f32::from(a) / 255.0;
        Self {
            rgb: [r, g, b].map(|v| alpha * decode(v)),
            alpha,
        }
    }

    /// This in front of something else.
    pub fn over(self, behind: Self) -> Self {
        self + behind * (1.0 - self.alpha)
    }

    /// The sRGB value, not multiplied by the opacity.
    pub fn encode(self) -> [u8; 4] {
        if self.alpha <= 0.0 {
            return [0; 4];
        }
        let [r, g, b] = self.rgb.map(|v| encode(v / self.alpha));
        [r, g, b, (255.0 * self.alpha.min(1.0)).round() as u8]
    }
}

impl Add for Light {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            rgb: std::array::from_fn(|c| self.rgb[c] + other.rgb[c]),
            alpha: self.alpha + other.alpha,
        }
    }
}

impl Mul<f32> for Light {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self {
            rgb: self.rgb.map(|v| v * factor),
            alpha: self.alpha * factor,
        }
    }
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
    /// The sides must be from 1 to 8192, and the pixels `width * height`.
    pub fn new(width: u32, height: u32, pixels: Vec<[u8; 4]>) -> Result<Self, Error> {
        let [width, height] = checked([width, height])?;
        if pixels.len() != width as usize * height as usize {
            return Err(Error::PixelCount {
                width,
                height,
                actual: pixels.len(),
            });
        }
        Ok(Self::from_parts([width, height], pixels))
    }

    pub(crate) fn from_parts(size: [u32; 2], pixels: Vec<[u8; 4]>) -> Self {
        Self { size, pixels }
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.size[0]
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.size[1]
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

    /// The picture in front of a colour, blended in linear light.
    #[must_use]
    pub fn over(&self, colour: Rgb) -> Self {
        let behind = Light::opaque(colour.linear());
        let pixels = self.pixels.iter();
        Self {
            size: self.size,
            pixels: pixels
                .map(|&p| Light::decode(p).over(behind).encode())
                .collect(),
        }
    }

    /// The picture in the bytes of a PNG file as this crate writes them: eight bits, with or without opacity; the first one of an
    /// animation.
    ///
    /// # Errors
    /// [`Error::Decode`]; as [`Picture::new`].
    pub fn from_png(bytes: &[u8]) -> Result<Self, Error> {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info()?;
        let mut data = vec![0; reader.output_buffer_size().unwrap_or(0)];
        let info = reader.next_frame(&mut data)?;
        let channels = info.color_type.samples();
        let pixels = data[..info.buffer_size()].chunks_exact(channels).map(|p| {
            let opacity = p.get(3).copied().unwrap_or(u8::MAX);
            [p[0], p[1 % channels], p[2 % channels], opacity]
        });
        Self::new(info.width, info.height, pixels.collect())
    }

    /// The bytes of a PNG file.
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        encode_png(std::slice::from_ref(self), None)
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

/// A PNG file of the first picture or, with a delay, of all. Opaque pictures are stored without
/// opacity.
pub(crate) fn encode_png(frames: &[Picture], delay: Option<Duration>) -> Result<Vec<u8>, Error> {
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
