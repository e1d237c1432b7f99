//! What is stored of phase fields, between the host and the device.

use burn::tensor::Tensor;
use geometry::{Grid, PhaseField, Stored};
use operators::ComputeDevice;

use crate::Error;
use crate::active::Active;

/// A phase field on the whole grid, or on its active bricks.
pub(crate) fn stored<const D: usize>(
    u: &Tensor<D>,
    grid: Grid<D>,
    active: Option<&Active<D>>,
    device: &ComputeDevice,
) -> Result<Stored<D>, Error> {
    let rests = active.map_or([-1.0, 1.0], Active::rests);
    let nodes = active.map_or_else(|| grid.into(), Active::nodes);
    Ok(Stored::new(device.values(u.clone())?, nodes, rests))
}

/// The values on the device, in the shape of the grid or of the bricks.
pub(crate) fn tensor<const D: usize>(u: &Stored<D>, device: &ComputeDevice) -> Tensor<D> {
    let whole = || u.grid().shape();
    let shape = (u.nodes().bricks()).map_or_else(whole, |bricks| bricks.shape());
    device.tensor(u.values(), shape)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::measure::{has_interface, perimeter, touches_side, zero_set_volume};
    use geometry::shapes::Ball;
    use geometry::zero_set::Sizes;
    use geometry::{Field, ZeroSet, phase_field};
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
    fn fields_on_fewer_bricks_are_continued_by_their_constants() {
        let ((small, few), (_, many)) = (disc(0.3), disc(0.6));
        let u = part_of(&small, &few);
        let v = u.on(&many.nodes());
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
