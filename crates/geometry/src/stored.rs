//! Fields of which only what is near an interface is stored, and their arithmetic node by node.

use std::sync::Arc;

use crate::nodes::check_values;
use crate::parallel::{self, Reader};
use crate::{Bricks, Error, Field, Grid, Nodes, PhaseField};

/// Nodes are worked on in pieces of this many.
const CHUNK: usize = 1 << 14;
/// Cells along each axis of the bricks without which a phase field is stored that is constant there.
const SIDE: usize = 8;
/// The values of phase fields in the negative and in the positive phase.
const PHASES: [f64; 2] = [-1.0, 1.0];

/// The values of a field on the whole grid, or on bricks, with the constants that it has outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored<const D: usize> {
    nodes: Nodes<D>,
    values: Vec<f64>,
    /// The values in the negative and in the positive phase where nothing is stored.
    phase_values: [f64; 2],
}

/// Without its pure phases, as [`Stored::read_from`].
impl<const D: usize> From<Field<D>> for Stored<D> {
    fn from(u: Field<D>) -> Self {
        let read = |start: usize, part: &mut [f64]| u.read(start, part);
        Self::without_phases(*u.grid(), &read).unwrap_or_else(|| Self::whole(u))
    }
}

impl<const D: usize> PhaseField<D> for Stored<D> {
    fn nodes(&self) -> &Nodes<D> {
        &self.nodes
    }

    fn values(&self) -> &[f64] {
        &self.values
    }

    fn phase_values(&self) -> [f64; 2] {
        self.phase_values
    }
}

impl<const D: usize> Stored<D> {
    /// As many values as there are nodes, and `phase_values` elsewhere, in the negative and in the positive phase.
    pub fn new(values: Vec<f64>, nodes: Nodes<D>, phase_values: [f64; 2]) -> Self {
        Self {
            nodes,
            values,
            phase_values,
        }
    }

    /// A phase field with these values at nodes, -1 or 1 elsewhere.
    ///
    /// # Errors
    /// [`Error::ValueCount`] for another number of values than of nodes, [`Error::NonFinite`].
    pub fn from_values(nodes: Nodes<D>, values: Vec<f64>) -> Result<Self, Error> {
        check_values(&values, nodes.len())?;
        Ok(Self::new(values, nodes, PHASES))
    }

    /// The phase field whose values `read` writes for nodes in a row from one on, perhaps more than once, without the parts of the grid on
    /// which it is nothing but -1 or 1, if there are such: they are never in memory.
    ///
    /// # Errors
    /// [`Error::NonFinite`].
    pub fn read_from(grid: Grid<D>, read: &Reader<'_>) -> Result<Self, Error> {
        let Some(stored) = Self::without_phases(grid, read) else {
            return Ok(Self::whole(Field::read_from(grid, read)?));
        };
        stored.check_finite()?;
        Ok(stored)
    }

    /// None if all of the grid is stored.
    fn without_phases(grid: Grid<D>, read: &Reader<'_>) -> Option<Self> {
        let bricks = Bricks::without_phases(grid.cells(), SIDE, read, PHASES).ok()?;
        (bricks.len() < grid.len()).then(|| {
            let values = bricks.gather_from(read);
            Self::new(values, Nodes::on_bricks(grid, Arc::new(bricks)), PHASES)
        })
    }

    /// All of a phase field.
    pub fn whole(u: Field<D>) -> Self {
        let nodes = (*u.grid()).into();
        Self::new(u.into_values(), nodes, PHASES)
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<D> {
        self.nodes.grid()
    }

    /// The field on the whole grid.
    ///
    /// # Errors
    /// [`Error::NonFinite`].
    pub fn field(&self) -> Result<Field<D>, Error> {
        Field::from_values(*self.grid(), self.on_grid())
    }

    fn on_grid(&self) -> Vec<f64> {
        match self.nodes.bricks() {
            Some(bricks) => bricks.scatter(&self.values, self.phase_values),
            None => self.values.clone(),
        }
    }

    /// The values at the nodes.
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }

    /// The same field, stored at other nodes of its grid.
    #[must_use]
    pub fn on(&self, nodes: &Nodes<D>) -> Self {
        let values = match nodes.bricks() {
            Some(bricks) => self.values_on(bricks),
            None => self.on_grid(),
        };
        Self::new(values, nodes.clone(), self.phase_values)
    }

