//! Pictures made elsewhere as panels, such as rendered surfaces.

use srgb::Rgb;

use crate::drawable::Drawable;
use crate::error::{Error, Result};
use crate::geom::Rect;
use crate::surface::{PNG_SCALE, Surface};

/// A panel that shows a picture, with a caption below, which may be empty.
///
/// It is averaged, in linear light, over the pixels of the figure, two per layout unit, or interpolated linearly if these are smaller
/// than its own. Transparent pixels show the white page.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    pub(crate) caption: String,
    size: [usize; 2],
    pixels: Vec<[u8; 4]>,
}

impl Raster {
    /// A picture of `size` columns and rows. Pixels are red, green, blue and opacity (not multiplied into the colour), sRGB, row by row
    /// from the top.
    pub fn new(
        caption: impl Into<String>,
        size: [usize; 2],
        pixels: impl Into<Vec<[u8; 4]>>,
    ) -> Self {
        Self {
            caption: caption.into(),
            size,
            pixels: pixels.into(),
        }
    }

    pub(crate) fn checked(&self) -> Result<&Self> {
        Error::check_shape(&self.caption, self.size, self.pixels.len())?;
        Ok(self)
    }

    /// The picture on white in another size: every pixel is the mean over what it covers.
    fn averaged(&self, columns: usize, rows: usize) -> Vec<Rgb> {
        let light = |&[r, g, b, a]: &[u8; 4]| {
            let opacity = f32::from(a) / 255.0;
            [r, g, b].map(|v| opacity * srgb::decode(v) + (1.0 - opacity))
        };
        let source: Vec<[f32; 3]> = self.pixels.iter().map(light).collect();
        let across = shares(self.size[0], columns);
        let mut target = Vec::with_capacity(columns * rows);
        for down in shares(self.size[1], rows) {
            for along in &across {
                let mut sum = [0.0; 3];
                for (row, height) in &down {
                    for (column, width) in along {
                        let pixel = source[row * self.size[0] + column];
                        sum = [0, 1, 2].map(|c| sum[c] + height * width * pixel[c]);
                    }
                }
                let [r, g, b] = sum.map(srgb::encode);
                target.push(Rgb(r, g, b));
            }
        }
        target
    }
}

/// What each of `to` equal parts of a line covers of `from` others, with their numbers and shares. Parts that are smaller than the others
/// are widened to the size of one around their middle, which interpolates linearly.
fn shares(from: usize, to: usize) -> Vec<Vec<(usize, f32)>> {
    let part = |k: usize| {
        // In units of 1 / (2 to) of the others, which keeps them exact.
        let (middle, half, other) = ((2 * k + 1) * from, from.max(to), 2 * to);
        let (start, end) = (
            middle.saturating_sub(half),
            (middle + half).min(other * from),
        );
        let share = move |i: usize| end.min((i + 1) * other) - start.max(i * other);
        (start / other..end.div_ceil(other))
            .map(|i| (i, share(i) as f32 / (end - start) as f32))
            .collect()
    };
    (0..to).map(part).collect()
}

impl Drawable for &Raster {
    fn aspect(&self) -> Option<f64> {
        Some(self.size[1] as f64 / self.size[0] as f64)
    }

    fn draw(&self, surface: &mut dyn Surface, plot: Rect) {
        let pixels = |side: f64| side as usize * PNG_SCALE;
        let columns = pixels(plot.width);
        let cells = self.averaged(columns, pixels(plot.height));
        surface.image(plot, columns, &cells, true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_means_or_linear_interpolation() {
        assert_eq!(shares(2, 2), [[(0, 1.0)], [(1, 1.0)]]);
        assert_eq!(shares(4, 2), [[(0, 0.5), (1, 0.5)], [(2, 0.5), (3, 0.5)]]);
        assert_eq!(
            shares(2, 4)[..3],
            [
                vec![(0, 1.0)],
                vec![(0, 0.75), (1, 0.25)],
                vec![(0, 0.25), (1, 0.75)]
            ]
        );
        for part in shares(7, 5).into_iter().chain(shares(5, 7)) {
            let whole: f32 = part.iter().map(|(_, share)| share).sum();
            assert!((whole - 1.0).abs() < 1e-6);
        }
    }
}
