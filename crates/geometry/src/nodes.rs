//! Where the values of a field lie.

use std::sync::Arc;

use crate::{Bricks, Error, Grid};

/// The nodes of a periodic grid whose values are stored: all of them, or those of some bricks, in the order of storage.
#[derive(Clone, Debug, PartialEq)]
pub struct Nodes<const D: usize> {
    grid: Grid<D>,
    bricks: Option<Arc<Bricks<D>>>,
}

/// What [`Nodes`] hold at a point of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lookup {
    /// The number of the node that is stored there.
    Stored(usize),
    /// Nothing is stored there: the field has the constant value of one pure phase.
    Pure {
        /// Whether it is the positive phase.
        positive: bool,
    },
}

impl Lookup {
    /// The number of the stored node, if there is one.
    pub fn stored(self) -> Option<usize> {
        match self {
            Self::Stored(node) => Some(node),
            Self::Pure { .. } => None,
        }
    }
}

impl<const D: usize> From<Grid<D>> for Nodes<D> {
    fn from(grid: Grid<D>) -> Self {
        Self { grid, bricks: None }
    }
}

impl<const D: usize> Nodes<D> {
    /// Those of some bricks of the grid.
    pub fn on_bricks(grid: Grid<D>, bricks: Arc<Bricks<D>>) -> Self {
        Self {
            grid,
            bricks: Some(bricks),
        }
    }

    /// The whole grid.
    pub fn grid(&self) -> &Grid<D> {
        &self.grid
    }

    /// The bricks that are stored, if not the whole grid.
    pub fn bricks(&self) -> Option<&Arc<Bricks<D>>> {
        self.bricks.as_ref()
    }

    /// How many there are.
    #[allow(
        clippy::len_without_is_empty,
        reason = "there may be none, but nobody asks"
    )]
    pub fn len(&self) -> usize {
        self.bricks
            .as_ref()
            .map_or_else(|| self.grid.len(), |bricks| bricks.len())
    }

    /// How many nodes a [row](Self::row) has: all numbers of nodes are multiples of it.
    pub fn row_length(&self) -> usize {
        (self.bricks.as_ref()).map_or_else(|| self.grid.cells(), |bricks| bricks.side())
    }

    /// The row that begins at this node, whose number is a multiple of [their length](Self::row_length).
    pub fn row(&self, first: usize) -> Row<D> {
        let length = self.row_length();
        let place = self.multi_index(first);
        let mut beside = std::array::from_fn(|axis| self.along(first, place, axis, [-1, 1]));
        let (last, mut end) = (first + length - 1, place);
        end[D - 1] += length - 1;
        [beside[D - 1][1]] = self.along(last, end, D - 1, [1]);
        Row {
            first,
            length,
            place,
            beside,
        }
    }

    /// The multi-index of a node in the grid.
    pub fn multi_index(&self, node: usize) -> [usize; D] {
        match &self.bricks {
            None => self.grid.multi_index(node),
            Some(bricks) => bricks.multi_index(node),
        }
    }

    /// What lies at a multi-index of the grid.
    pub fn at(&self, place: [usize; D]) -> Lookup {
        match &self.bricks {
            None => Lookup::Stored(self.grid.index(place)),
            Some(bricks) => bricks.at(place),
        }
    }

    /// What lies so many steps along an axis from a node at a multi-index, on bricks at most one side of a brick away.
    #[expect(clippy::inline_always, reason = "what it returns stays in registers")]
    #[inline(always)]
    pub fn along<const N: usize>(
        &self,
        node: usize,
        place: [usize; D],
        axis: usize,
        steps: [isize; N],
    ) -> [Lookup; N] {
        match &self.bricks {
            None => {
                let (here, cells) = (place[axis] as isize, self.grid.cells() as isize);
                let stride = self.grid.stride(axis) as isize;
                let mut nodes = [Lookup::Stored(node); N];
                for (found, steps) in nodes.iter_mut().zip(steps) {
                    let mut there = here + steps;
                    if !(0..cells).contains(&there) {
                        there = there.rem_euclid(cells);
                    }
                    *found = Lookup::Stored(node.wrapping_add_signed((there - here) * stride));
                }
                nodes
            }
            Some(bricks) => bricks.along(node, place, axis, steps),
        }
    }

    /// How many nodes of the negative and of the positive phase are not stored.
    pub(crate) fn outside(&self) -> [usize; 2] {
        (self.bricks.as_ref()).map_or([0; 2], |bricks| bricks.outside())
    }
}

