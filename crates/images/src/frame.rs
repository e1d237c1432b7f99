//! Which part of the plane a drawing shows, and how large its pixels are.

use geometry::{Grid, positive, require};
use serde::{Deserialize, Serialize};

use crate::Error;

/// A raster of square pixels in the plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    size: [u32; 2],
    upper_left: [f64; 2],
    pixel: f64,
}

impl Frame {
    /// A raster of so many columns and rows of pixels of side `pixel > 0`, by its upper left corner; sizes as in [`render::checked_size`].
    pub fn new(size: [u32; 2], upper_left: [f64; 2], pixel: f64) -> Result<Self, Error> {
        for x in upper_left {
            require("coordinate of the corner", x, "finite", |_| true)?;
        }
        Ok(Self {
            size: render::checked_size(size)?,
            upper_left,
            pixel: positive("side of a pixel", pixel)?,
        })
    }

    /// The box of a grid, with that many pixels a side.
    pub fn of_box(grid: &Grid<2>, pixels: u32) -> Result<Self, Error> {
        let [x, y] = grid.origin();
        let pixel = grid.side() / f64::from(pixels.max(1));
        Self::new([pixels; 2], [x, y + grid.side()], pixel)
    }

    /// Pixels in a row, and rows.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The side of a pixel.
    pub fn pixel(&self) -> f64 {
        self.pixel
    }

    /// The point at `[column, row]` in pixels from the upper left corner, columns to the right and
    /// rows downwards.
    pub fn point(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.upper_left;
        [x + column * self.pixel, y - row * self.pixel]
    }

    /// The inverse of [`Frame::point`].
    pub fn position(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top] = self.upper_left;
        [(x - left) / self.pixel, (top - y) / self.pixel]
    }
}
