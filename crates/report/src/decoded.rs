//! Test helpers: look at the pixels of an encoded picture.

use srgb::Rgb;

/// Width, height and RGB bytes of a PNG file.
pub(crate) fn rgb(bytes: &[u8]) -> (usize, usize, Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgb);
    (info.width as usize, info.height as usize, pixels)
}

/// A decoded picture addressed in layout units.
pub(crate) struct Picture {
    pub width: usize,
    pub height: usize,
    pixels: Vec<u8>,
}

impl Picture {
    pub fn new(bytes: &[u8]) -> Self {
        let (width, height, pixels) = rgb(bytes);
        Self {
            width,
            height,
            pixels,
        }
    }

    pub fn pixel(&self, x: usize, y: usize) -> Rgb {
        let k = 3 * (y * self.width + x);
        Rgb(self.pixels[k], self.pixels[k + 1], self.pixels[k + 2])
    }

    /// Whether `colour` occurs within `reach` layout units of a point.
    pub fn has_near(&self, colour: Rgb, x: f64, y: f64, reach: f64) -> bool {
        let scale = f64::from(crate::surface::PNG_SCALE);
        let range = |c: f64, limit: usize| {
            let from = ((c - reach) * scale).max(0.0) as usize;
            from..=(((c + reach) * scale) as usize).min(limit - 1)
        };
        range(y, self.height)
            .any(|row| range(x, self.width).any(|column| self.pixel(column, row) == colour))
    }

    /// Number of pixels of exactly this colour.
    pub fn count(&self, colour: Rgb) -> usize {
        let Rgb(r, g, b) = colour;
        self.pixels
            .chunks_exact(3)
            .filter(|p| *p == [r, g, b])
            .count()
    }
}
