//! Active bricks: the part of a periodic grid that is stored and worked on.

use rayon::prelude::*;

use crate::Error;
use crate::brick_convolution::convolve;

/// A brick that is not stored, in the tables of neighbours: the field is constant there, in the phase of positive values
const POSITIVE: i32 = -1;
/// or in that of negative ones.
const NEGATIVE: i32 = -2;

/// Some of the bricks, cubes of `B^D` cells, into which a periodic grid of `N^D` cells is divided.
///
/// A field on them is one vector, brick after brick in Morton order, each row-major; as a tensor it has the shape `[bricks B, B, ..]`, so that
/// pointwise operations need not know. Everywhere else the field is constant, at one of two values, the rest values of the two phases.
///
/// ```
/// use operators::Bricks;
///
/// # fn main() -> Result<(), operators::Error> {
/// // The left half of a grid of 32 x 32 cells, in bricks of 8 x 8; the right half is in the negative phase.
/// let bricks = Bricks::<2>::new(32, 8, |[_, column]| column < 2, |_| false)?;
/// assert_eq!(bricks.shape(), [64, 8]);
/// let dense: Vec<f64> = (0..1024).map(|i| if i % 32 < 16 { 0.5 } else { -1.0 }).collect();
/// let stored = bricks.gather(&dense);
/// assert_eq!(bricks.scatter(&stored, [-1.0, 1.0]), dense);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bricks<const D: usize> {
    side: usize,
    per_axis: usize,
    places: Vec<[usize; D]>,
    /// For every brick of the grid, row-major, its number or the phase that it is in.
    directory: Vec<i32>,
}

impl<const D: usize> Bricks<D> {
    /// The bricks of `side^D` cells that are `active`, by their places along each axis; `positive` says which phase the others are in.
    ///
    /// # Errors
    /// [`Error::Bricks`] unless the side is a multiple of 8 that divides the `cells` per axis of the grid.
    pub fn new(
        cells: usize,
        side: usize,
        active: impl Fn([usize; D]) -> bool,
        positive: impl Fn([usize; D]) -> bool,
    ) -> Result<Self, Error> {
        if side == 0 || !side.is_multiple_of(8) || !cells.is_multiple_of(side) {
            return Err(Error::Bricks { cells, side });
        }
        let per_axis = cells / side;
        let mut bricks = Self {
            side,
            per_axis,
            places: Vec::new(),
            directory: Vec::new(),
        };
        for flat in 0..per_axis.pow(D as u32) {
            let place = bricks.place(flat);
            let phase = if positive(place) { POSITIVE } else { NEGATIVE };
            bricks.directory.push(phase);
            if active(place) {
                bricks.places.push(place);
            }
        }
        bricks.places.sort_by_key(morton);
        for (number, place) in bricks.places.iter().enumerate() {
            bricks.directory[flat(*place, per_axis)] = number as i32;
        }
        Ok(bricks)
    }

    /// The bricks with these [marks](Self::marks).
    ///
    /// # Errors
    /// [`Error::Bricks`] unless there is a mark for each brick, whose sides are multiples of 8.
    pub fn with_marks(cells: usize, marks: &[f64]) -> Result<Self, Error> {
        let per_axis = (1..=cells).find(|per_axis| per_axis.pow(D as u32) >= marks.len());
        let per_axis = per_axis.filter(|per_axis| per_axis.pow(D as u32) == marks.len());
        // A side of 0 is refused.
        let side = per_axis.map_or(0, |per_axis| cells / per_axis);
        let mark = |place| marks[flat(place, cells / side)];
        Self::new(
            cells,
            side,
            |place| mark(place) == 0.0,
            |place| mark(place) > 0.0,
        )
    }

    /// For every brick of the grid, row-major, 0 if it is active, or the sign of the phase that it is in.
    pub fn marks(&self) -> Vec<f64> {
        let mark = |brick: &i32| match *brick {
            POSITIVE => 1.0,
            NEGATIVE => -1.0,
            _ => 0.0,
        };
        self.directory.iter().map(mark).collect()
    }

