//! Time steps of second order: their order, their estimates, and what is not accepted.

use crate::common::flow::Flow;
use crate::common::{accurate, device, params};
use geometry::measure::l2_distance;
use geometry::shapes::{Ball, Ellipse, Torus};
use geometry::{Field, Grid, NodeSet, SignedDistance, phase_field};
use solver::{Error, FlowParams, NewtonParams, StepRecord};

/// `2^-14`, the time step of the paper's experiments in 2D.
const UNIT: f64 = 6.103_515_625e-5;

/// Accurate enough that errors are those of the time steps.
fn newton() -> NewtonParams {
    NewtonParams {
        tolerance: 1e-4,
        cg_tolerance: 0.01,
        ..NewtonParams::default()
    }
}

fn flow_of<const D: usize>(cells: usize, shape: &impl SignedDistance<D>) -> Flow<D> {
    let grid = Grid::per_unit(cells, 1.0).unwrap();
    let network = accurate(D);
    let params = FlowParams {
        newton: newton(),
        calibration: network.calibration().unwrap().factors,
        ..params(&grid)
    };
    let start = phase_field(grid, shape, params.eps).unwrap();
    Flow::with_network(&network, &start, params, &device()).unwrap()
}

fn ellipse() -> Flow<2> {
    flow_of(64, &Ellipse::new([0.3, 0.2]).unwrap())
}

fn step<const D: usize>(flow: &mut Flow<D>, tau: f64) -> StepRecord {
    flow.advance_second_order(tau).unwrap()
}

/// Distances of runs with 2, 4, 8, ... steps from one with four times as many as the longest of them, from a start whose profile has
/// relaxed.
fn time_errors<const D: usize>(
    flow: &mut Flow<D>,
    time: f64,
    halvings: u32,
    step: impl Fn(&mut Flow<D>, f64),
) -> Vec<f64> {
    for _ in 0..4 {
        step(flow, 0.25 * time);
    }
    let start = flow.state();
    let mut after = |count: u32| -> Field<D> {
        flow.restore(&start);
        for _ in 0..count {
            step(flow, time / f64::from(count));
        }
        flow.field().unwrap()
    };
    let truth = after(8 << halvings);
    let counts = (0..=halvings).map(|k| 2 << k);
    counts
        .map(|count| l2_distance(&after(count), &truth).unwrap())
        .collect()
}

fn mean_order(errors: &[f64]) -> f64 {
    let halvings = (errors.len() - 1) as f64;
    (errors[0] / errors[errors.len() - 1]).log2() / halvings
}

#[test]
fn the_order_is_two_in_the_plane() {
    let second_order = |flow: &mut Flow<2>, tau| {
        step(flow, tau);
    };
    let euler = |flow: &mut Flow<2>, tau| {
        flow.advance(tau).unwrap();
    };
    let errors = time_errors(&mut ellipse(), 16.0 * UNIT, 3, second_order);
    let first_order = time_errors(&mut ellipse(), 16.0 * UNIT, 3, euler);
    let order = mean_order(&errors);
    assert!((order - 2.0).abs() < 0.15, "{order}: {errors:?}");
    let order = mean_order(&first_order);
    assert!((order - 1.0).abs() < 0.15, "{order}: {first_order:?}");
    let pairs = errors.iter().zip(&first_order);
    assert!(
        pairs.clone().all(|(two, one)| 10.0 * two < *one),
        "{errors:?} {first_order:?}"
    );
}

fn errors_in_space(shape: &impl SignedDistance<3>) -> Vec<f64> {
    let mut flow = flow_of(32, shape);
    time_errors(&mut flow, 4.0 * UNIT, 2, |flow, tau| {
        step(flow, tau);
    })
}

#[test]
fn the_order_is_two_in_space() {
    let profile = Ellipse::new([0.3, 0.2]).unwrap();
    let spheroid = |[x, y, z]: [f64; 3]| profile.signed_distance([x.hypot(y), z]);
    let errors = errors_in_space(&spheroid);
    let order = mean_order(&errors);
    assert!((order - 2.0).abs() < 0.15, "{order}: {errors:?}");
}

/// The radius of the tube is 2.4 interface widths: too little for displacements to be exact.
#[test]
fn the_order_is_nearly_two_for_thin_tubes() {
    let errors = errors_in_space(&Torus::new(0.26, 0.15).unwrap());
    let order = mean_order(&errors);
    assert!((order - 2.0).abs() < 0.3, "{order}: {errors:?}");
}