/// Nodes along the last axis that lie side by side in storage: what lies beside them is looked up for all of them at once.
#[derive(Clone, Copy, Debug)]
pub struct Row<const D: usize> {
    /// The number of the first node.
    pub first: usize,
    /// How many there are.
    pub length: usize,
    /// The multi-index of the first node in the grid.
    pub place: [usize; D],
    /// What lies before and after the first node along each axis; along the last one, after the last node.
    beside: [[Lookup; 2]; D],
}

impl<const D: usize> Row<D> {
    /// What lies before and after the node at a position in the row, along an axis. Where nothing is stored beside one node, there is nothing beside the
    /// others, unless it is the last axis.
    #[expect(clippy::inline_always, reason = "what it returns stays in registers")]
    #[inline(always)]
    pub fn beside(&self, at: usize, axis: usize) -> [Lookup; 2] {
        let mut beside = self.beside[axis];
        if axis < D - 1 {
            for found in &mut beside {
                if let Lookup::Stored(node) = found {
                    *node += at;
                }
            }
        } else {
            let node = self.first + at;
            if at > 0 {
                beside[0] = Lookup::Stored(node - 1);
            }
            if at + 1 < self.length {
                beside[1] = Lookup::Stored(node + 1);
            }
        }
        beside
    }
}

/// A phase field, or a function of one, as it is stored.
pub trait PhaseField<const D: usize>: Sync {
    /// Where its values lie.
    fn nodes(&self) -> &Nodes<D>;

    /// The values there.
    fn values(&self) -> &[f64];

    /// The values in the negative and in the positive phase, where nothing is stored.
    fn phase_values(&self) -> [f64; 2];

    /// The value of what lies at a point of the grid.
    fn value(&self, found: Lookup) -> f64 {
        match found {
            Lookup::Stored(node) => self.values()[node],
            Lookup::Pure { positive } => self.phase_values()[usize::from(positive)],
        }
    }

    /// The value at a place on the grid.
    fn at(&self, place: [usize; D]) -> f64 {
        self.value(self.nodes().at(place))
    }

    /// Writes the values on the whole grid of so many nodes in a row from `start` on into `part`. Where the field is on bricks, both the start
    /// and the number must be multiples of their side.
    fn read(&self, start: usize, part: &mut [f64]) {
        let values = self.values();
        match self.nodes().bricks() {
            Some(bricks) => bricks.read(values, self.phase_values(), start, part),
            None => part.copy_from_slice(&values[start..][..part.len()]),
        }
    }

    /// Checks that no value is NaN or infinite.
    ///
    /// # Errors
    /// [`Error::NonFinite`] with the first node, as it is stored, where one is.
    fn check_finite(&self) -> Result<(), Error> {
        check_finite(self.values())
    }

    /// The values on bricks of the grid.
    ///
    /// # Panics
    /// If the bricks are of another grid.
    fn values_on(&self, bricks: &Bricks<D>) -> Vec<f64> {
        let (nodes, stored) = (self.nodes(), self.values());
        assert_eq!(nodes.grid().cells(), bricks.cells());
        // A piece of a row lies in one row of one brick on either side.
        let piece = nodes
            .bricks()
            .map_or(bricks.side(), |own| own.side().min(bricks.side()));
        let mut values = Vec::with_capacity(bricks.len());
        for cell in (0..bricks.len()).step_by(piece) {
            match nodes.at(bricks.multi_index(cell)) {
                Lookup::Stored(node) => values.extend_from_slice(&stored[node..][..piece]),
                pure @ Lookup::Pure { .. } => {
                    values.resize(values.len() + piece, self.value(pure));
                }
            }
        }
        values
    }
}

