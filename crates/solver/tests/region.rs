//! Flows in which only some unknowns move.

use crate::common::flow::Flow;
use crate::common::{ball, device, network, network_3d, params};
use geometry::shapes::Ball;
use geometry::{Field, Grid, NodeSet, SignedDistanceExt, measure, phase_field};
use model::Network;
use solver::{Error, Exit};

/// A ball without the part beyond a plane through its middle, and a cube around the cut.
fn cut<const D: usize>(grid: Grid<D>, eps: f64) -> (Field<D>, NodeSet) {
    let ball = Ball::new([0.0; D], 0.25).unwrap();
    let shape = ball.difference(|x: [f64; D]| 0.12 - x[0]);
    let nodes = (0..grid.len()).map(|i| grid.node(i)[0] > 0.05).collect();
    (phase_field(grid, &shape, eps).unwrap(), nodes)
}

fn flow<const D: usize>(grid: Grid<D>, network: &Network, initial: &Field<D>) -> Flow<D> {
    Flow::with_network(network, initial, params(&grid), &device()).unwrap()
}

fn only_the_region_moves<const D: usize>(grid: Grid<D>, network: &Network, tau: f64) {
    let (initial, nodes) = cut(grid, params(&grid).eps);
    let full = ball(grid, 0.25);
    let mut flow = flow(grid, network, &initial);
    flow.restrict_to(&nodes).unwrap();
    let before = measure::l2_distance(&initial, &full).unwrap();
    for _ in 0..6 {
        let record = flow.advance(tau).unwrap();
        assert_eq!(record.newton.exit, Exit::Converged, "{record:?}");
        assert!(record.energy < record.energy_before, "{record:?}");
    }
    let field = flow.field().unwrap();
    let mut moved = 0;
    for ((u, start), inside) in field
        .values()
        .iter()
        .zip(initial.values())
        .zip(nodes.iter())
    {
        let same = u.to_bits() == start.to_bits();
        assert!(same || inside);
        moved += usize::from(!same);
    }
    assert!(moved > 0);
    let after = measure::l2_distance(&field, &full).unwrap();
    assert!(after < 0.95 * before, "{D}D: {before} {after}");
}

#[test]
fn values_outside_a_region_stay_bit_for_bit_in_2d() {
    let grid = Grid::<2>::per_unit(128, 0.75).unwrap();
    only_the_region_moves(grid, &network(), grid.spacing().powi(2));
}

#[test]
fn values_outside_a_region_stay_bit_for_bit_in_3d() {
    let grid = Grid::<3>::per_unit(48, 0.75).unwrap();
    only_the_region_moves(grid, &network_3d(), 0.25 * grid.spacing().powi(2));
}

#[test]
fn everything_as_region_is_no_region() {
    let grid = Grid::<2>::per_unit(128, 0.75).unwrap();
    let (initial, _) = cut(grid, params(&grid).eps);
    let tau = grid.spacing().powi(2);
    let mut free = flow(grid, &network(), &initial);
    let mut restricted = flow(grid, &network(), &initial);
    let all = (0..grid.len()).map(|_| true).collect();
    restricted.restrict_to(&all).unwrap();
    for _ in 0..2 {
        free.advance(tau).unwrap();
        restricted.advance(tau).unwrap();
    }
    let (free, restricted) = (free.field().unwrap(), restricted.field().unwrap());
    assert_eq!(free.values(), restricted.values());
}

/// At the minimizer the energy is stationary for changes inside, and for no others.
#[test]
fn the_minimizer_is_stationary_inside() {
    let grid = Grid::<2>::per_unit(128, 0.75).unwrap();
    let (initial, nodes) = cut(grid, params(&grid).eps);
    let mut parameters = params(&grid);
    parameters.newton.tolerance = 1e-6;
    let mut flow = Flow::with_network(&network(), &initial, parameters, &device()).unwrap();
    flow.restrict_to(&nodes).unwrap();
    let tau = grid.spacing().powi(2);
    flow.advance(tau).unwrap();
    let operator = model::MeanCurvatureOperator::<2>::new(&network(), &device()).unwrap();
    let mut energy =
        solver::MinimizingMovement::new(std::sync::Arc::new(operator), grid.cells(), &device())
            .unwrap();
    let tensor = |field: &Field<2>| device().tensor::<2>(field.values(), [grid.cells(); 2]);
    energy
        .set(&tensor(&initial), parameters.stiffness(tau))
        .unwrap();
    use solver::Objective;
    let norms = |u: &Field<2>, energy: &mut solver::MinimizingMovement<2>| {
        let (_, gradient) = energy.evaluate(&tensor(u)).unwrap();
        let gradient = device().values(gradient).unwrap();
        let mut squares = [0.0; 2];
        for (g, inside) in gradient.iter().zip(nodes.iter()) {
            squares[usize::from(inside)] += g * g;
        }
        squares.map(f64::sqrt)
    };
    let [_, start] = norms(&initial, &mut energy);
    let [outside, inside] = norms(&flow.field().unwrap(), &mut energy);
    assert!(inside < 1e-4 * start, "{inside:e} {start:e}");
    assert!(outside > 10.0 * inside, "{outside:e} {inside:e}");
}

#[test]
fn regions_that_do_not_fit_are_refused() {
    let grid = Grid::<2>::per_unit(64, 0.75).unwrap();
    let initial = ball(grid, 0.25);
    let mut flow = flow(grid, &network(), &initial);
    for nodes in [vec![true; 7], vec![false; grid.len()]] {
        let error = flow.restrict_to(&nodes.into_iter().collect());
        let error = error.unwrap_err();
        assert!(matches!(error, Error::Region { .. }), "{error}");
    }
}
