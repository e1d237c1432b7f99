//! Where a mesh goes in the box of a grid.

use geometry::Grid;

use crate::mesh::BoundingBox;
use crate::{ClosedMesh, Error};

/// The map `p = (x - c) s + m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    centre: [f64; 3],
    scale: f64,
    target: [f64; 3],
}

impl Placement {
    /// To the centre `m` of the box of the grid, without turning: `c` is the centre of the bounding
    /// box of the mesh, `s = side_length / longest side of the bounding box`.
    ///
    /// The box is `[origin, origin + side]^3`. Phase fields need a margin of a few `eps`.
    ///
    /// # Errors
    /// The side length must be finite and positive, the margin finite and not negative;
    /// [`Error::DoesNotFit`] unless `side_length + 2 margin <= side` of the box.
    pub fn fit(
        mesh: &ClosedMesh,
        grid: &Grid<3>,
        side_length: f64,
        margin: f64,
    ) -> Result<Self, Error> {
        let largest = largest(grid, margin)?;
        if !(side_length.is_finite() && side_length > 0.0) {
            return Err(Error::InvalidParameter {
                name: "side length",
                value: side_length,
                requirement: "finite and positive",
            });
        }
        if side_length > largest {
            return Err(Error::DoesNotFit {
                side_length,
                box_side: grid.side(),
                margin,
                largest,
            });
        }
        let bounds = mesh.bounding_box();
        Ok(Self {
            centre: bounds.centre(),
            scale: side_length / bounds.longest_side(),
            target: grid.origin().map(|x| x + 0.5 * grid.side()),
        })
    }

    /// Leaves the mesh where it is.
    ///
    /// # Errors
    /// The margin must be finite and not negative; [`Error::Outside`] if the mesh leaves the box
    /// less its margin.
    pub fn keep(mesh: &ClosedMesh, grid: &Grid<3>, margin: f64) -> Result<Self, Error> {
        let largest = largest(grid, margin)?;
        let allowed = BoundingBox {
            min: grid.origin().map(|x| x + margin),
            max: grid.origin().map(|x| x + grid.side() - margin),
        };
        let BoundingBox { min, max } = mesh.bounding_box();
        if !(allowed.contains(min) && allowed.contains(max)) {
            return Err(Error::Outside {
                min,
                max,
                margin,
                low: allowed.min,
                high: allowed.max,
                largest,
            });
        }
        Ok(Self {
            centre: [0.0; 3],
            scale: 1.0,
            target: [0.0; 3],
        })
    }

    /// The point `p` of the point `x` of the mesh.
    pub fn apply(&self, x: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (x[i] - self.centre[i]) * self.scale + self.target[i])
    }

    /// The point `x` of the mesh that goes to `p`.
    pub fn apply_inverse(&self, p: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (p[i] - self.target[i]) / self.scale + self.centre[i])
    }

    /// The factor `s`.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}

/// The largest side length that leaves the margin on both sides.
fn largest(grid: &Grid<3>, margin: f64) -> Result<f64, Error> {
    if !(margin.is_finite() && margin >= 0.0) {
        return Err(Error::InvalidParameter {
            name: "margin",
            value: margin,
            requirement: "finite and not negative",
        });
    }
    Ok((grid.side() - 2.0 * margin).max(0.0))
}