    /// Its values where `other` changes its sign, by linear interpolation along the edges of the grid.
    pub fn where_zero(&self, other: &Self) -> Vec<f64> {
        let (nodes, own) = (&other.nodes, self.on(&other.nodes));
        let of_axis = |axis: usize| {
            parallel::filter_map(nodes.len(), CHUNK, &|node| {
                let [next] = nodes.along(node, nodes.multi_index(node), axis, [1]);
                let next = next.stored()?;
                let (a, b) = (other.values[node], other.values[next]);
                let (c, d) = (own.values[node], own.values[next]);
                ((a > 0.0) != (b > 0.0)).then(|| c + (d - c) * a / (a - b))
            })
        };
        (0..D).flat_map(of_axis).collect()
    }

    /// Applies a function to every value, in parallel.
    #[must_use]
    pub fn map(&self, f: impl Fn(f64) -> f64 + Sync) -> Self {
        let values = parallel::values(self.values.len(), |i| f(self.values[i]));
        Self::new(values, self.nodes.clone(), self.phase_values.map(f))
    }

    /// A function of two fields, on the larger one of their sets of bricks, to which the other is carried.
    ///
    /// # Panics
    /// If one is on bricks and the other is not.
    #[must_use]
    pub fn zip_map(&self, other: &Self, f: impl Fn(f64, f64) -> f64 + Sync) -> Self {
        assert_eq!(
            self.nodes.bricks().is_some(),
            other.nodes.bricks().is_some(),
            "both are on bricks, or neither"
        );
        if self.nodes.bricks() != other.nodes.bricks() {
            if other.values.len() > self.values.len() {
                return self.on(&other.nodes).zip_map(other, f);
            }
            return self.zip_map(&other.on(&self.nodes), f);
        }
        let (own, others) = (&self.values, &other.values);
        let values = parallel::values(own.len(), |i| f(own[i], others[i]));
        let phase_values =
            [0, 1].map(|phase| f(self.phase_values[phase], other.phase_values[phase]));
        Self::new(values, self.nodes.clone(), phase_values)
    }

    /// The Laplacian by centred differences of second order, periodic.
    #[must_use]
    pub fn laplacian(&self) -> Self {
        let unit = self.grid().spacing().powi(-2);
        let at = |node: usize| {
            let place = self.nodes.multi_index(node);
            let along = |axis: usize| {
                let beside = self.nodes.along(node, place, axis, [-1, 1]);
                let [before, after] = beside.map(|found| self.value(found));
                after - 2.0 * self.values[node] + before
            };
            unit * (0..D).map(along).sum::<f64>()
        };
        let values = parallel::values(self.values.len(), at);
        Self::new(values, self.nodes.clone(), [0.0; 2])
    }

    /// The values with the weights `(1, 4, 1) / 6` of a cubic B-spline along every axis, periodic, twice: edges are rounded over two cells, and
    /// `cos(k x)` is multiplied by `((2 + cos k h) / 3)^2`.
    #[must_use]
    pub fn smoothed(&self) -> Self {
        let mut smoothed = self.clone();
        for axis in (0..D).chain(0..D) {
            let along = |node: usize| {
                let place = self.nodes.multi_index(node);
                let beside = self.nodes.along(node, place, axis, [-1, 1]);
                let [before, after] = beside.map(|found| smoothed.value(found));
                (before + 4.0 * smoothed.values[node] + after) / 6.0
            };
            smoothed.values = parallel::values(self.values.len(), along);
        }
        smoothed
    }

