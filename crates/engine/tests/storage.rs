//! What is stored of a phase field.

use crate::common::{EPS, TAU, case, device, disc, finished, grid, scales};
use crate::resuming::{interrupted, resumed, trajectory};
use engine::{
    Case, Checkpoints, Discretization, Error, Flow, Formulation, Helfrich, Method, Operator, Run,
    Samples, StepRule, Stop, Storage, Store,
};
use geometry::measure::l2_distance;
use geometry::shapes::Ball;
use geometry::{Grid, NodeSet, PhaseField, phase_field};
use model::Networks;
use runs::{Interrupt, RunDirectory};
use serde_json::Value;

/// A small disc, whose bricks are about half of the grid; far from it there is nothing but the pure phase.
fn stored(storage: Storage, radius: f64) -> Case<2> {
    let initial = phase_field(grid(128), &Ball::new([0.0; 2], radius).unwrap(), EPS).unwrap();
    let initial = initial.map(|u| if u.abs() < 1.0 - 1e-7 { u } else { u.signum() });
    let needed = scales().needs(2, 1.0 / 128.0);
    let accurate = Discretization::new(Method::Hybrid, Formulation::Accurate);
    let networks = Networks::default();
    let operator = Operator::new(accurate, &networks, &needed, initial.grid(), &scales());
    let mut operator = operator.unwrap();
    operator.storage = storage;
    Case {
        operator,
        ..case(Flow::Willmore, Method::Hybrid, initial)
    }
}

#[test]
fn bricks_make_the_same_flow_and_another_case() {
    let [dense, bricks] = [Storage::Dense, Storage::Bricks].map(|storage| stored(storage, 0.1));
    assert!(dense.identity(&device())["operator"]["storage"].is_null());
    assert_eq!(bricks.identity(&device())["operator"]["storage"], "bricks");
    let start = dense.initial.field().unwrap();
    let [dense, bricks] = [dense, bricks].map(finished);
    let apart = l2_distance(dense.field(), bricks.field()).unwrap();
    let way = l2_distance(dense.field(), &start).unwrap();
    // The minimizations are no more accurate than this.
    assert!(apart > 0.0 && apart < 3e-3 * way, "{apart:e} of {way:e}");
}

#[test]
fn an_interrupted_run_on_bricks_continues_with_the_same_bytes() {
    let half = (0..grid(128).len()).map(|node| grid(128).node(node)[0] > 0.02);
    let loaded = Helfrich {
        tension: 10.0,
        pressure: -50.0,
        ..Helfrich::default()
    };
    for (region, energy) in [
        (None, loaded),
        (Some(half.collect::<NodeSet>()), Helfrich::default()),
    ] {
        let root = tempfile::tempdir().unwrap();
        let samples = Samples::every(2);
        let case = Case {
            region: region.clone(),
            energy,
            ..stored(Storage::Bricks, 0.1)
        };
        assert!(case.initial.nodes().len() < grid(128).len());
        let reference = trajectory(&case, &root.path().join("whole"), &samples);
        let folder = root.path().join("interrupted");
        interrupted(&case, &folder, &samples, 2);
        let (initial, _) = engine::initial(&RunDirectory::open(&folder).unwrap()).unwrap();
        let same = Case {
            initial,
            ..case.clone()
        };
        assert_eq!(same.identity(&device()), case.identity(&device()));
        let resumed = resumed(&reference, &folder, &samples);
        let (start, end) = (case.initial.field().unwrap(), resumed.field(4).unwrap());
        let stays = |node: usize| region.as_ref().is_some_and(|moves| !moves.contains(node));
        let values = end.values().iter().zip(start.values()).enumerate();
        for (node, (now, start)) in values.filter(|(node, _)| stays(*node)) {
            assert_eq!(now.to_bits(), start.to_bits(), "node {node}");
        }
        // Node by node, too, as files are written.
        let mut run = Run::new(case.clone(), &device()).unwrap();
        run.step().unwrap();
        let now = run.current();
        for (node, value) in run.field().values().iter().enumerate() {
            let there = now.at(start.grid().multi_index(node));
            assert_eq!(there.to_bits(), value.to_bits(), "node {node}");
        }
    }
}

/// Values that its bricks do not store are there before the first step.
#[test]
fn a_run_on_bricks_without_a_step_continues_with_the_same_bytes() {
    let case = Case {
        initial: disc(128, 0.1).into(),
        ..stored(Storage::Bricks, 0.1)
    };
    let root = tempfile::tempdir().unwrap();
    let (folder, every) = (root.path().join("run"), Checkpoints::EverySteps(1));
    let run = Run::new(case.clone(), &device()).unwrap();
    drop(Store::create(&folder, &[], &run, Value::Null, every).unwrap());
    let stored = RunDirectory::open(&folder).unwrap();
    let (_, resumed) = Store::resume(stored, case, &device(), every).unwrap();
    assert_eq!(run.field(), resumed.field());
    let moved = [run, resumed].map(|mut run| run.step().unwrap().unwrap().moved.to_bits());
    assert_eq!(moved[0], moved[1]);
}

#[test]
fn bricks_are_refused_or_left_where_they_cannot_be() {
    let paper = |storage: Storage| {
        let mut case = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
        case.operator.storage = storage;
        case
    };
    let curvature = Case {
        flow: Flow::MeanCurvature,
        ..stored(Storage::Bricks, 0.1)
    };
    for (case, reason) in [
        (paper(Storage::Bricks), "accurate recipe"),
        (curvature, "mean curvature flows need the whole grid"),
    ] {
        let refused = Run::new(case, &device()).err().unwrap();
        assert!(matches!(refused, Error::Solver(_)), "{refused}");
        assert!(refused.to_string().contains(reason), "{refused}");
    }
    let small = Ball::new([0.0; 2], 0.1).unwrap();
    let undivided = Grid::per_unit(128, 104.0 / 128.0).unwrap();
    let undivided = phase_field(undivided, &small, EPS).unwrap();
    let undivided = |storage: Storage| Case {
        initial: undivided.clone().into(),
        ..stored(storage, 0.1)
    };
    for of in [&paper as &dyn Fn(Storage) -> Case<2>, &undivided] {
        let [dense, auto] = [Storage::Dense, Storage::Auto].map(|storage| finished(of(storage)));
        assert_eq!(dense.field(), auto.field());
    }
    let refused = Run::new(undivided(Storage::Bricks), &device());
    let refused = refused.err().unwrap().to_string();
    assert!(refused.contains("104"), "{refused}");
}

/// A step that fails after a checkpoint says why, although it has begun on other bricks.
#[test]
fn a_step_on_bricks_that_fails_is_not_taken_for_a_bad_checkpoint() {
    let mut case = stored(Storage::Bricks, 0.284);
    case.scales.newton.newton_iterations = 3;
    case.steps = StepRule::Doubling(TAU / 16.0).into();
    case.stops = vec![Stop::Steps(12)];
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(case, &device()).unwrap();
    let every = Checkpoints::EverySteps(1);
    let path = folder.path().join("run");
    let mut store = Store::create(&path, &[], &run, Value::Null, every).unwrap();
    let failed = run.advance(Some(&mut store), &mut [], &Interrupt::never());
    let error = failed.unwrap_err();
    assert!(matches!(error, Error::Step { .. }), "{error}");
    assert!(!run.records().is_empty());
}
