//! The state of a flow: a value, whose clones share tensors.

use std::collections::BTreeMap;

use burn::tensor::Tensor;
use geometry::{Field, Nodes, PhaseField, Stored};
use operators::ComputeDevice;

use crate::{Error, StepSize};

/// A field on a device: its values at [nodes](Nodes), on the whole grid or on bricks, and the constants that it has elsewhere.
#[derive(Clone, Debug)]
pub struct DeviceField<const D: usize> {
    values: Tensor<D>,
    nodes: Nodes<D>,
    phase_values: [f64; 2],
    device: ComputeDevice,
}

impl<const D: usize> DeviceField<D> {
    /// A field whose values are on the device already, in the shape of the grid or of the bricks; `phase_values` are its values in the negative and in
    /// the positive phase where nothing is stored.
    pub fn new(
        values: Tensor<D>,
        nodes: Nodes<D>,
        phase_values: [f64; 2],
        device: &ComputeDevice,
    ) -> Self {
        Self {
            values,
            nodes,
            phase_values,
            device: device.clone(),
        }
    }

    /// A field that is uploaded as it is stored.
    pub fn upload(u: &Stored<D>, device: &ComputeDevice) -> Self {
        let whole = || u.grid().shape();
        let shape = (u.nodes().bricks()).map_or_else(whole, |bricks| bricks.shape());
        let values = device.tensor(u.values(), shape);
        Self::new(values, u.nodes().clone(), u.phase_values(), device)
    }

    /// The values, in the shape of the grid or of the bricks.
    pub fn values(&self) -> &Tensor<D> {
        &self.values
    }

    /// Where they lie.
    pub fn nodes(&self) -> &Nodes<D> {
        &self.nodes
    }

    /// The device.
    pub fn device(&self) -> &ComputeDevice {
        &self.device
    }

    /// Other values at the same nodes.
    #[must_use]
    pub fn with(&self, values: Tensor<D>) -> Self {
        Self {
            values,
            ..self.clone()
        }
    }

    /// The values in the negative and in the positive phase where nothing is stored.
    pub fn phase_values(&self) -> [f64; 2] {
        self.phase_values
    }

    /// The field on the host, stored in the same way; values that are not finite come along.
    ///
    /// # Errors
    /// [`Error::Operators`] if the device fails.
    pub fn stored(&self) -> Result<Stored<D>, Error> {
        let values = self.device.values(self.values.clone())?;
        Ok(Stored::new(values, self.nodes.clone(), self.phase_values))
    }

    /// The field on the host, on the whole grid.
    ///
    /// # Errors
    /// As [`Self::stored`]; [`Error::Geometry`] for values that are not finite.
    pub fn field(&self) -> Result<Field<D>, Error> {
        Ok(self.stored()?.field()?)
    }

    /// The same field, stored at other nodes of its grid.
    ///
    /// # Errors
    /// As [`Self::stored`].
    pub fn on(&self, nodes: &Nodes<D>) -> Result<Self, Error> {
        if self.nodes == *nodes {
            return Ok(self.clone());
        }
        Ok(Self::upload(&self.stored()?.on(nodes), &self.device))
    }
}

/// What a scheme remembers of the steps before, by names: fields, on this grid or a coarser one, and numbers. A flow that is restored with them
/// continues with the same bytes.
#[derive(Clone, Debug, Default)]
pub struct Memory<const D: usize> {
    /// The fields.
    pub fields: BTreeMap<String, DeviceField<D>>,
    /// The numbers.
    pub numbers: BTreeMap<String, f64>,
}

/// Where a flow is, and everything that its following steps depend on besides the [problem](crate::Problem).
#[derive(Clone, Debug)]
pub struct State<const D: usize> {
    /// The phase field.
    pub field: DeviceField<D>,
    /// Steps made, each by one call of a [scheme](crate::Scheme).
    pub step: usize,
    /// Time reached.
    pub time: f64,
    /// Time steps passed by which the targets of [held sizes](crate::Held) move, parts of them included.
    pub progress: f64,
    /// What the scheme remembers.
    pub memory: Memory<D>,
}

impl<const D: usize> State<D> {
    /// The start of a flow from a phase field.
    pub fn at(field: DeviceField<D>) -> Self {
        Self {
            field,
            step: 0,
            time: 0.0,
            progress: 0.0,
            memory: Memory::default(),
        }
    }

    /// The state after a step of this size, with the phase field there and what the scheme remembers.
    #[must_use]
    pub fn after(&self, size: StepSize, field: DeviceField<D>, memory: Memory<D>) -> Self {
        Self {
            field,
            step: self.step + 1,
            time: self.time + size.tau,
            progress: self.progress + size.part(),
            memory,
        }
    }

