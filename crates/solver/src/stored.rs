//! Arithmetic of fields node by node, on what is stored of them.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Bricks, Field, Grid, Nodes, PhaseField, parallel};
use operators::ComputeDevice;

use crate::Error;
use crate::active::Active;

/// Nodes are worked on in pieces of this many.
const CHUNK: usize = 1 << 14;
/// Cells along each axis of the bricks without which a phase field is stored that is constant there.
const SIDE: usize = 8;
/// The values of phase fields in the negative and in the positive phase.
const PHASES: [f64; 2] = [-1.0, 1.0];

/// The values of a field on the whole grid, or on bricks, with the constants that it has outside.
#[derive(Clone, Debug)]
pub struct Stored<const D: usize> {
    nodes: Nodes<D>,
    values: Vec<f64>,
    /// The values in the negative and in the positive phase where nothing is stored.
    rests: [f64; 2],
}

/// Without the parts of the grid on which it is nothing but -1 or 1, if there are such.
impl<const D: usize> From<Field<D>> for Stored<D> {
    fn from(u: Field<D>) -> Self {
        let grid = *u.grid();
        match Bricks::without_phases(grid.cells(), SIDE, u.values(), PHASES) {
            Ok(bricks) if bricks.len() < grid.len() => {
                let values = bricks.values_of(&u);
                Self::new(values, Nodes::on_bricks(grid, Arc::new(bricks)), PHASES)
            }
            _ => Self::whole(u),
        }
    }
}

impl<const D: usize> PhaseField<D> for Stored<D> {
    fn nodes(&self) -> Nodes<D> {
        self.nodes.clone()
    }

    fn values(&self) -> &[f64] {
        &self.values
    }

    fn rests(&self) -> [f64; 2] {
        self.rests
    }
}

impl<const D: usize> Stored<D> {
    /// A phase field that is stored in this way.
    pub(crate) fn of(
        u: &Tensor<D>,
        grid: Grid<D>,
        active: Option<&Active<D>>,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let rests = active.map_or(PHASES, Active::rests);
        let nodes = active.map_or_else(|| grid.into(), Active::nodes);
        Ok(Self::new(device.values(u.clone())?, nodes, rests))
    }

    /// Values as they are stored; `rests` elsewhere.
    pub(crate) fn new(values: Vec<f64>, nodes: Nodes<D>, rests: [f64; 2]) -> Self {
        Self {
            nodes,
            values,
            rests,
        }
    }

