//! Periodic cubical grids.

use crate::Error;
use crate::error::{finite, positive};

/// A regular grid of `N^D` nodes on a periodic cube of side `L`.
///
/// The nodes are `origin + i h` with `h = L/N` and `i = 0..N-1` in each axis; the layer at `i = N`
/// is the one at `i = 0` and is not stored. Nodal values are ordered row-major: the last axis runs
/// fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid<const D: usize> {
    cells: usize,
    side: f64,
    origin: [f64; D],
}

impl<const D: usize> Grid<D> {
    /// The cube `[0, side)^D` with `cells` cells per side.
    ///
    /// # Errors
    /// Fewer than two cells, a side that is not finite and positive, or too many nodes to address.
    pub fn new(cells: usize, side: f64) -> Result<Self, Error> {
        const { assert!(D >= 1, "a grid needs at least one axis") };
        if cells < 2 {
            return Err(Error::GridTooSmall { cells });
        }
        let addressable = isize::MAX as usize / size_of::<f64>();
        let nodes = u32::try_from(D)
            .ok()
            .and_then(|power| cells.checked_pow(power));
        if nodes.is_none_or(|nodes| nodes > addressable) {
            return Err(Error::GridTooLarge {
                cells,
                dimension: D,
            });
        }
        Ok(Self {
            cells,
            side: positive("side", side)?,
            origin: [0.0; D],
        })
    }

    /// The cube `[-side/2, side/2)^D`; for an even number of cells `x = 0` is exactly a node.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn centred(cells: usize, side: f64) -> Result<Self, Error> {
        Ok(Self {
            origin: [-0.5 * side; D],
            ..Self::new(cells, side)?
        })
    }

    /// As [`Grid::centred`], with `cells_per_unit` cells per unit length: `h = 1/n`.
    ///
    /// # Errors
    /// `n * side` must be a whole number (to a relative 1e-9); otherwise as [`Grid::new`].
    pub fn per_unit(cells_per_unit: usize, side: f64) -> Result<Self, Error> {
        let side = positive("side", side)?;
        let cells = cells_per_unit as f64 * side;
        if (cells - cells.round()).abs() > 1e-9 * cells.max(1.0) {
            return Err(Error::FractionalCells {
                cells_per_unit,
                side,
                cells,
            });
        }
        Self::centred(cells.round() as usize, side)
    }

    /// The same grid moved so that its first node is `origin`.
    ///
    /// # Errors
    /// The origin must be finite.
    pub fn with_origin(self, origin: [f64; D]) -> Result<Self, Error> {
        Ok(Self {
            origin: finite("origin", origin)?,
            ..self
        })
    }

    /// Cells (= stored nodes) per side, `N`.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// Side of the cube, `L`.
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Distance of neighbouring nodes, `h = L/N`.
    pub fn spacing(&self) -> f64 {
        self.side / self.cells as f64
    }

    /// Position of the first node.
    pub fn origin(&self) -> [f64; D] {
        self.origin
    }

    /// Number of nodes, `N^D`.
    #[allow(clippy::len_without_is_empty, reason = "a grid is never empty")]
    pub fn len(&self) -> usize {
        self.shape().iter().product()
    }

    /// Nodes per axis, `[N; D]`.
    pub fn shape(&self) -> [usize; D] {
        [self.cells; D]
    }

    /// Volume represented by one node, `h^D`.
    pub fn cell_volume(&self) -> f64 {
        (0..D).map(|_| self.spacing()).product()
    }

    /// Position of the node with row-major index `index`.
    ///
    /// Indices beyond `N^D` wrap around in the first axis.
    pub fn node(&self, index: usize) -> [f64; D] {
        let multi_index = self.multi_index(index);
        std::array::from_fn(|axis| self.coordinate(axis, multi_index[axis]))
    }

    /// Position along `axis` of the `i`-th layer of nodes; `i = N` is the repeated last layer.
    pub fn coordinate(&self, axis: usize, i: usize) -> f64 {
        // `side * (i / N)` and not `i * h`: the middle of a centred grid is then exactly zero.
        self.origin[axis] + self.side * (i as f64 / self.cells as f64)
    }

    /// The row-major index of the node that is nearest to a point in the box.
    pub fn nearest(&self, x: [f64; D]) -> usize {
        let last = self.cells - 1;
        self.index(std::array::from_fn(|axis| {
            let at = (x[axis] - self.origin[axis]) / self.spacing();
            (at.round() as usize).min(last)
        }))
    }

    /// Row-major index of a node given by its index along each axis (taken modulo `N`).
    pub fn index(&self, multi_index: [usize; D]) -> usize {
        multi_index
            .iter()
            .fold(0, |index, i| index * self.cells + i % self.cells)
    }

    /// Index along each axis of the node with row-major index `index`.
    pub fn multi_index(&self, index: usize) -> [usize; D] {
        digits(index, self.cells)
    }

    /// Distance in memory between neighbours along `axis`, `N^(D-1-axis)`.
    pub fn stride(&self, axis: usize) -> usize {
        (axis + 1..D).map(|_| self.cells).product()
    }

    /// Refuses an operation on fields of two grids.
    ///
    /// # Errors
    /// [`Error::GridMismatch`] if they differ.
    pub fn same_as(&self, other: &Self) -> Result<(), Error> {
        if self == other {
            return Ok(());
        }
        Err(Error::GridMismatch {
            left_cells: self.cells,
            left_side: self.side,
            right_cells: other.cells,
            right_side: other.side,
        })
    }
}

/// The place of the element at a row-major index in an array with so many elements along each axis.
pub(crate) fn digits<const D: usize>(mut flat: usize, per_axis: usize) -> [usize; D] {
    let mut place = [0; D];
    for at in place.iter_mut().rev() {
        *at = flat % per_axis;
        flat /= per_axis;
    }
    place
}