    /// The place of a brick along each axis, from its row-major index among all of the grid.
    pub fn place(&self, flat: usize) -> [usize; D] {
        digits(flat, self.per_axis)
    }

    /// The row-major index of a brick among all of the grid.
    pub fn flat(&self, place: [usize; D]) -> usize {
        flat(place, self.per_axis)
    }

    /// Cells along each axis of a brick, `B`.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Cells along each axis of the grid, `N`.
    pub fn cells(&self) -> usize {
        self.side * self.per_axis
    }

    /// Bricks along each axis of the grid, `N / B`.
    pub fn per_axis(&self) -> usize {
        self.per_axis
    }

    /// The places of the active bricks along each axis, in order.
    pub fn places(&self) -> &[[usize; D]] {
        &self.places
    }

    /// Cells of a brick, `B^D`.
    pub fn volume(&self) -> usize {
        self.side.pow(D as u32)
    }

    /// Stored cells.
    pub fn len(&self) -> usize {
        self.places.len() * self.volume()
    }

    /// Whether no brick is active.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The shape of fields as tensors, `[bricks B, B, ..]`.
    pub fn shape(&self) -> [usize; D] {
        let mut shape = [self.side; D];
        shape[0] *= self.places.len();
        shape
    }

    /// The number of the active brick at a place.
    pub fn number(&self, place: [usize; D]) -> Option<usize> {
        usize::try_from(self.directory[self.flat(place)]).ok()
    }

    /// Whether a place is in the positive phase, if no brick is active there.
    pub fn is_positive(&self, place: [usize; D]) -> bool {
        self.directory[self.flat(place)] == POSITIVE
    }

    /// Cells of the positive phase that are not stored.
    pub fn positive_outside(&self) -> usize {
        let bricks = self.directory.iter().filter(|brick| **brick == POSITIVE);
        bricks.count() * self.volume()
    }

    /// Place on the grid of a stored cell.
    pub fn multi_index(&self, cell: usize) -> [usize; D] {
        let place = self.places[cell / self.volume()];
        let inside: [usize; D] = digits(cell % self.volume(), self.side);
        std::array::from_fn(|axis| place[axis] * self.side + inside[axis])
    }

    /// The stored cell at a place on the grid, if a brick is active there.
    pub fn cell(&self, index: [usize; D]) -> Option<usize> {
        let number = self.number(index.map(|at| at / self.side))?;
        let inside = flat(index.map(|at| at % self.side), self.side);
        Some(number * self.volume() + inside)
    }

    /// The cell beside a stored one.
    ///
    /// # Errors
    /// If no brick is active there: whether it is in the positive phase.
    pub fn beside(&self, cell: usize, axis: usize, forward: bool) -> Result<usize, bool> {
        let stride = self.side.pow((D - 1 - axis) as u32);
        let within = cell / stride % self.side;
        let last = self.side - 1;
        match forward {
            true if within < last => Ok(cell + stride),
            false if within > 0 => Ok(cell - stride),
            _ => {
                let place = self.shifted(self.places[cell / self.volume()], axis, forward);
                let inside = cell % self.volume();
                match self.number(place) {
                    Some(number) if forward => Ok(number * self.volume() + inside - last * stride),
                    Some(number) => Ok(number * self.volume() + inside + last * stride),
                    None => Err(self.is_positive(place)),
                }
            }
        }
    }

    fn shifted(&self, mut place: [usize; D], axis: usize, forward: bool) -> [usize; D] {
        let step = if forward { 1 } else { self.per_axis - 1 };
        place[axis] = (place[axis] + step) % self.per_axis;
        place
    }

