//! Fields between grids: from the grid of half as many cells, and on one of every k-th node.

use crate::error::require;
use crate::{Error, Field, Grid, parallel};

impl<const D: usize> Grid<D> {
    /// The grid of every other node: half as many cells, the same cube.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for an odd number of cells; as [`Grid::new`].
    pub fn half(&self) -> Result<Self, Error> {
        let even = self.cells().is_multiple_of(2);
        require("cells", self.cells() as f64, "even to be halved", |_| even)?;
        Self::new(self.cells() / 2, self.side())?.with_origin(self.origin())
    }
}

impl<const D: usize> Field<D> {
    /// The tensor product of cubic interpolations on the grid of twice as many cells: exact at the nodes of this grid, of fourth
    /// order between them, `(-u_(i-1) + 9 u_i + 9 u_(i+1) - u_(i+2)) / 16`.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn refined(&self) -> Result<Self, Error> {
        let cells = self.grid().cells();
        let grid = Grid::new(2 * cells, self.grid().side())?.with_origin(self.grid().origin())?;
        let mut values = self.values().to_vec();
        for axis in 0..D {
            // Axes before this one are fine already, those after it still coarse.
            let line = (axis + 1..D).map(|_| cells).product();
            values = refined_along(&values, cells, line);
        }
        Self::from_values(grid, values)
    }

    /// The values at every k-th node along each axis.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] if `every` does not divide the number of cells; as [`Grid::new`].
    pub fn thinned(&self, every: usize) -> Result<Self, Error> {
        let fine = self.grid();
        let divides = |_| every > 0 && fine.cells().is_multiple_of(every);
        require(
            "every",
            every as f64,
            "a divisor of the number of cells",
            divides,
        )?;
        let coarse = Grid::new(fine.cells() / every, fine.side())?.with_origin(fine.origin())?;
        let value = |node| {
            let place = coarse.multi_index(node).map(|i| every * i);
            self.values()[fine.index(place)]
        };
        Self::from_values(coarse, (0..coarse.len()).map(value).collect())
    }
}

/// `cells` periodic layers of `line` values each, over and over, with layers put in between.
fn refined_along(values: &[f64], cells: usize, line: usize) -> Vec<f64> {
    parallel::values(2 * values.len(), |at| {
        let (layer, place) = (at / line, at % line);
        let (block, k) = (layer / (2 * cells), layer % (2 * cells) / 2);
        let value = |l: usize| values[(block * cells + l % cells) * line + place];
        if layer % 2 == 0 {
            value(k)
        } else {
            (9.0 * (value(k) + value(k + 1)) - value(k + cells - 1) - value(k + 2)) / 16.0
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave<const D: usize>(cells: usize) -> Field<D> {
        let grid = Grid::<D>::centred(cells, 1.5).unwrap();
        Field::from_fn(grid, |x| {
            let phase: f64 = (0..D).map(|axis| (axis + 1) as f64 * x[axis]).sum();
            (phase * std::f64::consts::TAU / 1.5).sin()
        })
    }

    fn error<const D: usize>(cells: usize) -> f64 {
        let coarse = wave::<D>(cells);
        let fine = coarse.refined().unwrap();
        assert_eq!(&fine.grid().half().unwrap(), coarse.grid());
        for (node, value) in coarse.values().iter().enumerate() {
            let same = coarse.grid().multi_index(node).map(|i| 2 * i);
            assert_eq!(
                fine.values()[fine.grid().index(same)].to_bits(),
                value.to_bits(),
                "exact at the nodes"
            );
        }
        let exact = wave::<D>(2 * cells);
        fine.grid().same_as(exact.grid()).unwrap();
        let pairs = fine.values().iter().zip(exact.values());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn interpolation_has_fourth_order() {
        for errors in [
            [16, 32, 64].map(error::<1>),
            [16, 32, 64].map(error::<2>),
            [16, 32, 64].map(error::<3>),
        ] {
            let order = (errors[1] / errors[2]).log2();
            assert!(
                (order - 4.0).abs() < 0.1,
                "observed order {order} from {errors:?}"
            );
        }
    }

    #[test]
    fn an_odd_grid_has_no_half() {
        let text = Grid::<2>::new(7, 1.0)
            .unwrap()
            .half()
            .unwrap_err()
            .to_string();
        assert!(text.contains("cells = 7"), "{text}");
    }
}
