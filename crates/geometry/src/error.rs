//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

use crate::npy::error::NpyError;

/// Errors of grids, fields, shapes and files, each with the numbers needed to act on it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error("a periodic grid needs at least 2 cells per side, got {cells}")]
    GridTooSmall { cells: usize },
    #[error("{cells}^{dimension} nodes cannot be addressed on this machine; use fewer cells")]
    GridTooLarge { cells: usize, dimension: usize },
    #[error(
        "a grid of {cells} cells per side cannot be divided into bricks of {side}; take a multiple of {side} cells, or store the whole grid"
    )]
    Bricks { cells: usize, side: usize },
    /// `n * side` cells per side is not a whole number.
    #[error(
        "{cells_per_unit} cells per unit length on a side of {side} give {cells} cells; \
         choose values whose product is a whole number"
    )]
    FractionalCells {
        cells_per_unit: usize,
        side: f64,
        cells: f64,
    },
    /// The search for the torus nearest to a phase field.
    #[error("no Clifford torus fits: {0}")]
    NoCliffordTorus(&'static str),
    #[error("{name} = {value:?} is not allowed: it must be {requirement}")]
    InvalidParameter {
        name: &'static str,
        value: f64,
        requirement: &'static str,
    },
    #[error("the grid has {expected} nodes, but {actual} values were given")]
    ValueCount { expected: usize, actual: usize },
    #[error("the value at node {index} is {value}; all nodal values must be finite")]
    NonFinite {
        /// Row-major index of the first such node.
        index: usize,
        value: f64,
    },
    #[error(
        "the grids differ: {left_cells} cells on a side of {left_side} against {right_cells} \
         on {right_side} (or their origins differ)"
    )]
    GridMismatch {
        left_cells: usize,
        left_side: f64,
        right_cells: usize,
        right_side: f64,
    },
    #[error("the point {point:?} is outside the box spanned by the nodes")]
    PointOutside { point: Vec<f64> },
    #[error(
        "a side length of {side_length} does not fit the box of side {box_side}; use at most that"
    )]
    DoesNotFit { side_length: f64, box_side: f64 },
    #[error("{name:?} is no axis: choose x, y or z")]
    UnknownAxis { name: String },
    #[error(transparent)]
    Io(#[from] files::Error),
    #[error("{path} cannot be read as a field", path = path.display())]
    Npy { path: PathBuf, source: NpyError },
}

/// Accepts finite numbers for which `condition` holds.
///
/// # Errors
/// [`Error::InvalidParameter`] for others.
pub fn require(
    name: &'static str,
    value: f64,
    requirement: &'static str,
    condition: impl FnOnce(f64) -> bool,
) -> Result<f64, Error> {
    if value.is_finite() && condition(value) {
        Ok(value)
    } else {
        Err(Error::InvalidParameter {
            name,
            value,
            requirement,
        })
    }
}

/// Accepts finite positive numbers.
///
/// # Errors
/// [`Error::InvalidParameter`] for others.
pub fn positive(name: &'static str, value: f64) -> Result<f64, Error> {
    require(name, value, "finite and positive", |v| v > 0.0)
}

/// Accepts vectors of finite numbers.
pub(crate) fn finite<const D: usize>(
    name: &'static str,
    vector: [f64; D],
) -> Result<[f64; D], Error> {
    for value in vector {
        require(name, value, "finite", |_| true)?;
    }
    Ok(vector)
}
