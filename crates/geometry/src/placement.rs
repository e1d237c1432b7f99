//! Where a shape goes in the box of a grid.

use crate::error::positive;
use crate::measure::BoundingBox;
use crate::{Error, Grid};

/// The map `p = (x - c) s + m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement<const D: usize> {
    centre: [f64; D],
    scale: f64,
    target: [f64; D],
}

impl<const D: usize> Placement<D> {
    /// To the centre `m` of the box of the grid, without turning: `c` is the centre of the bounding
    /// box of what is placed, `s = side_length / longest side of the bounding box`.
    ///
    /// The box of the grid is `[origin, origin + side]^D`. Phase fields need a margin of a few `eps`,
    /// unless what is placed has one.
    ///
    /// # Errors
    /// The bounding box must be finite and have an extent, the side length be finite and positive;
    /// [`Error::DoesNotFit`] if that is longer than the side of the box.
    pub fn fit(bounds: &BoundingBox<D>, grid: &Grid<D>, side_length: f64) -> Result<Self, Error> {
        let side_length = positive("side length", side_length)?;
        let longest = positive("longest side of the bounding box", bounds.longest_side())?;
        if side_length > grid.side() {
            return Err(Error::DoesNotFit {
                side_length,
                box_side: grid.side(),
            });
        }
        Ok(Self {
            centre: bounds.centre(),
            scale: positive("scale", side_length / longest)?,
            target: grid.origin().map(|x| x + 0.5 * grid.side()),
        })
    }

    /// The map `p = (x - origin) scale`.
    ///
    /// # Errors
    /// The scale must be finite and positive.
    pub fn about(origin: [f64; D], scale: f64) -> Result<Self, Error> {
        Ok(Self {
            centre: origin,
            scale: positive("scale", scale)?,
            target: [0.0; D],
        })
    }

    /// The point `p` of the point `x`.
    pub fn apply(&self, x: [f64; D]) -> [f64; D] {
        std::array::from_fn(|i| (x[i] - self.centre[i]) * self.scale + self.target[i])
    }

    /// The point `x` that goes to `p`.
    pub fn apply_inverse(&self, p: [f64; D]) -> [f64; D] {
        std::array::from_fn(|i| (p[i] - self.target[i]) / self.scale + self.centre[i])
    }

    /// The factor `s`.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}
