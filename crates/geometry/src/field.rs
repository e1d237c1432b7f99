//! Nodal values on a grid.

use crate::nodes::{check_finite, check_values};
use crate::parallel::Reader;
use crate::{Error, Grid, Nodes, PhaseField, parallel};

/// One `f64` per node of a [`Grid`], row-major, last axis fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Field<const D: usize> {
    nodes: Nodes<D>,
    values: Vec<f64>,
}

impl<const D: usize> Field<D> {
    /// Samples a function at the nodes, in parallel.
    ///
    /// The values are not checked; see [`Field::check_finite`].
    pub fn from_fn(grid: Grid<D>, f: impl Fn([f64; D]) -> f64 + Sync) -> Self {
        let mut values = vec![0.0; grid.len()];
        // Rows, as functions may be much work: the distance to an outline of many curves, for instance.
        parallel::over_chunks(&mut values, grid.cells(), &|first, row| {
            for (value, node) in row.iter_mut().zip(first..) {
                *value = f(grid.node(node));
            }
        });
        let nodes = grid.into();
        Self { nodes, values }
    }

    /// The constant function.
    pub fn constant(grid: Grid<D>, value: f64) -> Self {
        Self {
            nodes: grid.into(),
            values: vec![value; grid.len()],
        }
    }

    /// Takes over nodal values.
    ///
    /// # Errors
    /// The number of values must be that of the nodes, and all of them finite; the error names the
    /// first node where they are not.
    pub fn from_values(grid: Grid<D>, values: Vec<f64>) -> Result<Self, Error> {
        check_values(&values, grid.len())?;
        let nodes = grid.into();
        Ok(Self { nodes, values })
    }

    /// Checks that no value is NaN or infinite.
    ///
    /// # Errors
    /// Names the first node where one is.
    pub fn check_finite(&self) -> Result<(), Error> {
        check_finite(&self.values)
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<D> {
        self.nodes.grid()
    }

    /// The nodal values.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The nodal values, to be changed in place; see [`Field::check_finite`].
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The field whose values `read` writes for nodes in a row from one on, whose number is a multiple of 4096.
    ///
    /// # Errors
    /// [`Error::NonFinite`].
    pub fn read_from(grid: Grid<D>, read: &Reader<'_>) -> Result<Self, Error> {
        let mut values = vec![0.0; grid.len()];
        parallel::over_chunks(&mut values, parallel::CHUNK, read);
        Self::from_values(grid, values)
    }

    /// Gives up the grid and returns the nodal values.
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }

    /// Applies a function to every value, in parallel.
    #[must_use]
    pub fn map(&self, f: impl Fn(f64) -> f64 + Sync) -> Self {
        Self {
            nodes: self.nodes.clone(),
            values: parallel::values(self.values.len(), |i| f(self.values[i])),
        }
    }

    /// Combines the values of two fields node by node, in parallel.
    ///
    /// # Errors
    /// Both fields must live on the same grid.
    pub fn zip_map(&self, other: &Self, f: impl Fn(f64, f64) -> f64 + Sync) -> Result<Self, Error> {
        self.grid().same_as(other.grid())?;
        let (own, others) = (&self.values, &other.values);
        Ok(Self {
            nodes: self.nodes.clone(),
            values: parallel::values(own.len(), |i| f(own[i], others[i])),
        })
    }

    /// The periodic multilinear interpolant at `x`; NaN where `x` is not finite.
    pub fn interpolate(&self, x: [f64; D]) -> f64 {
        self.interpolate_with(x, |v| v)
    }

    /// The multilinear interpolant of `f(value)` at `x`.
    pub(crate) fn interpolate_with(&self, x: [f64; D], f: impl Fn(f64) -> f64) -> f64 {
        let grid = self.grid();
        let (mut cell, mut weight) = ([0; D], [0.0; D]);
        for axis in 0..D {
            let cells = grid.cells() as f64;
            let position = (x[axis] - grid.origin()[axis]) / grid.side() * cells;
            let floor = position.floor();
            weight[axis] = position - floor;
            cell[axis] = floor.rem_euclid(cells) as usize;
        }
        let mut sum = 0.0;
        for corner in 0..1_usize << D {
            let upper = |axis: usize| corner >> axis & 1;
            let product: f64 = (0..D)
                .map(|axis| {
                    if upper(axis) == 1 {
                        weight[axis]
                    } else {
                        1.0 - weight[axis]
                    }
                })
                .product();
            // Skipping zero weights keeps the value at a node exactly the nodal value.
            if product != 0.0 {
                let node = grid.index(std::array::from_fn(|axis| cell[axis] + upper(axis)));
                sum += product * f(self.values[node]);
            }
        }
        sum
    }
}

impl<const D: usize> PhaseField<D> for Field<D> {
    fn nodes(&self) -> &Nodes<D> {
        &self.nodes
    }

    fn values(&self) -> &[f64] {
        self.values()
    }

    fn phase_values(&self) -> [f64; 2] {
        [-1.0, 1.0]
    }
}