    /// A phase field with these values at nodes, -1 or 1 elsewhere.
    ///
    /// # Errors
    /// [`Error::Geometry`] for another number of values than of nodes, and for values that are not finite.
    pub fn from_values(nodes: Nodes<D>, values: Vec<f64>) -> Result<Self, Error> {
        let (expected, actual) = (nodes.len(), values.len());
        if expected != actual {
            return Err(geometry::Error::ValueCount { expected, actual }.into());
        }
        let stored = Self::new(values, nodes, PHASES);
        stored.check_finite()?;
        Ok(stored)
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
    /// [`Error::Geometry`] for values that are not finite.
    pub fn field(&self) -> Result<Field<D>, Error> {
        Ok(Field::from_values(*self.grid(), self.on_grid())?)
    }

    fn on_grid(&self) -> Vec<f64> {
        match self.nodes.bricks() {
            Some(bricks) => bricks.scatter(&self.values, self.rests),
            None => self.values.clone(),
        }
    }

    /// Writes the values of the whole grid for nodes in a row from one on; where it is on bricks, both multiples of their sides.
    pub fn read(&self, start: usize, part: &mut [f64]) {
        match self.nodes.bricks() {
            Some(bricks) => bricks.read(&self.values, self.rests, start, part),
            None => part.copy_from_slice(&self.values[start..][..part.len()]),
        }
    }

    pub(crate) fn into_values(self) -> Vec<f64> {
        self.values
    }

    pub(crate) fn tensor(&self, device: &ComputeDevice) -> Tensor<D> {
        let whole = || self.grid().shape();
        let shape = (self.nodes.bricks()).map_or_else(whole, |bricks| bricks.shape());
        device.tensor(&self.values, shape)
    }

    /// The same field, stored at other nodes.
    pub(crate) fn on(&self, nodes: &Nodes<D>) -> Self {
        let values = match nodes.bricks() {
            Some(bricks) => bricks.values_of(self),
            None => self.on_grid(),
        };
        Self::new(values, nodes.clone(), self.rests)
    }

    /// Its values where `other` changes its sign, by linear interpolation along the edges of the grid.
    pub fn where_zero(&self, other: &Self) -> Vec<f64> {
        let (nodes, own) = (&other.nodes, self.on(&other.nodes));
        let of_axis = |axis: usize| {
            parallel::filter_map(nodes.len(), CHUNK, &|node| {
                let [next] = nodes.along(node, nodes.place(node), axis, [1]);
                let next = next.ok()?;
                let [a, b] = [node, next].map(|k| other.values[k]);
                let [c, d] = [node, next].map(|k| own.values[k]);
                ((a > 0.0) != (b > 0.0)).then(|| c + (d - c) * a / (a - b))
            })
        };
        (0..D).flat_map(of_axis).collect()
    }

    pub(crate) fn map(&self, f: impl Fn(f64) -> f64 + Sync) -> Self {
        let values = parallel::values(self.values.len(), |i| f(self.values[i]));
        Self::new(values, self.nodes.clone(), self.rests.map(f))
    }

    /// A function of two fields, on the larger one of their sets of bricks, to which the other is carried.
    pub(crate) fn zip_map(&self, other: &Self, f: impl Fn(f64, f64) -> f64 + Sync) -> Self {
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
        let rests = [0, 1].map(|phase| f(self.rests[phase], other.rests[phase]));
        Self::new(values, self.nodes.clone(), rests)
    }

    /// The Laplacian by centred differences of second order, periodic.
    pub(crate) fn laplacian(&self) -> Self {
        let unit = self.grid().spacing().powi(-2);
        let at = |node: usize| {
            let place = self.nodes.place(node);
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

    /// The largest size of a value.
    pub(crate) fn largest(&self) -> f64 {
        let sizes = self.values.iter().map(|value| value.abs());
        sizes.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::measure::{has_interface, perimeter, touches_side, zero_set_volume};
    use geometry::shapes::Ball;
    use geometry::zero_set::Sizes;
    use geometry::{ZeroSet, phase_field};
    use model::{Ratios, SeparableOperator, Shipped};

    const EPS: f64 = 1.0 / 32.0;

    fn disc(radius: f64) -> (Field<2>, Active<2>) {
        let device = ComputeDevice::default_compiled().unwrap();
        let grid = Grid::centred(128, 2.0).unwrap();
        let ratios = Ratios::of_run(2, 17, grid.spacing(), EPS, grid.spacing().powi(2));
        let network = Shipped::Accurate.find(ratios).unwrap();
        let operator = SeparableOperator::new(&network, &device).unwrap();
        let disc = phase_field(grid, &Ball::new([0.0; 2], radius).unwrap(), EPS).unwrap();
        let active = Active::new(operator, &disc, EPS).unwrap();
        (disc, active)
    }

    fn part_of(field: &Field<2>, active: &Active<2>) -> Stored<2> {
        let values = active.bricks.gather(field.values());
        let rests = active.rests();
        Stored::new(values, active.nodes(), rests)
    }

    /// Of the same fields on the whole grid the results have the same bits on the bricks.
    #[test]
    fn results_on_bricks_are_those_on_the_grid() {
        let (disc, active) = disc(0.5);
        let (bricks, rests) = (active.bricks.clone(), active.rests());
        let part = part_of(&disc, &active);
        let whole = part.field().unwrap().into_values();
        let whole = Stored::new(whole, (*disc.grid()).into(), rests);
        assert!(part.values.len() < whole.values.len());
        let same = |part: &Stored<2>, whole: &Stored<2>| {
            assert_eq!(part.values, bricks.gather(&whole.values));
        };
        same(&part.map(f64::sinh), &whole.map(f64::sinh));
        same(&part.laplacian(), &whole.laplacian());
        let mixed = |x: &Stored<2>| x.zip_map(&x.map(|u| 1.0 - u * u), |u, v| u + 3.0 * v);
        same(&mixed(&part), &mixed(&whole));
        assert_eq!(
            mixed(&part).field().unwrap(),
            mixed(&whole).field().unwrap()
        );
        assert!((part.laplacian().largest() - whole.laplacian().largest()).abs() < 1e-9);
    }

    /// Sums over the bricks have another order, and the values outside are counted.
    #[test]
    fn measures_on_bricks_are_those_on_the_grid() {
        for sign in [1.0, -1.0] {
            let (disc, active) = disc(0.5);
            let bricks = active.bricks.clone();
            let part = part_of(&disc, &active).map(|u| sign * u);
            let whole = Stored::whole(part.field().unwrap());
            let [few, all] = [&part, &whole].map(|u| Sizes::of(u, EPS).unwrap());
            let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-13, "{a} {b}");
            near(zero_set_volume(&part), zero_set_volume(&whole));
            let lengths = [&part, &whole].map(|u| perimeter(u, EPS).unwrap());
            near(lengths[0], lengths[1]);
            near(few.perimeter(), all.perimeter());
            near(few.volume(), all.volume());
            let same = |few: Vec<f64>, all: Vec<f64>| assert_eq!(few, bricks.gather(&all));
            same(few.perimeter_gradient(), all.perimeter_gradient());
            same(few.volume_gradient(), all.volume_gradient());
            same(few.mean_curvature(), all.mean_curvature());
            let [few, all] = [&part, &whole].map(|u| ZeroSet::of(u, EPS).unwrap());
            near(few.willmore_energy, all.willmore_energy);
            near(few.smallest_radius, all.smallest_radius);
            for u in [&part, &whole] {
                assert!(has_interface(u));
                assert_eq!(touches_side(u, -0.9), sign < 0.0);
                assert!(u.where_zero(u).iter().all(|value| value.abs() < 1e-15));
            }
            assert_eq!(part.where_zero(&part).len(), whole.where_zero(&whole).len());
        }
    }

    #[test]
    fn without_its_pure_phases_a_field_is_the_same() {
        let grid = Grid::centred(128, 8.0).unwrap();
        let disc = phase_field(grid, &Ball::new([0.0; 2], 1.0).unwrap(), EPS).unwrap();
        let stored = Stored::from(disc.clone());
        assert!(2 * stored.values.len() < grid.len());
        assert_eq!(stored.field().unwrap(), disc);
        // On bricks of another size, too.
        let bricks = Bricks::new(128, 16, |[i, j]| (i + j) % 2 == 0, |_| false).unwrap();
        assert_eq!(bricks.values_of(&stored), bricks.gather(disc.values()));
        let undivided = Field::constant(Grid::new(20, 1.0).unwrap(), 1.0);
        let stored = Stored::<2>::from(undivided.clone());
        assert_eq!(stored.field().unwrap(), undivided);
        let lacking = Stored::from_values(stored.nodes(), vec![1.0; 3]);
        assert!(lacking.is_err());
    }

    /// A square whose sides are those of bricks, without a profile.
    #[test]
    fn interfaces_between_bricks_are_stored() {
        let inside = |x: [f64; 2]| x.iter().all(|x| (0.25..0.5).contains(x));
        let grid = Grid::new(64, 1.0).unwrap();
        let square = Field::from_fn(grid, |x| if inside(x) { 1.0 } else { -1.0 });
        let (stored, whole) = (Stored::from(square.clone()), Stored::whole(square));
        assert_eq!(stored.values.len(), 16 * 64);
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
    fn fields_on_fewer_bricks_are_continued_by_their_constants() {
        let ((small, few), (_, many)) = (disc(0.3), disc(0.6));
        let u = part_of(&small, &few);
        let v = u.on(&many.nodes());
        assert!(v.values.len() > u.values.len());
        // Where those bricks are none of its own, the field is nearly constant.
        let outer = part_of(&small, &many);
        let difference = outer.zip_map(&v, |a, b| a - b);
        assert!(difference.largest() < 2e-4, "{}", difference.largest());
        // Nothing remains of a difference to itself, whichever of both has more bricks.
        for nothing in [u.zip_map(&v, |a, b| a - b), v.zip_map(&u, |a, b| a - b)] {
            assert_eq!(
                (nothing.values.len(), nothing.largest()),
                (v.values.len(), 0.0)
            );
        }
    }
}
