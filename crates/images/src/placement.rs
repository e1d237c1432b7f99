//! Where an image goes in the box of a grid.

use geometry::Grid;
use geometry::measure::BoundingBox;

use crate::Error;
use crate::error::{positive, require};

/// The map `p = (x - c) s + m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    centre: [f64; 2],
    scale: f64,
    target: [f64; 2],
}

impl Placement {
    /// To the centre `m` of the box of the grid, without turning: `c` is the centre of a rectangle,
    /// `s = side_length / longest side of the rectangle`.
    ///
    /// The rectangle is that of the whole image ([`Image::bounding_box`]), so that all images of
    /// one size are placed alike, or that of the shape ([`Outline::bounding_box`]), whatever is
    /// empty around it. The box is `[origin, origin + side]^2`. Phase fields need a margin of
    /// a few `eps`, unless the image has one.
    ///
    /// [`Image::bounding_box`]: crate::Image::bounding_box
    /// [`Outline::bounding_box`]: crate::Outline::bounding_box
    ///
    /// # Errors
    /// The rectangle must be finite and have an extent, the side length be finite and positive, the
    /// margin finite and not negative; [`Error::DoesNotFit`] unless `side_length + 2 margin <=
    /// side` of the box.
    pub fn fit(
        bounds: &BoundingBox<2>,
        grid: &Grid<2>,
        side_length: f64,
        margin: f64,
    ) -> Result<Self, Error> {
        let margin = require("margin", margin, "finite and not negative", |v| v >= 0.0)?;
        let side_length = positive("side length", side_length)?;
        let [width, height] = bounds.extent();
        let longest = positive("longest side of the rectangle", width.max(height))?;
        let largest = (grid.side() - 2.0 * margin).max(0.0);
        if side_length > largest {
            return Err(Error::DoesNotFit {
                side_length,
                box_side: grid.side(),
                margin,
                largest,
            });
        }
        Ok(Self {
            centre: bounds.centre(),
            scale: positive("scale", side_length / longest)?,
            target: grid.origin().map(|x| x + 0.5 * grid.side()),
        })
    }

    /// The point `p` of the point `x` of the image.
    pub fn apply(&self, x: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| (x[i] - self.centre[i]) * self.scale + self.target[i])
    }

    /// The point `x` of the image that goes to `p`.
    pub fn apply_inverse(&self, p: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| (p[i] - self.target[i]) / self.scale + self.centre[i])
    }

    /// The factor `s`: the side of a pixel.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}