    /// The table of neighbours, `[bricks, 2 D]`: the numbers of the bricks before and after along each axis, negative for those that are not
    /// active. Numbers as floats, so that the table can be an input of [`crate::brick_convolution`].
    pub fn neighbours(&self) -> Vec<f64> {
        let mut table = Vec::with_capacity(self.places.len() * 2 * D);
        for place in &self.places {
            for axis in 0..D {
                for forward in [false, true] {
                    let beside = self.shifted(*place, axis, forward);
                    table.push(f64::from(self.directory[self.flat(beside)]));
                }
            }
        }
        table
    }

    /// What constant values outside, `rests` in the negative and in the positive phase, add to the convolution of a field with `taps`
    /// along each axis: [`crate::brick_convolution`] itself takes them as zero.
    pub fn convolution_of_outside(&self, taps: &[f64], rests: [f64; 2]) -> Vec<f64> {
        let zeros = vec![0.0; self.len()];
        let table = self.neighbours();
        convolve(&zeros, (self.side, D), &table, taps, false, rests)
    }

    /// The values of the active bricks, of those of the whole grid.
    pub fn gather<T: Copy>(&self, dense: &[T]) -> Vec<T> {
        let mut values = Vec::with_capacity(self.len());
        // Row by row of the active bricks.
        for cell in (0..self.len()).step_by(self.side) {
            let start = flat(self.multi_index(cell), self.cells());
            values.extend_from_slice(&dense[start..][..self.side]);
        }
        values
    }

    /// The values on the whole grid: `rests` outside, in the negative and in the positive phase.
    pub fn scatter(&self, values: &[f64], rests: [f64; 2]) -> Vec<f64> {
        let cells = self.cells();
        let mut dense = vec![0.0; cells.pow(D as u32)];
        let lines = dense.par_chunks_mut(cells).enumerate();
        lines.for_each(|(line, part)| self.read(values, rests, line * cells, part));
        dense
    }

    /// Fills a part of the whole grid from a cell on, both multiples of the side.
    pub fn read(&self, values: &[f64], rests: [f64; 2], start: usize, part: &mut [f64]) {
        // A row of a brick lies in one row of the grid.
        for (k, row) in part.chunks_exact_mut(self.side).enumerate() {
            let index = digits(start + k * self.side, self.cells());
            match self.cell(index) {
                Some(cell) => row.copy_from_slice(&values[cell..][..self.side]),
                None => {
                    let phase = self.is_positive(index.map(|at| at / self.side));
                    row.fill(rests[usize::from(phase)]);
                }
            }
        }
    }

    /// The values on these bricks of a field on others of the same grid; where those have none, `rests` of their phases.
    ///
    /// # Panics
    /// If the bricks have other sides.
    pub fn carried(&self, from: &Self, values: &[f64], rests: [f64; 2]) -> Vec<f64> {
        assert_eq!((self.side, self.per_axis), (from.side, from.per_axis));
        let volume = self.volume();
        let mut carried = Vec::with_capacity(self.len());
        for place in &self.places {
            match from.number(*place) {
                Some(number) => carried.extend_from_slice(&values[number * volume..][..volume]),
                None => {
                    let rest = rests[usize::from(from.is_positive(*place))];
                    carried.resize(carried.len() + volume, rest);
                }
            }
        }
        carried
    }
}

fn flat<const D: usize>(place: [usize; D], per_axis: usize) -> usize {
    place.iter().fold(0, |flat, at| flat * per_axis + at)
}

/// The inverse of [`flat`].
fn digits<const D: usize>(mut flat: usize, per_axis: usize) -> [usize; D] {
    let mut place = [0; D];
    for at in place.iter_mut().rev() {
        *at = flat % per_axis;
        flat /= per_axis;
    }
    place
}

/// The bits of the places along all axes, interleaved: bricks that are near in this order are near in space.
fn morton<const D: usize>(place: &[usize; D]) -> u64 {
    let mut key = 0;
    for bit in (0..64 / D).rev() {
        for at in place {
            key = key << 1 | (*at as u64 >> bit & 1);
        }
    }
    key
}
