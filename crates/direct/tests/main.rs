//! Direct steps against exact flows.

use direct::{Direct, DirectParams};
use geometry::exact::willmore_radius;
use geometry::{
    DistanceRange, Field, Grid, NodeSet, Redistanced, SignedDistance, distances_from_phase_field,
    phase_field,
};
use model::{MeanCurvatureOperator, Shipped};
use operators::ComputeDevice;
use reference::{Shape, planar, revolution};
use solver::{Error, FlowParams, Held, Problem, State, Stepper, Target};

/// The time unit of the paper.
const UNIT: f64 = 1.0 / 16384.0;

fn problem<const D: usize>(grid: Grid<D>) -> Problem<D> {
    let device = ComputeDevice::default_compiled().unwrap();
    let params = FlowParams::paper(2.0 * grid.spacing(), grid.spacing().powi(2));
    let network = Shipped::Paper.find(params.ratios(&grid, 17)).unwrap();
    let operator = MeanCurvatureOperator::new(&network, &device).unwrap();
    Problem::new(operator, &grid, params, &device).unwrap()
}

/// A flow by direct steps from a shape.
fn flow<const D: usize>(
    cells: usize,
    side: f64,
    shape: &impl SignedDistance<D>,
    longest: f64,
) -> Stepper<D, Direct<D>> {
    let problem = problem(Grid::per_unit(cells, side).unwrap());
    let initial = phase_field(problem.grid, shape, problem.params.eps).unwrap();
    let start = problem.start(&initial).unwrap();
    Stepper::by(
        Direct::with(DirectParams { longest }).unwrap(),
        problem,
        start,
    )
}

/// Points of the zero level.
fn level<const D: usize>(u: &Field<D>, eps: f64) -> Vec<[f64; D]> {
    let distances = distances_from_phase_field(u, eps).unwrap().into_values();
    let range = DistanceRange {
        precise: 0.0,
        largest: eps,
    };
    let made = Redistanced::from_distances(*u.grid(), &distances, range);
    made.points.iter().map(|point| point.position).collect()
}

fn radii<const D: usize>(flow: &Stepper<D, Direct<D>>) -> Vec<f64> {
    let points = level(&flow.field().unwrap(), flow.problem.params.eps).into_iter();
    points
        .map(|x| x.iter().map(|x| x * x).sum::<f64>().sqrt())
        .collect()
}

/// The largest error of the radius of a circle.
fn circle_error(longest: f64) -> f64 {
    let circle = |[x, y]: [f64; 2]| x.hypot(y) - 0.25;
    let mut flow = flow(96, 1.25, &circle, longest);
    flow.step(8.0 * UNIT).unwrap();
    let exact = willmore_radius(0.25, 8.0 * UNIT, 2);
    radii(&flow)
        .iter()
        .map(|radius| (radius - exact).abs())
        .fold(0.0, f64::max)
}

#[test]
fn circles_grow_with_an_error_of_second_order() {
    let errors = [2e-3, 1e-3, 5e-4].map(circle_error);
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.7..3.0).contains(&order), "{order} {errors:?}");
    }
    assert!(errors[1] < 2e-4, "{errors:?}");
}

#[test]
fn spheres_stay_at_rest() {
    let ball = |[x, y, z]: [f64; 3]| x.hypot(y).hypot(z) - 0.3;
    let mut flow = flow(32, 1.25, &ball, 1e-3);
    flow.step(4.0 * UNIT).unwrap();
    let drift = radii(&flow)
        .iter()
        .map(|radius| (radius - 0.3).abs())
        .fold(0.0, f64::max);
    assert!(drift < 1e-4 * 0.3, "{drift}");
}

