//! Flows in which only some unknowns move: inpainting.

use std::sync::Arc;

use burn::tensor::{Bool, Tensor};
use geometry::{Bricks, Grid};
use operators::ComputeDevice;

use crate::Error;

/// The grid nodes whose values may change; the others keep theirs, bit for bit.
#[derive(Clone)]
pub(crate) struct Region<const D: usize> {
    /// Which nodes of the grid are inside, in its order,
    pub(crate) marks: Arc<[bool]>,
    /// and which of those that are stored.
    pub(crate) nodes: Arc<[bool]>,
    /// The indicator function of the region: 1 inside, 0 outside.
    inside: Tensor<D>,
    outside: Tensor<D, Bool>,
}

impl<const D: usize> Region<D> {
    /// The nodes that are marked, in the order of the grid.
    ///
    /// # Errors
    /// [`Error::Region`] if there are not as many marks as nodes, or if none is set.
    pub fn new(grid: &Grid<D>, nodes: &[bool], device: &ComputeDevice) -> Result<Self, Error> {
        let marked = nodes.iter().filter(|inside| **inside).count();
        if nodes.len() != grid.len() || marked == 0 {
            return Err(Error::Region {
                marks: nodes.len(),
                nodes: grid.len(),
                marked,
            });
        }
        let marks: Arc<[bool]> = nodes.into();
        Ok(Self::stored(marks.clone(), marks, grid.shape(), device))
    }

    /// The same region for fields on these bricks.
    pub(crate) fn on(&self, bricks: &Bricks<D>, device: &ComputeDevice) -> Self {
        let nodes = bricks.gather(&self.marks).into();
        Self::stored(self.marks.clone(), nodes, bricks.shape(), device)
    }

    fn stored(
        marks: Arc<[bool]>,
        nodes: Arc<[bool]>,
        shape: [usize; D],
        device: &ComputeDevice,
    ) -> Self {
        let values: Vec<f64> = nodes.iter().map(|&inside| f64::from(inside)).collect();
        let inside = device.tensor::<D>(&values, shape);
        Self {
            marks,
            nodes,
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