    /// The phase field on the host, as it is stored.
    ///
    /// # Errors
    /// [`Error::NonFinite`] naming the step, [`Error::Operators`] if the device fails.
    pub fn stored(&self) -> Result<Stored<D>, Error> {
        let now = self.field.stored()?;
        now.check_finite()
            .map_err(|_| Error::non_finite(self.step, "phase field"))?;
        Ok(now)
    }

    /// The phase field on the host, on the whole grid.
    ///
    /// # Errors
    /// As [`Self::stored`].
    pub fn on_grid(&self) -> Result<Field<D>, Error> {
        Ok(self.stored()?.field()?)
    }

    /// The same state with the fields of this grid stored at other nodes of it.
    pub(crate) fn on(&self, nodes: &Nodes<D>) -> Result<Self, Error> {
        let mut carried = self.clone();
        carried.field = self.field.on(nodes)?;
        for field in carried.memory.fields.values_mut() {
            if field.nodes().grid() == nodes.grid() {
                *field = field.on(nodes)?;
            }
        }
        Ok(carried)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bricks;
    use geometry::measure::{has_interface, perimeter, touches_side, zero_set_volume};
    use geometry::shapes::Ball;
    use geometry::zero_set::Sizes;
    use geometry::{Grid, ZeroSet, phase_field};
    use model::{Ratios, SeparableOperator, Shipped};

    const EPS: f64 = 1.0 / 32.0;

    fn disc(radius: f64) -> (Field<2>, DeviceField<2>) {
        let device = ComputeDevice::default_compiled().unwrap();
        let grid = Grid::centred(128, 2.0).unwrap();
        let ratios = Ratios::of_run(2, 17, grid.spacing(), EPS, grid.spacing().powi(2));
        let network = Shipped::Accurate.find(ratios).unwrap();
        let operator = SeparableOperator::<2>::new(&network, &device).unwrap();
        let disc = phase_field(grid, &Ball::new([0.0; 2], radius).unwrap(), EPS).unwrap();
        let nodes = bricks::near(&disc, operator.brick_side(), EPS).unwrap();
        let values = disc.values_on(nodes.bricks().unwrap());
        let stored = Stored::new(values, nodes, operator.phase_values());
        let field = DeviceField::upload(&stored, &device);
        (disc, field)
    }

    fn part_of(field: &Field<2>, like: &DeviceField<2>) -> Stored<2> {
        let nodes = like.nodes();
        let values = nodes.bricks().unwrap().gather(field.values());
        Stored::new(values, nodes.clone(), like.phase_values)
    }

    /// Of the same fields on the whole grid the results have the same bits on the bricks.
    #[test]
    fn results_on_bricks_are_those_on_the_grid() {
        let (disc, active) = disc(0.5);
        let (bricks, phase_values) = (
            active.nodes().bricks().unwrap().clone(),
            active.phase_values,
        );
        let part = part_of(&disc, &active);
        let whole = part.field().unwrap().into_values();
        let whole = Stored::new(whole, (*disc.grid()).into(), phase_values);
        assert!(part.values().len() < whole.values().len());
        let same = |part: &Stored<2>, whole: &Stored<2>| {
            assert_eq!(part.values(), bricks.gather(whole.values()));
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
            let bricks = active.nodes().bricks().unwrap().clone();
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

    /// A step that makes the bricks more leaves what it remembers on those before.
    #[test]
    fn what_is_remembered_follows_the_field() {
        let ((_, few), (_, many)) = (disc(0.3), disc(0.6));
        let mut state = State::at(many.clone());
        state.memory.fields.insert("before".to_owned(), few);
        let carried = state.on(many.nodes()).unwrap();
        assert!(carried.memory.fields["before"].nodes() == many.nodes());
    }

    #[test]
    fn fields_on_fewer_bricks_are_continued_by_their_constants() {
        let ((small, few), (_, many)) = (disc(0.3), disc(0.6));
        let u = part_of(&small, &few);
        let v = u.on(many.nodes());
        assert!(v.values().len() > u.values().len());
        // Where those bricks are none of its own, the field is nearly constant.
        let outer = part_of(&small, &many);
        let difference = outer.zip_map(&v, |a, b| a - b);
        assert!(difference.largest() < 2e-4, "{}", difference.largest());
        // Nothing remains of a difference to itself, whichever of both has more bricks.
        for nothing in [u.zip_map(&v, |a, b| a - b), v.zip_map(&u, |a, b| a - b)] {
            assert_eq!(
                (nothing.values().len(), nothing.largest()),
                (v.values().len(), 0.0)
            );
        }
    }
}
