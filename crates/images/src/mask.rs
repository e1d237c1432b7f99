//! Regions as sets of nodes.

use geometry::{Field, Grid, SignedDistance};

use crate::Error;

/// A set of nodes of a grid, such as those whose values may change while the rest is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    grid: Grid<2>,
    nodes: Vec<bool>,
}

impl Mask {
    /// The nodes inside a shape, where its signed distance is negative.
    ///
    /// # Errors
    /// [`Error::EmptyMask`] if there are none; the distances must not be NaN.
    pub fn new(grid: Grid<2>, shape: &(impl SignedDistance<2> + ?Sized)) -> Result<Self, Error> {
        let distance = Field::from_fn(grid, |x| shape.signed_distance(x));
        distance.check_finite()?;
        let nodes: Vec<bool> = distance.values().iter().map(|&s| s < 0.0).collect();
        if !nodes.contains(&true) {
            return Err(Error::EmptyMask { nodes: nodes.len() });
        }
        Ok(Self { grid, nodes })
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<2> {
        &self.grid
    }

    /// For every node, in the order of a [`Field`], whether it is in the region.
    pub fn nodes(&self) -> &[bool] {
        &self.nodes
    }

    /// How many nodes are in the region.
    pub fn count(&self) -> usize {
        self.nodes.iter().filter(|&&inside| inside).count()
    }
}
