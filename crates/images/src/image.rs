//! Images as grey values and opacities.

use geometry::measure::BoundingBox;

use crate::{Error, LARGEST_IMAGE};

/// Largest value of a pixel.
const WHITE: f64 = 65535.0;

/// An image: a grey value, from black (0) to white (65535) as files store it, and an opacity at every pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    size: [u32; 2],
    grey: Vec<u16>,
    /// None if all is opaque.
    opacity: Option<Vec<u16>>,
}

impl Image {
    /// Takes over pixels, from one to [`LARGEST_IMAGE`]; without opacities, all are opaque.
    pub fn new(size: [u32; 2], grey: Vec<u16>, opacity: Option<Vec<u16>>) -> Result<Self, Error> {
        let pixels = pixels(size).ok_or(Error::ImageSize(size))?;
        let opacities = opacity.as_ref().map_or(pixels, Vec::len);
        for (values, actual) in [("grey values", grey.len()), ("opacities", opacities)] {
            if actual != pixels {
                return Err(Error::PixelCount {
                    size,
                    values,
                    actual,
                });
            }
        }
        Ok(Self {
            size,
            grey,
            opacity: opacity.filter(|o| o.iter().any(|&v| v != u16::MAX)),
        })
    }

    /// Pixels in a row, and rows.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The grey values, row by row from the top.
    pub fn grey(&self) -> &[u16] {
        &self.grey
    }

    /// The opacities, row by row from the top; `None` if all pixels are opaque.
    pub fn opacity(&self) -> Option<&[u16]> {
        self.opacity.as_deref()
    }

    /// The rectangle `[0, width] x [0, height]` that the image fills in the plane.
    pub fn bounding_box(&self) -> BoundingBox<2> {
        BoundingBox {
            lower: [0.0; 2],
            upper: self.size.map(f64::from),
        }
    }

    /// Grey value and opacity of a pixel, from 0 to 1.
    pub(crate) fn pixel(&self, index: usize) -> [f64; 2] {
        let opacity = self.opacity.as_ref().map_or(u16::MAX, |o| o[index]);
        [self.grey[index], opacity].map(|v| f64::from(v) / WHITE)
    }

    /// Indices of the pixels at the border, each once.
    pub(crate) fn border(&self) -> impl Iterator<Item = usize> + '_ {
        let [width, height] = self.size.map(|n| n as usize);
        (0..height).flat_map(move |row| {
            let whole = row == 0 || row + 1 == height;
            // The first and last pixel of rows in the middle; one pixel if there is one column.
            let step = if whole { 1 } else { (width - 1).max(1) };
            (0..width).step_by(step).map(move |x| row * width + x)
        })
    }
}

/// The number of pixels, unless there are none or too many.
pub(crate) fn pixels([width, height]: [u32; 2]) -> Option<usize> {
    let count = u64::from(width) * u64::from(height);
    (1..=LARGEST_IMAGE as u64)
        .contains(&count)
        .then_some(count as usize)
}