/// Refuses another number of values than the expected one, and values that are not finite.
///
/// # Errors
/// [`Error::ValueCount`]; [`Error::NonFinite`] with the first of them.
pub fn check_values(values: &[f64], expected: usize) -> Result<(), Error> {
    let actual = values.len();
    if expected != actual {
        return Err(Error::ValueCount { expected, actual });
    }
    check_finite(values)
}

/// Checks that no value is NaN or infinite.
///
/// # Errors
/// Names the first node where one is.
pub(crate) fn check_finite(values: &[f64]) -> Result<(), Error> {
    match values.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        None => Ok(()),
        Some((index, &value)) => Err(Error::NonFinite { index, value }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Field;

    #[test]
    fn values_keep_their_places() {
        let active = |[i, j]: [usize; 2]| (i + 2 * j) % 3 != 1;
        let few = Bricks::<2>::new(48, 16, active, |place| place[0] % 2 == 0).unwrap();
        let all = Bricks::<2>::new(48, 16, |_| true, |_| true).unwrap();
        let x: Vec<f64> = (0..few.len())
            .map(|i| 0.9 * (0.37 * i as f64).sin())
            .collect();
        let phase_values = [-1.0, 1.0];
        let dense = few.scatter(&x, phase_values);
        let grid = Grid::new(48, 1.0).unwrap();
        let field = Field::from_values(grid, dense.clone()).unwrap();
        assert_eq!(field.values_on(&few), x);
        assert_eq!(all.scatter(&field.values_on(&all), [0.0; 2]), dense);

        let (whole, stored) = (
            Nodes::from(grid),
            Nodes::on_bricks(grid, Arc::new(few.clone())),
        );
        let inside = dense.iter().filter(|x| x.to_bits() == 1.0_f64.to_bits());
        assert_eq!(stored.outside()[1], inside.count());
        for nodes in [&stored, &whole] {
            for first in (0..nodes.len()).step_by(nodes.row_length()) {
                let row = nodes.row(first);
                for (at, axis) in (0..row.length).flat_map(|at| [(at, 0), (at, 1)]) {
                    let node = first + at;
                    let place = nodes.multi_index(node);
                    assert_eq!(
                        row.beside(at, axis),
                        nodes.along(node, place, axis, [-1, 1])
                    );
                }
            }
        }
        for (node, value) in x.iter().enumerate() {
            let place = stored.multi_index(node);
            let on_grid = grid.index(place);
            assert_eq!(dense[on_grid].to_bits(), value.to_bits());
            let steps = [-16, -3, -1, 1, 3, 16];
            for axis in 0..2 {
                let found = stored.along(node, place, axis, steps);
                let of_grid = whole.along(on_grid, place, axis, steps);
                for ((found, of_grid), steps) in found.into_iter().zip(of_grid).zip(steps) {
                    let mut there = place.map(|at| at as isize);
                    there[axis] += steps;
                    let there = there.map(|at| at.rem_euclid(48) as usize);
                    assert_eq!(of_grid, Lookup::Stored(grid.index(there)));
                    assert_eq!(stored.at(there), found);
                    let found = match found {
                        Lookup::Stored(node) => x[node],
                        Lookup::Pure { positive } => phase_values[usize::from(positive)],
                    };
                    assert_eq!(found.to_bits(), dense[grid.index(there)].to_bits());
                }
            }
        }
        assert!(matches!(
            Bricks::<2>::new(50, 16, |_| true, |_| true),
            Err(Error::Bricks {
                cells: 50,
                side: 16
            })
        ));
    }
}