    /// The largest size of a value.
    pub fn largest(&self) -> f64 {
        let sizes = self.values.iter().map(|value| value.abs());
        sizes.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::{bounding_box, perimeter, zero_set_volume};
    use crate::shapes::Ball;
    use crate::{distances_from_phase_field, phase_field, stored_phase_field};

    const EPS: f64 = 1.0 / 32.0;

    #[test]
    fn without_its_pure_phases_a_field_is_the_same() {
        let grid = Grid::centred(128, 8.0).unwrap();
        let shape = Ball::new([0.0; 2], 1.0).unwrap();
        let disc = phase_field(grid, &shape, EPS).unwrap();
        let stored = Stored::from(disc.clone());
        assert!(2 * stored.values().len() < grid.len());
        let never_whole = stored_phase_field(grid, &shape, EPS).unwrap();
        assert_eq!(never_whole.nodes(), stored.nodes());
        assert_eq!(never_whole.values(), stored.values());
        assert!(stored_phase_field(grid, &|_: [f64; 2]| f64::NAN, EPS).is_err());
        assert_eq!(stored.field().unwrap(), disc);
        // On bricks of another size, too.
        let bricks = Bricks::new(128, 16, |[i, j]| (i + j) % 2 == 0, |_| false).unwrap();
        assert_eq!(stored.values_on(&bricks), bricks.gather(disc.values()));
        let undivided = Field::constant(Grid::new(20, 1.0).unwrap(), 1.0);
        let stored = Stored::<2>::from(undivided.clone());
        assert_eq!(stored.field().unwrap(), undivided);
        let lacking = Stored::from_values(stored.nodes().clone(), vec![1.0; 3]);
        assert!(lacking.is_err());
    }

    /// A square whose sides are those of bricks, without a profile.
    #[test]
    fn interfaces_between_bricks_are_stored() {
        let inside = |x: [f64; 2]| x.iter().all(|x| (0.25..0.5).contains(x));
        let grid = Grid::new(64, 1.0).unwrap();
        let square = Field::from_fn(grid, |x| if inside(x) { 1.0 } else { -1.0 });
        let (stored, whole) = (Stored::from(square.clone()), Stored::whole(square));
        assert_eq!(stored.values().len(), 16 * 64);
        assert_eq!(stored.field().unwrap(), whole.field().unwrap());
        let of = |u: &Stored<2>| (perimeter(u, EPS).unwrap(), zero_set_volume(u));
        let ((length, area), (whole_length, whole_area)) = (of(&stored), of(&whole));
        assert!((length / whole_length - 1.0).abs() < 1e-13);
        assert!((area / whole_area - 1.0).abs() < 1e-13);
        assert_eq!(
            stored.where_zero(&whole).len(),
            whole.where_zero(&whole).len()
        );
    }

    #[test]
    fn smoothing_multiplies_waves_by_its_symbol() {
        let wave = Field::from_fn(Grid::<3>::new(16, 1.0).unwrap(), |[x, y, z]| {
            ((x + 2.0 * y + 3.0 * z) * std::f64::consts::TAU).sin()
        });
        let along = |axis: usize| {
            let cosine = (std::f64::consts::TAU * (axis + 1) as f64 / 16.0).cos();
            ((2.0 + cosine) / 3.0).powi(2)
        };
        let symbol: f64 = (0..3).map(along).product();
        let smooth = Stored::whole(wave.clone()).smoothed();
        for (smooth, value) in smooth.values().iter().zip(wave.values()) {
            assert!((smooth - symbol * value).abs() < 1e-14);
        }
    }

    /// What is read of distances near the interface has the same bits, stored in either way.
    #[test]
    fn distances_on_bricks_are_those_on_the_grid() {
        for sign in [1.0, -1.0] {
            let grid = Grid::<3>::centred(64, 4.0).unwrap();
            let ball = phase_field(grid, &Ball::new([0.1, 0.0, 0.2], 0.5).unwrap(), EPS).unwrap();
            let ball = ball.map(|u| sign * u);
            let ways = [Stored::from(ball.clone()), Stored::whole(ball)];
            assert!(2 * ways[0].values().len() < ways[1].values().len());
            let [few, all] = ways.each_ref().map(|u| bounding_box(u).unwrap());
            assert_eq!((few.lower, few.upper), (all.lower, all.upper));
            let [few, all] = ways.map(|u| distances_from_phase_field(&u, EPS).unwrap());
            for (few, all) in [(few.smoothed(), all.smoothed()), (few, all)] {
                for x in [[0.6, 0.0, 0.2], [0.11, -0.48, 0.23], [0.1, 0.03, 0.68]] {
                    assert_eq!(few.spline(x), all.spline(x));
                }
            }
        }
    }
}
