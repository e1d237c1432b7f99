//! Flows in which only some unknowns move: inpainting.

use std::sync::Arc;

use burn::tensor::{Bool, Tensor};
use geometry::{NodeSet, Nodes};
use operators::ComputeDevice;

/// The grid nodes whose values may change; the others keep theirs, bit for bit.
#[derive(Clone)]
pub(crate) struct Region<const D: usize> {
    /// Whether each of those that are stored is inside.
    pub(crate) marks: Arc<[bool]>,
    /// The indicator function of the region: 1 inside, 0 outside.
    inside: Tensor<D>,
    outside: Tensor<D, Bool>,
}

impl<const D: usize> Region<D> {
    /// These nodes, for fields that are stored at those.
    pub(crate) fn new(stored: &Nodes<D>, nodes: &NodeSet, device: &ComputeDevice) -> Self {
        match stored.bricks() {
            Some(bricks) => {
                let marks = nodes.on(bricks).into();
                Self::marked(marks, bricks.shape(), device)
            }
            None => {
                let marks = nodes.iter().collect();
                Self::marked(marks, stored.grid().shape(), device)
            }
        }
    }

    pub(crate) fn marked(marks: Arc<[bool]>, shape: [usize; D], device: &ComputeDevice) -> Self {
        let values: Vec<f64> = marks.iter().map(|&inside| f64::from(inside)).collect();
        let inside = device.tensor::<D>(&values, shape);
        Self {
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
