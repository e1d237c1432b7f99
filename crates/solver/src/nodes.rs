//! Where stored values lie on a periodic grid: all of them, or those of active bricks.

use geometry::Grid;
use operators::Bricks;

/// The places of stored values.
pub(crate) trait Nodes<const D: usize>: Sync {
    /// Whether they are all that the grid has.
    const WHOLE_GRID: bool;

    /// The place of a node along each axis.
    fn place(&self, node: usize) -> [usize; D];

    /// The node beside one at a place, or else whether the values there are positive, and constant.
    fn beside(
        &self,
        node: usize,
        place: [usize; D],
        axis: usize,
        forward: bool,
    ) -> Result<usize, bool>;
}

impl<const D: usize> Nodes<D> for Grid<D> {
    const WHOLE_GRID: bool = true;

    fn place(&self, node: usize) -> [usize; D] {
        self.multi_index(node)
    }

    fn beside(
        &self,
        node: usize,
        place: [usize; D],
        axis: usize,
        forward: bool,
    ) -> Result<usize, bool> {
        let (cells, stride) = (self.cells(), self.stride(axis));
        let moved = (place[axis] + if forward { 1 } else { cells - 1 }) % cells;
        Ok(node + moved * stride - place[axis] * stride)
    }
}

impl<const D: usize> Nodes<D> for Bricks<D> {
    const WHOLE_GRID: bool = false;

    fn place(&self, node: usize) -> [usize; D] {
        self.multi_index(node)
    }

    fn beside(
        &self,
        node: usize,
        _: [usize; D],
        axis: usize,
        forward: bool,
    ) -> Result<usize, bool> {
        Bricks::beside(self, node, axis, forward)
    }
}