#[test]
fn an_ellipse_follows_the_exact_flow_and_its_energy() {
    let shape = Shape::ellipse(0.3, 0.2).unwrap();
    let times = [1e-9, 4.0 * UNIT];
    let exact =
        planar::evolve(&shape, reference::Flow::Willmore, &times, &planar::ACCURACY).unwrap();
    let mut flow = flow(64, 1.5, &exact[0].signed_distance(), 2e-3);
    let step = flow.step(times[1] - times[0]).unwrap();
    let direct = step.direct.unwrap();
    assert!(direct.convolutions < 500 && direct.convolutions == 3 * direct.parts);
    let points = level(&flow.field().unwrap(), flow.problem.params.eps);
    let distance = exact[1].largest_distance_of(&points);
    // The runs are farther apart than their extrapolation is from the truth.
    assert!(
        distance < 1e-4 && direct.run_distance > distance,
        "{distance} {direct:?}"
    );
    assert!((step.willmore_energy / exact[1].energy() - 1.0).abs() < 1e-3);
    assert!(step.energy < step.energy_before);
}

#[test]
fn an_ellipsoid_follows_the_exact_flow_of_its_surface() {
    let shape = Shape::ellipse(0.3, 0.2).unwrap();
    let times = [1e-9, 4.0 * UNIT];
    let accuracy = &revolution::ACCURACY;
    let exact = revolution::evolve(&shape, reference::Flow::Willmore, &times, accuracy).unwrap();
    let profile = exact[0].profile().signed_distance();
    let body = move |[x, y, z]: [f64; 3]| profile([x.hypot(y), z]);
    let mut flow = flow(32, 1.25, &body, 1e-3);
    let step = flow.step(times[1] - times[0]).unwrap();
    let points = level(&flow.field().unwrap(), flow.problem.params.eps).into_iter();
    let points: Vec<[f64; 2]> = points.map(|[x, y, z]| [x.hypot(y), z]).collect();
    let distance = exact[1].profile().largest_distance_of(&points);
    assert!(distance < 0.05 / 32.0, "{distance}");
    assert!((step.willmore_energy / exact[1].energy() - 1.0).abs() < 2e-3);
}

#[test]
fn steps_go_on_from_their_state_with_the_same_bytes() {
    let ellipse = |[x, y]: [f64; 2]| (0.7 * x).hypot(y) - 0.2;
    let mut through = flow(32, 1.25, &ellipse, 1e-3);
    through.step(UNIT).unwrap();
    let state: State<2> = through.state.clone();
    through.step(0.5 * UNIT).unwrap();
    let mut again = Stepper::by(Direct::new(), problem(*state.field.nodes().grid()), state);
    again.step(0.5 * UNIT).unwrap();
    assert_eq!(through.field().unwrap(), again.field().unwrap());
}

#[test]
fn outside_of_a_region_nothing_moves() {
    let ellipse = |[x, y]: [f64; 2]| (0.7 * x).hypot(y) - 0.2;
    let mut flow = flow(32, 1.25, &ellipse, 1e-3);
    let before = flow.field().unwrap();
    let right: NodeSet = (0..before.grid().len())
        .map(|i| before.grid().node(i)[0] > 0.0)
        .collect();
    flow.problem.restrict_to(&right).unwrap();
    flow.step(2.0 * UNIT).unwrap();
    let after = flow.field().unwrap();
    let mut moved = 0.0_f64;
    for (free, (a, b)) in right.iter().zip(before.values().iter().zip(after.values())) {
        if free {
            moved = moved.max((a - b).abs());
        } else {
            assert_eq!(a.to_bits(), b.to_bits());
        }
    }
    assert!(moved > 0.01, "{moved}");
}

#[test]
fn what_direct_steps_cannot_do_is_refused() {
    let disc = |[x, y]: [f64; 2]| x.hypot(y) - 0.3;
    let mut flow = flow(32, 1.25, &disc, 1e-3);
    let held = Held {
        volume: Some(Target::keep(0.28)),
        ..Held::default()
    };
    flow.problem.hold(held).unwrap();
    let refused = flow.step(UNIT).unwrap_err();
    assert!(
        matches!(refused, Error::NotDirect { what: "held sizes" }),
        "{refused}"
    );
    assert!(Direct::<2>::with(DirectParams { longest: 0.0 }).is_err());
}
