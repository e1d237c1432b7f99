//! Active bricks: the part of a periodic grid that is stored and worked on.

use rayon::prelude::*;

use crate::grid::digits;
use crate::parallel::{self, Reader};
use crate::{Error, Lookup};

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
/// use geometry::Bricks;
///
/// # fn main() -> Result<(), geometry::Error> {
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
    /// The binary logarithm of the side: places are divided by it all the time.
    bits: u32,
    per_axis: usize,
    places: Vec<[usize; D]>,
    /// For every brick of the grid, row-major, its number or the phase that it is in.
    directory: Vec<i32>,
}

impl<const D: usize> Bricks<D> {
    /// The bricks of `side^D` cells that are `active`, by their places along each axis; `positive` says which phase the others are in.
    ///
    /// # Errors
    /// [`Error::Bricks`] unless the side is a power of two from 8 on that divides the `cells` per axis of the grid.
    pub fn new(
        cells: usize,
        side: usize,
        active: impl Fn([usize; D]) -> bool,
        positive: impl Fn([usize; D]) -> bool,
    ) -> Result<Self, Error> {
        if side < 8 || !side.is_power_of_two() || !cells.is_multiple_of(side) {
            return Err(Error::Bricks { cells, side });
        }
        let per_axis = cells / side;
        let mut bricks = Self {
            bits: side.trailing_zeros(),
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
    /// [`Error::Bricks`] unless there is a mark for each brick, as for [`Self::new`].
    pub fn with_marks(cells: usize, marks: &[f64]) -> Result<Self, Error> {
        let per_axis = (1..=cells).find(|per_axis| per_axis.pow(D as u32) >= marks.len());
        let fits = |n: &usize| n.pow(D as u32) == marks.len() && cells.is_multiple_of(*n);
        // A side of 0 is refused.
        let side = per_axis.filter(fits).map_or(0, |per_axis| cells / per_axis);
        let mark = |place| marks[flat(place, cells / side)];
        Self::new(
            cells,
            side,
            |place| mark(place) == 0.0,
            |place| mark(place) > 0.0,
        )
    }

    /// All but those on which the values of the whole grid, which `read` writes, are one of `phase_values`, that of the negative or of the positive
    /// phase, bit for bit, and beside which nothing is in the other phase.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn without_phases(
        cells: usize,
        side: usize,
        read: &Reader<'_>,
        phase_values: [f64; 2],
    ) -> Result<Self, Error> {
        let all = Self::new(cells, side, |_| true, |_| false)?;
        let (volume, phase_values) = (all.volume(), phase_values.map(f64::to_bits));
        // Whether a brick has nothing but rest values, and which phases are in it.
        let scan = |number: usize| {
            let (mut rest, mut phases) = (true, [false; 2]);
            let mut row = vec![0.0; side];
            for cell in (number * volume..(number + 1) * volume).step_by(side) {
                read(flat(all.multi_index(cell), cells), &mut row);
                for value in &row {
                    let phase = usize::from(*value > 0.0);
                    rest &= value.to_bits() == phase_values[phase];
                    phases[phase] = true;
                }
            }
            (rest, phases)
        };
        let scans = parallel::map(all.places.len(), 1, &scan);
        let at = |place| scans[all.number(place).expect("all are active")];
        let beside = |place: [usize; D], offset: usize| {
            let offset: [usize; D] = digits(offset, 3);
            std::array::from_fn(|axis| {
                (place[axis] + offset[axis] + all.per_axis - 1) % all.per_axis
            })
        };
        let is_pure = |place| {
            let (rest, phases) = at(place);
            let mut around = (0..3_usize.pow(D as u32)).map(|offset| at(beside(place, offset)).1);
            rest && around.all(|others| others == phases) && phases != [true; 2]
        };
        Self::new(cells, side, |place| !is_pure(place), |place| at(place).1[1])
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
        1 << self.bits
    }

    /// Cells along each axis of the grid, `N`.
    pub fn cells(&self) -> usize {
        self.per_axis << self.bits
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
        1 << (self.bits * D as u32)
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
        let mut shape = [self.side(); D];
        shape[0] *= self.places.len();
        shape
    }

    /// The number of the active brick at a place.
    pub fn number(&self, place: [usize; D]) -> Option<usize> {
        usize::try_from(self.directory[self.flat(place)]).ok()
    }

    /// Whether the brick at a place is in the positive phase, if it is not active.
    pub fn is_positive(&self, place: [usize; D]) -> bool {
        self.directory[self.flat(place)] == POSITIVE
    }

    /// Cells of the negative and of the positive phase that are not stored.
    pub fn outside(&self) -> [usize; 2] {
        [NEGATIVE, POSITIVE].map(|phase| {
            let bricks = self.directory.iter().filter(|brick| **brick == phase);
            bricks.count() * self.volume()
        })
    }

    /// The first and the last place on the grid of each brick that is not active and in this phase: positive or not.
    pub(crate) fn not_active(&self, positive: bool) -> impl Iterator<Item = [[usize; D]; 2]> + '_ {
        let phase = if positive { POSITIVE } else { NEGATIVE };
        let bricks = self.directory.iter().enumerate();
        let bricks = bricks.filter(move |(_, found)| **found == phase);
        bricks.map(|(brick, _)| {
            let first = self.place(brick).map(|at| at << self.bits);
            [first, first.map(|at| at + self.side() - 1)]
        })
    }

    /// Place on the grid of a stored cell.
    pub fn multi_index(&self, cell: usize) -> [usize; D] {
        let place = self.places[cell >> (self.bits * D as u32)];
        std::array::from_fn(|axis| {
            (place[axis] << self.bits) + self.within(cell >> self.shift(axis))
        })
    }

