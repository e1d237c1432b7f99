//! Steps that begin on the half grid.

use crate::common::flow::{Flow, Kept};
use crate::common::{device, network, params};
use geometry::measure::l2_distance;
use geometry::shapes::Cross;
use geometry::{Field, Grid, NodeSet, phase_field};
use model::{Network, Ratios, Shipped};
use solver::{Error, FlowParams, StartKind, StepRecord};

const EPS: f64 = 1.0 / 64.0;
/// Both time steps.
pub const TAU: f64 = 1.0 / 16384.0;

pub fn grid() -> Grid<2> {
    Grid::per_unit(256, 0.75).unwrap()
}

pub fn scales(network: &Network) -> FlowParams {
    FlowParams {
        calibration: network.calibration().unwrap().factors,
        ..FlowParams::paper(EPS, TAU)
    }
}

fn ratios(n: usize, width: usize) -> Ratios {
    let grid = Grid::<2>::per_unit(n, 0.75).unwrap();
    FlowParams::paper(EPS, TAU).ratios(&grid, width)
}

pub fn accurate(n: usize, width: usize) -> Network {
    Shipped::Accurate.find(ratios(n, width)).unwrap()
}

pub fn cross() -> Field<2> {
    phase_field(grid(), &Cross::new(0.27, 0.1).unwrap(), EPS).unwrap()
}

pub fn flow(half: bool) -> Flow<2> {
    let network = accurate(256, 33);
    let mut flow = Flow::with_network(&network, &cross(), scales(&network), &device()).unwrap();
    if half {
        assert_eq!(flow.begin_on_half_grids().unwrap(), 1);
    }
    flow
}

fn steps(flow: &mut Flow<2>, count: usize) -> Vec<StepRecord> {
    (0..count).map(|_| flow.advance(TAU).unwrap()).collect()
}

/// How many grids below the flow's have moved.
fn half_motions(state: &Kept<2>) -> usize {
    let names = state.0.memory.fields.keys();
    names.filter(|name| name.starts_with("half_motion")).count()
}

#[test]
fn the_half_grid_saves_work_and_leaves_the_result() {
    let (mut plain, mut begun) = (flow(false), flow(true));
    let (before, after) = (steps(&mut plain, 6), steps(&mut begun, 6));
    assert!(after.iter().all(|r| r.start.kind == StartKind::HalfGrid));
    assert!(before.iter().all(|r| r.start.kind != StartKind::HalfGrid));
    let work = |records: &[StepRecord]| records.iter().map(StepRecord::hvp).sum::<f64>();
    assert!(
        work(&after) < 0.8 * work(&before),
        "{} of {} products",
        work(&after),
        work(&before)
    );
    assert!(after.iter().all(|r| r.energy < r.energy_before));
    let (plain, begun) = (plain.field().unwrap(), begun.field().unwrap());
    let way = l2_distance(&plain, &cross()).unwrap();
    let difference = l2_distance(&plain, &begun).unwrap() / way;
    assert!(difference < 2e-3, "{difference} of the way");
    assert!(difference > 0.0);
}

#[test]
fn a_restored_flow_continues_with_the_same_bytes() {
    let mut whole = flow(true);
    steps(&mut whole, 3);
    let state = whole.state();
    assert_eq!(half_motions(&state), 1);
    steps(&mut whole, 2);
    let mut resumed = flow(true);
    resumed.restore(&state);
    assert_eq!(resumed.state(), state);
    steps(&mut resumed, 2);
    assert_eq!(whole.field().unwrap(), resumed.field().unwrap());
}

#[test]
fn a_step_that_failed_leaves_no_trace() {
    let mut whole = flow(true);
    steps(&mut whole, 3);
    let state = whole.state();
    let step = |fails: bool| {
        let network = accurate(256, 33);
        let mut params = scales(&network);
        params.newton.newton_iterations = 2;
        let mut flow = Flow::with_network(&network, &cross(), params, &device()).unwrap();
        flow.begin_on_half_grids().unwrap();
        flow.restore(&state);
        if fails {
            let error = flow.advance(64.0 * TAU).unwrap_err();
            assert!(matches!(error, Error::NotConverged { .. }), "{error}");
            assert_eq!(flow.state(), state);
        }
        let record = flow.advance(TAU / 64.0).unwrap();
        assert_eq!(record.start.kind, StartKind::HalfGrid);
        flow.field().unwrap()
    };
    assert_eq!(step(true), step(false));
}