#[test]
fn the_local_error_is_as_estimated() {
    let mut flow = ellipse();
    let tau = 2.0 * UNIT;
    for _ in 0..4 {
        step(&mut flow, tau);
    }
    for _ in 0..3 {
        let before = flow.state();
        for _ in 0..16 {
            step(&mut flow, tau / 16.0);
        }
        let truth = flow.field().unwrap();
        flow.restore(&before);
        let estimates = step(&mut flow, tau).estimates.unwrap();
        let made = flow.field().unwrap();
        // The largest distance between the interfaces: the phase fields differ by the slope times it.
        let slope = |u: f64| (1.0 - u * u) * 0.75 * 32.0;
        let pairs = made.values().iter().zip(truth.values());
        let on = pairs.filter(|(u, _)| u.abs() < 0.5);
        let error = on.fold(0.0, |most: f64, (u, v)| most.max((u - v).abs() / slope(*u)));
        let estimated = estimates.error.unwrap();
        assert!(
            error < 3.0 * estimated && estimated < 10.0 * error,
            "{estimated:e} estimated, {error:e}"
        );
        assert!(estimates.displacement < estimates.motion);
    }
}

/// The metric measures displacements of curved surfaces, too: a disc of 6 interface widths grows by 2 of them in as many steps.
#[test]
fn long_steps_of_small_discs_are_right() {
    let mut flow = flow_of(64, &Ball::<2>::new([0.0, 0.0], 0.2).unwrap());
    for _ in 0..4 {
        step(&mut flow, UNIT);
    }
    let (start, field) = (flow.state(), flow.field().unwrap());
    let mut after = |steps: u32| {
        flow.restore(&start);
        for _ in 0..steps {
            step(&mut flow, 32.0 * UNIT / f64::from(steps));
        }
        flow.field().unwrap()
    };
    let truth = after(64);
    let motion = l2_distance(&truth, &field).unwrap();
    let error = l2_distance(&truth, &after(2)).unwrap();
    assert!(error < 0.004 * motion, "{error:e} of {motion:e}");
}

#[test]
fn the_energy_falls_in_long_steps_too() {
    let mut flow = ellipse();
    for tau in [1.0, 8.0, 64.0, 64.0].map(|steps| steps * UNIT) {
        let record = step(&mut flow, tau);
        assert!(record.energy < record.energy_before, "{record:?}");
    }
}

#[test]
fn a_step_that_is_not_accepted_leaves_no_trace() {
    let (mut flow, mut other) = (ellipse(), ellipse());
    step(&mut flow, UNIT);
    step(&mut other, UNIT);
    let state = flow.state();
    flow.second_order_candidate(4.0 * UNIT).unwrap();
    assert_eq!(flow.state(), state);
    let error = flow.advance_second_order(f64::NAN).unwrap_err();
    assert!(matches!(error, Error::Geometry(_)), "{error}");
    assert_eq!(flow.state(), state);
    step(&mut flow, 2.0 * UNIT);
    step(&mut other, 2.0 * UNIT);
    assert_eq!(flow.state(), other.state());
}

#[test]
fn a_restored_flow_continues_with_the_same_bytes() {
    let (mut whole, mut restored) = (ellipse(), ellipse());
    step(&mut whole, UNIT);
    step(&mut whole, UNIT);
    restored.restore(&whole.state());
    for tau in [UNIT, 2.0 * UNIT] {
        let (one, two) = (step(&mut whole, tau), step(&mut restored, tau));
        assert_eq!(one.newton, two.newton);
        assert_eq!(one.estimates, two.estimates);
    }
    assert_eq!(whole.state(), restored.state());
}

#[test]
fn outside_a_region_nothing_moves() {
    let mut flow = ellipse();
    let grid = *flow.field().unwrap().grid();
    let inside: NodeSet = (0..grid.len()).map(|i| grid.node(i)[0] > 0.1).collect();
    flow.restrict_to(&inside).unwrap();
    let start = flow.field().unwrap();
    for _ in 0..2 {
        let record = step(&mut flow, 4.0 * UNIT);
        assert!(record.energy < record.energy_before);
    }
    let end = flow.field().unwrap();
    let values = start.values().iter().zip(end.values()).zip(inside.iter());
    for ((before, after), moves) in values.clone() {
        assert!(moves || before.to_bits() == after.to_bits());
    }
    assert!(values.clone().any(|((a, b), _)| (a - b).abs() > 0.1));
}
