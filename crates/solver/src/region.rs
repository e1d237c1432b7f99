//! Flows in which only some unknowns move: inpainting.

use std::sync::Arc;

use burn::tensor::{Bool, Tensor};
use geometry::{Bricks, Grid, NodeSet};
use operators::ComputeDevice;

use crate::Error;

/// The grid nodes whose values may change; the others keep theirs, bit for bit.
#[derive(Clone)]
pub(crate) struct Region<const D: usize> {
    /// The nodes of the grid inside.
    pub(crate) nodes: Arc<NodeSet>,
    /// Whether each of those that are stored is inside.
    pub(crate) marks: Arc<[bool]>,
    /// The indicator function of the region: 1 inside, 0 outside.
    inside: Tensor<D>,
    outside: Tensor<D, Bool>,
}

impl<const D: usize> Region<D> {
    /// These nodes, for fields on the whole grid or on these bricks.
    ///
    /// # Errors
    /// [`Error::Region`] for nodes of another grid, or none.
    pub fn new(
        grid: &Grid<D>,
        nodes: Arc<NodeSet>,
        bricks: Option<&Bricks<D>>,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        if nodes.grid_len() != grid.len() || nodes.is_empty() {
            return Err(Error::Region {
                marks: nodes.grid_len(),
                nodes: grid.len(),
                marked: nodes.len(),
            });
        }
        Ok(match bricks {
            Some(bricks) => Self::stored(nodes, bricks, device),
            None => {
                let marks = nodes.iter().collect();
                Self::marked(nodes, marks, grid.shape(), device)
            }
        })
    }

    /// The same region for fields on these bricks.
    pub(crate) fn on(&self, bricks: &Bricks<D>, device: &ComputeDevice) -> Self {
        Self::stored(self.nodes.clone(), bricks, device)
    }

    fn stored(nodes: Arc<NodeSet>, bricks: &Bricks<D>, device: &ComputeDevice) -> Self {
        let marks = nodes.on(bricks).into();
        Self::marked(nodes, marks, bricks.shape(), device)
    }

    fn marked(
        nodes: Arc<NodeSet>,
        marks: Arc<[bool]>,
        shape: [usize; D],
        device: &ComputeDevice,
    ) -> Self {
        let values: Vec<f64> = marks.iter().map(|&inside| f64::from(inside)).collect();
        let inside = device.tensor::<D>(&values, shape);
        Self {
            nodes,
            marks,
            outside: inside.clone().equal_elem(0.0),
            inside,
        }
    }

    /// `x` inside, zero outside, if there is a region.
    pub(crate) fn project(region: Option<&Self>, x: Tensor<D>) -> Tensor<D> {
        match region {
            Some(region) => {
                let inside = region.inside.clone().cast(x.dtype());
                x * inside
            }
            None => x,
        }
    }

    /// `u` inside, `fixed` outside, if there is a region.
    pub(crate) fn hold(region: Option<&Self>, u: Tensor<D>, fixed: &Tensor<D>) -> Tensor<D> {
        match region {
            Some(region) => u.mask_where(region.outside.clone(), fixed.clone()),
            None => u,
        }
    }
}
