//! Regions as sets of nodes.

use geometry::{Field, Grid, SignedDistance};

use crate::Error;

/// For every node of a grid, in the order of a [`Field`], whether it is inside a shape, where its
/// signed distance is negative: those whose values may change while the rest is kept, for example.
///
/// # Errors
/// [`Error::EmptyMask`] if no node is inside; the distances must not be NaN.
pub fn mask(grid: Grid<2>, shape: &(impl SignedDistance<2> + ?Sized)) -> Result<Vec<bool>, Error> {
    let distance = Field::from_fn(grid, |x| shape.signed_distance(x));
    distance.check_finite()?;
    let nodes: Vec<bool> = distance.values().iter().map(|&s| s < 0.0).collect();
    if nodes.contains(&true) {
        Ok(nodes)
    } else {
        Err(Error::EmptyMask { nodes: nodes.len() })
    }
}