/// Three grids; the middle one gives up on a large step, and then has nothing to say of the lowest.
#[test]
fn a_grid_that_gives_up_in_the_middle_of_a_chain() {
    let on = |n: usize, width: usize, newton_iterations: usize| {
        let network = accurate(n, width);
        let mut params = scales(&network);
        params.newton.newton_iterations = newton_iterations;
        let grid = Grid::<2>::per_unit(n, 0.75).unwrap();
        let start = phase_field(grid, &Cross::new(0.27, 0.1).unwrap(), EPS).unwrap();
        Flow::with_network(&network, &start, params, &device()).unwrap()
    };
    let chain = || {
        let (mut flow, mut middle) = (on(256, 33, 60), on(128, 17, 2));
        middle.begin_on(on(64, 9, 60)).unwrap();
        flow.begin_on(middle).unwrap();
        flow
    };
    let mut flow = chain();
    for _ in 0..3 {
        let record = flow.advance(TAU / 64.0).unwrap();
        assert_eq!(record.start.kind, StartKind::HalfGrid);
    }
    assert_eq!(half_motions(&flow.state()), 2);
    let record = flow.advance(256.0 * TAU).unwrap();
    assert_ne!(record.start.kind, StartKind::HalfGrid, "the middle gave up");
    let state = flow.state();
    assert_eq!(half_motions(&state), 0);
    let mut resumed = chain();
    resumed.restore(&state);
    let [own, other] = [&mut flow, &mut resumed].map(|flow| {
        flow.advance(TAU / 64.0).unwrap();
        flow.field().unwrap()
    });
    assert_eq!(own, other);
}

#[test]
fn a_region_is_held_on_both_grids() {
    let inside: NodeSet = (0..grid().len())
        .map(|node| grid().node(node).iter().all(|x| x.abs() < 0.16))
        .collect();
    let restricted = |region: &NodeSet, region_first: bool| {
        let mut flow = flow(!region_first);
        flow.restrict_to(region).unwrap();
        if region_first {
            flow.begin_on_half_grids().unwrap();
        }
        flow
    };
    for region_first in [true, false] {
        let mut flow = restricted(&inside, region_first);
        let record = flow.advance(TAU).unwrap();
        assert_eq!(record.start.kind, StartKind::HalfGrid);
        let (u, start) = (flow.field().unwrap(), cross());
        let mut moved = 0.0_f64;
        for ((u, start), inside) in u.values().iter().zip(start.values()).zip(inside.iter()) {
            if inside {
                moved = moved.max((u - start).abs());
            } else {
                assert_eq!(u.to_bits(), start.to_bits());
            }
        }
        assert!(moved > 0.1, "{moved}");
    }
    // A region between the nodes of the half grid.
    let column: NodeSet = (0..grid().len())
        .map(|node| grid().multi_index(node)[1] == 129)
        .collect();
    for region_first in [true, false] {
        let mut flow = restricted(&column, region_first);
        assert_eq!(flow.advance(TAU).unwrap().start.kind, StartKind::Rest);
    }
}

#[test]
fn networks_decide_how_far_down_it_goes() {
    let network = network();
    let grid = Grid::<2>::per_unit(128, 0.75).unwrap();
    let start = Field::constant(grid, 1.0);
    let mut flow = Flow::with_network(&network, &start, params(&grid), &device()).unwrap();
    assert_eq!(flow.begin_on_half_grids().unwrap(), 0);
}

/// The calibrated scheme with the network of the paper's recipe: below, an accurate one would have another relaxed profile.
#[test]
fn below_the_odd_part_of_a_network_of_the_papers_is_another() {
    let whole = Shipped::Paper.find(ratios(256, 33)).unwrap();
    let (odd, params) = (whole.odd_part(), scales(&whole));
    let work = |half: bool| -> f64 {
        let mut flow = Flow::with_network(&odd, &cross(), params, &device()).unwrap();
        if half {
            assert_eq!(flow.begin_on_half_grids().unwrap(), 1);
        }
        // The first steps are dear whatever they begin with.
        steps(&mut flow, 20);
        steps(&mut flow, 20).iter().map(StepRecord::hvp).sum()
    };
    let (before, after) = (work(false), work(true));
    assert!(after < 0.9 * before, "{after} of {before} products");
}

#[test]
fn a_flow_that_does_not_fit_below_is_refused() {
    let network = accurate(128, 17);
    let below = |side: f64, eps: f64| {
        let start = Field::constant(Grid::<2>::per_unit(128, side).unwrap(), 1.0);
        let params = FlowParams {
            eps,
            ..scales(&network)
        };
        Flow::with_network(&network, &start, params, &device())
    };
    assert!(flow(false).begin_on(below(0.75, EPS).unwrap()).is_ok());
    let error = flow(false).begin_on(below(1.0, EPS).unwrap()).unwrap_err();
    assert!(matches!(error, Error::Geometry(_)), "{error}");
    assert!(error.to_string().contains("96"), "{error}");
    // As near as the network still fits.
    let error = flow(false)
        .begin_on(below(0.75, EPS * (1.0 + 1e-13)).unwrap())
        .unwrap_err();
    assert!(
        error.to_string().contains("eps of the half grid"),
        "{error}"
    );
}
