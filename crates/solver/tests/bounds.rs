//! Flows whose interface may not go far.

use std::sync::Arc;

use crate::common::flow::Flow;
use crate::common::{accurate, device, params};
use geometry::shapes::Cuboid;
use geometry::{Field, Grid, PhaseField, SignedDistance, Stored, phase_field};
use model::MeanCurvatureOperator;
use solver::{Bounds, Constraints, Error, MinimizingMovement, Objective};

/// A square, whose corners Willmore flow takes off.
fn square() -> Cuboid<2> {
    Cuboid::new([0.2; 2]).unwrap()
}

fn start(grid: Grid<2>) -> Field<2> {
    phase_field(grid, &square(), params(&grid).eps).unwrap()
}

/// The flow of the square, within this many cells of it if there is a bound, after so many steps.
fn flow(cells: Option<f64>, tolerance: f64) -> Flow<2> {
    let grid = Grid::<2>::centred(96, 0.75).unwrap();
    let mut params = params(&grid);
    params.newton.tolerance = tolerance;
    let initial = start(grid);
    let mut flow = Flow::with_network(&accurate(2), &initial, params, &device()).unwrap();
    if let Some(cells) = cells {
        let distance = cells * grid.spacing();
        (flow.problem)
            .keep_within(distance, &Stored::whole(initial))
            .unwrap();
    }
    flow
}

fn tau(flow: &Flow<2>) -> f64 {
    32.0 * flow.problem.grid.spacing().powi(4)
}

/// How far the zero set has gone from the square at most, in cells: by the nodes that are on the other side now, and their neighbours.
fn farthest(u: &Field<2>) -> f64 {
    let grid = u.grid();
    let shape = square();
    let depth = |node: usize| shape.signed_distance(grid.node(node)) / grid.spacing();
    let wrong = (0..grid.len()).filter(|&node| u.values()[node] * depth(node) > 0.0);
    wrong.map(|node| depth(node).abs()).fold(0.0, f64::max)
}

/// The interface stays within the bound, by either scheme and on bricks, with its area kept; without the bound it goes farther.
#[test]
fn an_interface_stays_within_its_bound() {
    const BOUND: f64 = 0.6;
    let mut free = flow(None, 1e-3);
    for _ in 0..8 {
        free.advance(tau(&free)).unwrap();
    }
    assert!(farthest(&free.field().unwrap()) > 1.0);

    for scheme in ["euler", "second order", "bricks"] {
        let mut bound = flow(Some(BOUND), 1e-3);
        let initial = start(bound.problem.grid);
        if scheme == "bricks" {
            bound.state = bound.problem.start_on_bricks(&initial).unwrap();
        }
        let eps = bound.problem.params.eps;
        let wanted = geometry::ZeroSet::of(&initial, eps).unwrap().volume;
        let held = Constraints {
            volume: Some(wanted),
            ..Constraints::default()
        };
        bound.constrain(held).unwrap();
        let mut rounds = 0;
        for _ in 0..8 {
            let tau = tau(&bound);
            let record = if scheme == "second order" {
                bound.advance_second_order(tau).unwrap()
            } else {
                bound.advance(tau).unwrap()
            };
            rounds += record.newton.newton;
            let u = bound.field().unwrap();
            let far = farthest(&u);
            assert!(far <= BOUND, "{scheme}: {far}");
            let area = geometry::ZeroSet::of(&u, eps).unwrap().volume;
            assert!(
                (area / wanted - 1.0).abs() < 1e-9,
                "{scheme}: {area} {wanted}"
            );
        }
        let energy = |field: &Field<2>| {
            let step = MeanCurvatureOperator::<2>::new(&accurate(2), &device()).unwrap();
            let device = device();
            let mut energy =
                MinimizingMovement::new(Arc::new(step), field.grid().cells(), &device).unwrap();
            let u = device.tensor::<2>(field.values(), field.grid().shape());
            energy.set(&u, 1.0).unwrap();
            energy.value(&u).unwrap()
        };
        let [before, after] = [&initial, &bound.field().unwrap()].map(energy);
        assert!(
            rounds > 8 && after < 0.9 * before,
            "{scheme}: {before} {after}"
        );
    }
}

/// The minimizer under bounds fulfils the conditions of Karush, Kuhn and Tucker: the gradient vanishes at free nodes, and at nodes on a bound it pulls
/// beyond that.
#[test]
fn the_minimizer_is_stationary_but_at_its_bounds() {
    let mut flow = flow(Some(0.4), 1e-7);
    let (grid, stored) = (flow.problem.grid, Stored::whole(start(flow.problem.grid)));
    let tau = 4.0 * tau(&flow);
    flow.advance(tau).unwrap();
    let (device, stiffness) = (device(), flow.problem.params.stiffness(tau));
    let step = MeanCurvatureOperator::<2>::new(&accurate(2), &device).unwrap();
    let mut energy = MinimizingMovement::new(Arc::new(step), grid.cells(), &device).unwrap();
    let tensor = |values: &[f64]| device.tensor::<2>(values, grid.shape());
    energy.set(&tensor(stored.values()), stiffness).unwrap();
    let mut gradient_at = |u: &[f64]| {
        let (_, gradient) = energy.evaluate(&tensor(u)).unwrap();
        device.values(gradient).unwrap()
    };
    let first = gradient_at(stored.values());
    let size = first.iter().map(|g| g.abs()).fold(0.0, f64::max);
    let u = flow.field().unwrap();
    let bounds = Bounds::within(0.4 * grid.spacing(), &stored, flow.problem.params.eps).unwrap();
    let (least, most) = (bounds.least(), bounds.most());
    let [mut at_least, mut at_most] = [0, 0];
    for (node, slope) in gradient_at(u.values()).into_iter().enumerate() {
        let slope = slope / size;
        let (u, least, most) = (u.values()[node], least.values()[node], most.values()[node]);
        assert!(u >= least - 1e-8 && u <= most + 1e-8, "{least} {u} {most}");
        if (u - least).abs() < 1e-8 {
            assert!(slope > -1e-4, "{slope}");
            at_least += 1;
        } else if (u - most).abs() < 1e-8 {
            assert!(slope < 1e-4, "{slope}");
            at_most += 1;
        } else {
            assert!(slope.abs() < 1e-4, "{slope} at {:?}", grid.node(node));
        }
    }
    assert!(at_least > 4 && at_most > 4, "{at_least} {at_most}");
}

#[test]
fn lengths_that_are_none_are_refused() {
    let mut flow = flow(None, 1e-3);
    let initial = Stored::whole(start(flow.problem.grid));
    for distance in [0.0, -1.0, f64::NAN] {
        let error = flow.problem.keep_within(distance, &initial).unwrap_err();
        assert!(matches!(error, Error::Geometry(_)), "{error}");
    }
    let other = Stored::whole(start(Grid::centred(64, 0.75).unwrap()));
    assert!(flow.problem.keep_within(0.1, &other).is_err());
}