    /// The stored cell at a multi-index of the grid, or the phase where no brick is active.
    pub(crate) fn at(&self, index: [usize; D]) -> Lookup {
        let brick = self.holder(index);
        let Some(number) = self.number(brick) else {
            return self.pure(brick);
        };
        let inside = index
            .into_iter()
            .fold(0, |flat, at| (flat << self.bits) + self.within(at));
        Lookup::Stored(number * self.volume() + inside)
    }

    /// The place of the brick that holds a multi-index of the grid.
    fn holder(&self, mut index: [usize; D]) -> [usize; D] {
        // Not by the `map` of an array, which is a call in the innermost loops.
        for at in &mut index {
            *at >>= self.bits;
        }
        index
    }

    /// The phase of a brick that is not active.
    fn pure(&self, brick: [usize; D]) -> Lookup {
        Lookup::Pure {
            positive: self.is_positive(brick),
        }
    }

    /// Of a place along an axis that within its brick.
    fn within(&self, at: usize) -> usize {
        at & (self.side() - 1)
    }

    /// The binary logarithm of how far neighbours along an axis are apart in a brick.
    fn shift(&self, axis: usize) -> u32 {
        self.bits * (D - 1 - axis) as u32
    }

    /// What lies so many steps along an axis from a stored cell at a multi-index, at most one side of a brick away.
    #[expect(clippy::inline_always, reason = "what it returns stays in registers")]
    #[inline(always)]
    pub(crate) fn along<const N: usize>(
        &self,
        cell: usize,
        place: [usize; D],
        axis: usize,
        steps: [isize; N],
    ) -> [Lookup; N] {
        let (side, shift) = (self.side() as isize, self.shift(axis));
        let within = self.within(place[axis]) as isize;
        // All steps out of the brick in one direction lead into the same one.
        let leaves = |forward: bool| {
            let mut ends = steps.iter().map(|step| within + step);
            ends.any(|end| if forward { end >= side } else { end < 0 })
        };
        let beside = |forward: bool| {
            if !leaves(forward) {
                return Lookup::Stored(cell);
            }
            let brick = self.shifted(self.holder(place), axis, forward);
            match self.number(brick) {
                Some(number) => {
                    Lookup::Stored(number * self.volume() + (cell & (self.volume() - 1)))
                }
                None => self.pure(brick),
            }
        };
        let (before, after) = (beside(false), beside(true));
        let mut cells = [Lookup::Stored(cell); N];
        for (found, step) in cells.iter_mut().zip(steps) {
            let (from, step) = match within + step {
                end if end < 0 => (before, step + side),
                end if end >= side => (after, step - side),
                _ => (Lookup::Stored(cell), step),
            };
            *found = match from {
                Lookup::Stored(from) => Lookup::Stored(from.wrapping_add_signed(step << shift)),
                pure @ Lookup::Pure { .. } => pure,
            };
        }
        cells
    }

    fn shifted(&self, mut place: [usize; D], axis: usize, forward: bool) -> [usize; D] {
        let step = if forward { 1 } else { self.per_axis - 1 };
        place[axis] = (place[axis] + step) % self.per_axis;
        place
    }

    /// The table of neighbours, `[bricks, 2 D]`: the numbers of the bricks before and after along each axis, negative for those that are not
    /// active. Numbers as floats, so that the table can be an input of a tensor operation.
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

    /// Where on the grid the rows of the active bricks begin, of `B` cells each.
    pub(crate) fn rows(&self) -> impl Iterator<Item = usize> {
        let cells = (0..self.len()).step_by(self.side());
        cells.map(|cell| flat(self.multi_index(cell), self.cells()))
    }

    /// The values of the active bricks, of those of the whole grid.
    pub fn gather(&self, dense: &[f64]) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.len());
        for first in self.rows() {
            values.extend_from_slice(&dense[first..][..self.side()]);
        }
        values
    }

    /// The same where `read` writes the values of the whole grid.
    pub(crate) fn gather_from(&self, read: &Reader<'_>) -> Vec<f64> {
        let mut values = vec![0.0; self.len()];
        parallel::over_chunks(&mut values, self.volume(), &|first, brick| {
            for (row, part) in brick.chunks_exact_mut(self.side()).enumerate() {
                let cell = first + (row << self.bits);
                read(flat(self.multi_index(cell), self.cells()), part);
            }
        });
        values
    }

    /// The values on the whole grid: `phase_values` outside, in the negative and in the positive phase.
    pub fn scatter(&self, values: &[f64], phase_values: [f64; 2]) -> Vec<f64> {
        let cells = self.cells();
        let mut dense = vec![0.0; cells.pow(D as u32)];
        let lines = dense.par_chunks_mut(cells).enumerate();
        lines.for_each(|(line, part)| self.read(values, phase_values, line * cells, part));
        dense
    }

    /// Fills a part of the whole grid from a cell on, both multiples of the side.
    pub(crate) fn read(
        &self,
        values: &[f64],
        phase_values: [f64; 2],
        start: usize,
        part: &mut [f64],
    ) {
        // A row of a brick lies in one row of the grid.
        for (k, row) in part.chunks_exact_mut(self.side()).enumerate() {
            let index = digits(start + (k << self.bits), self.cells());
            match self.at(index) {
                Lookup::Stored(cell) => row.copy_from_slice(&values[cell..][..self.side()]),
                Lookup::Pure { positive } => row.fill(phase_values[usize::from(positive)]),
            }
        }
    }
}

fn flat<const D: usize>(place: [usize; D], per_axis: usize) -> usize {
    place.iter().fold(0, |flat, at| flat * per_axis + at)
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
