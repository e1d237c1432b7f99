//! The same bytes after interruptions, and what cannot be resumed.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::{TAU, case, device, disc, divided, finished, square};
use crate::held::driven;
use engine::{
    Case, Checkpoints, DirectParams, Error, ErrorControl, Event, Flow, Method, Observer, Order,
    Record, Run, Samples, StepRule, Stop, Store, Target, TimeSteps, Trajectory,
};
use runs::{Interrupt, RunDirectory};
use serde_json::Value;
use solver::Cancel;

/// Asks for an end after so many minimizations.
struct After<'a>(usize, &'a Interrupt);

impl Observer<2> for After<'_> {
    fn observe(&mut self, event: &mut Event<'_, 2>) -> Result<(), Error> {
        if event.run.records().len() == self.0 {
            self.1.request();
        }
        Ok(())
    }
}

pub fn trajectory(case: &Case<2>, folder: &Path, samples: &Samples) -> Trajectory<2> {
    Trajectory::of(
        case.clone(),
        &device(),
        folder,
        samples,
        &mut [],
        &Interrupt::never(),
    )
    .unwrap()
    .unwrap()
}

pub fn interrupted(case: &Case<2>, folder: &Path, samples: &Samples, after: usize) {
    let interrupt = Interrupt::never();
    let observers: &mut [&mut dyn Observer<2>] = &mut [&mut After(after, &interrupt)];
    let ended = Trajectory::of(
        case.clone(),
        &device(),
        folder,
        samples,
        observers,
        &interrupt,
    );
    assert!(ended.unwrap().is_none());
}

/// An interrupted run of the same case to its end: its records and its last field are the same.
pub fn resumed(reference: &Trajectory<2>, folder: &Path, samples: &Samples) -> Trajectory<2> {
    let resumed = trajectory(&reference.case, folder, samples);
    assert_eq!(without_seconds(&resumed), without_seconds(reference));
    let last = reference.steps();
    assert_eq!(resumed.field(last).unwrap(), reference.field(last).unwrap());
    resumed
}

fn without_seconds(trajectory: &Trajectory<2>) -> Vec<engine::Record> {
    let mut records = trajectory.records.clone();
    for record in &mut records {
        record.seconds = 0.0;
        if let Some(made) = &mut record.minimization {
            (made.seconds, made.times) = (0.0, solver::PhaseTimes::default());
        }
    }
    records
}

#[test]
fn an_interrupted_run_continues_with_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    let samples = Samples {
        also: vec![1],
        ..Samples::every(2)
    };
    for (flow, method, n) in [
        (Flow::Willmore, Method::Hybrid, 128),
        (Flow::MeanCurvature, Method::FeImplicit, 128),
        // Its steps begin on the half grid.
        (Flow::Willmore, Method::Hybrid, 256),
    ] {
        let folder = |name: &str| root.path().join(format!("{flow:?}{n}{name}"));
        let whole = case(flow, method, disc(n, 0.2));
        let reference = trajectory(&whole, &folder("whole"), &samples);
        let twice = folder("interrupted");
        interrupted(&reference.case, &twice, &samples, 2);
        let resumed = resumed(&reference, &twice, &samples);
        assert_eq!(reference.records.len(), 4);
        assert_eq!(resumed.start, reference.start);
        for step in [0, 1, 2, 4] {
            assert_eq!(resumed.field(step).unwrap(), reference.field(step).unwrap());
        }
        assert!(resumed.field(3).is_err());
        let checkpoint =
            |folder: &Path| std::fs::read(folder.join("checkpoints/step-00000004.ckpt"));
        assert_eq!(
            checkpoint(&twice).unwrap(),
            checkpoint(&folder("whole")).unwrap()
        );
        // Looked up, not computed again: the wall time is that of the first time.
        let again = trajectory(&whole, &twice, &samples);
        assert_eq!(again.seconds().to_bits(), resumed.seconds().to_bits());
        assert_eq!(
            [&reference, &resumed, &again].map(|one| one.is_new),
            [true, false, false]
        );
        assert_eq!(again.distance(4, &reference, 4).unwrap().to_bits(), 0);
        // Wall times are no result: without them all else is there.
        for lost in ["", "[0.1, 0.2"] {
            std::fs::write(twice.join(engine::TIMINGS), lost).unwrap();
            let without = trajectory(&whole, &twice, &samples);
            assert_eq!(without_seconds(&without), without_seconds(&resumed));
            assert!(without.seconds().is_nan());
        }
        let volume = |step: usize| reference.measures(step).unwrap()["volume"];
        assert_eq!(volume(4) > volume(0), flow == Flow::Willmore);
        assert!(reference.measures(5).is_none());
        // Another run does not take these fields for its own.
        let mut other = whole;
        other.stops = vec![Stop::Steps(2)];
        assert_eq!(trajectory(&other, &twice, &samples).records.len(), 2);
    }
}

/// Substeps, what they keep, and becoming stationary: the same after an interruption in the middle of a step.
#[test]
fn a_run_is_interrupted_inside_a_step() {
    let root = tempfile::tempdir().unwrap();
    let mut divided_case = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
    divided_case.steps = divided(TAU, 0.25 * TAU);
    divided_case.stops.push(Stop::Motion(0.55));
    let samples = Samples {
        halvings: vec![1, 2, 3],
        ..Samples::every(2)
    };
    let reference = trajectory(&divided_case, &root.path().join("whole"), &samples);
    let sizes: Vec<f64> = reference.records.iter().map(|r| r.tau / TAU).collect();
    assert_eq!(sizes, [0.25, 0.25, 0.5, 1.0]);
    assert!(matches!(reference.ended, Stop::Motion(_)));
    assert_eq!(reference.steps(), 2);
    assert!((reference.record(2).unwrap().time - 2.0 * TAU).abs() < 1e-15);
    assert_eq!(reference.substeps(1).len(), 3);
    let folder = root.path().join("interrupted");
    interrupted(&divided_case, &folder, &samples, 2);
    for _ in 0..2 {
        let resumed = trajectory(&divided_case, &folder, &samples);
        assert_eq!(without_seconds(&resumed), without_seconds(&reference));
        assert_eq!(resumed.ended, reference.ended);
        for k in [1, 2, 3] {
            let part = resumed.part_field(k).unwrap();
            assert_eq!(part, reference.part_field(k).unwrap());
            // No substep ended at an eighth of the step.
            assert_eq!(part.is_some(), k < 3);
        }
        assert_eq!(resumed.field(2).unwrap(), reference.field(2).unwrap());
    }
}

/// The targets of what is held go on where they were.
#[test]
fn a_driven_run_continues_with_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    let mut case = driven(4, divided(TAU, 0.5 * TAU));
    case.stops = vec![Stop::Steps(3)];
    let samples = Samples::every(1);
    let reference = trajectory(&case, &root.path().join("whole"), &samples);
    let folder = root.path().join("interrupted");
    interrupted(&reference.case, &folder, &samples, 1);
    resumed(&reference, &folder, &samples);
    assert_eq!(reference.steps(), 3);
}

#[test]
fn what_changes_a_result_makes_another_case() {
    let elements = case(Flow::Willmore, Method::FeImplicit, disc(128, 0.2));
    let mut direct = elements.clone();
    direct.operator.linear = fem::LinearSolver::Direct;
    assert_ne!(elements.identity(&device()), direct.identity(&device()));
    let mut curved = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
    curved.energy.spontaneous_curvature = 5.0;
    let mut other = curved.clone();
    other.operator.response = 0.97;
    assert_ne!(curved.identity(&device()), other.identity(&device()));
}

/// Its last step was cut short, or shared what was left with the one before.
#[test]
fn a_run_to_a_time_is_not_extended_to_another() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    let mut to_time = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
    to_time.stops = vec![Stop::Time(0.5 * TAU)];
    let every = Checkpoints::EverySteps(1);
    let mut run = engine::Run::new(to_time.clone(), &device()).unwrap();
    let mut store = Store::create(&folder, &[], &run, Value::Null, every).unwrap();
    let never = Interrupt::never();
    run.advance(Some(&mut store), &mut [], &never).unwrap();
    store.finish(&run).unwrap();
    to_time.stops = vec![Stop::Time(TAU)];
    let stored = RunDirectory::open(&folder).unwrap();
    let (device, notes) = (device(), Value::Null);
    let refused = Store::extend(stored, to_time, &device, every, notes, |_| false);
    let error = refused.err().unwrap().to_string();
    assert!(error.contains("for another end time"), "{error}");
}

#[test]
fn other_files_in_the_folder_of_a_trajectory_stay() {
    let root = tempfile::tempdir().unwrap();
    let own = root.path().join("own.txt");
    std::fs::write(&own, "mine").unwrap();
    let refused = Trajectory::of(
        case(Flow::MeanCurvature, Method::Hybrid, disc(128, 0.2)),
        &device(),
        root.path(),
        &Samples::every(1),
        &mut [],
        &Interrupt::never(),
    );
    assert!(matches!(
        refused,
        Err(Error::Runs(runs::Error::Occupied { .. }))
    ));
    assert_eq!(std::fs::read_to_string(&own).unwrap(), "mine");
}

/// Controlled steps, one of which is refused at first, between marks: the same after an interruption between two of them.
#[test]
fn a_controlled_run_continues_with_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    let mut controlled = case(Flow::Willmore, Method::Hybrid, square(128));
    controlled.steps = TimeSteps {
        order: Order::Controlled(ErrorControl {
            relative: 0.002,
            ..ErrorControl::default()
        }),
        ..StepRule::Ramp {
            tau: 2.0 * TAU,
            halvings: 1,
        }
        .into()
    };
    controlled.stops = vec![Stop::Steps(2)];
    let samples = Samples::every(1);
    let reference = trajectory(&controlled, &root.path().join("whole"), &samples);
    let ends = [1, 2].map(|step| reference.record(step).unwrap().time / TAU);
    assert!((ends[0] - 1.0).abs() < 1e-12 && (ends[1] - 2.0).abs() < 1e-12);
    assert!(reference.substeps(1).len() > 3);
    assert!(
        reference
            .records
            .iter()
            .any(|record| record.refused_hvp > 0.0)
    );
    for after in [2, 5] {
        let folder = root.path().join(after.to_string());
        interrupted(&reference.case, &folder, &samples, after);
        resumed(&reference, &folder, &samples);
        assert_eq!(reference.steps(), 2);
    }
}

/// Direct steps of a region: the distances of both runs are in the checkpoint.
#[test]
fn a_direct_run_continues_with_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    let mut direct = case(Flow::Willmore, Method::Hybrid, square(128));
    let params = DirectParams { longest: 4e-3 };
    direct.steps = TimeSteps::direct(StepRule::ByEnergy(Some(TAU / 8.0)), params);
    let grid = *direct.grid();
    let right = (0..grid.len()).map(|node| grid.node(node)[0] > -0.1);
    direct.region = Some(right.collect());
    let samples = Samples::every(1);
    let reference = trajectory(&direct, &root.path().join("whole"), &samples);
    let made = |record: &Record| record.direct().map(|direct| direct.convolutions);
    assert!(
        reference
            .records
            .iter()
            .all(|record| made(record) >= Some(3))
    );
    let folder = root.path().join("interrupted");
    interrupted(&direct, &folder, &samples, 2);
    resumed(&reference, &folder, &samples);

    let mut controlled = direct.clone();
    controlled.steps.rule = StepRule::Controlled;
    let refused = Run::new(controlled, &device())
        .err()
        .expect("it is refused");
    assert!(matches!(refused, Error::NoEstimates { .. }), "{refused}");
    direct.held.volume = Some(Target::keep(0.2));
    let refused = Run::new(direct, &device()).err().expect("it is refused");
    assert!(refused.to_string().contains("held sizes"), "{refused}");
}

/// A run to its end, each step of which is cancelled at its first question, at one so many later, and so on, until it ends before that; and how often
/// that was.
fn cancelled(case: &Case<2>, every: usize) -> (Run<2>, usize) {
    let mut run = Run::new(case.clone(), &device()).unwrap();
    let (mut all, mut of_step) = (0, 0);
    while run.ended().is_none() {
        let (asked, last) = (AtomicUsize::new(0), every * of_step);
        run.set_cancel(Cancel::when(move || {
            asked.fetch_add(1, Ordering::Relaxed) == last
        }));
        match run.step() {
            Ok(_) => of_step = 0,
            Err(Error::Cancelled { .. }) => (all, of_step) = (all + 1, of_step + 1),
            Err(error) => panic!("{error}"),
        }
    }
    (run, all)
}

#[test]
fn steps_that_are_cancelled_anywhere_are_made_again_with_the_same_bytes() {
    let mut direct = case(Flow::Willmore, Method::Hybrid, square(128));
    direct.steps = TimeSteps::direct(StepRule::ByEnergy(None), DirectParams::default());
    let mut controlled = case(Flow::Willmore, Method::Hybrid, square(128));
    controlled.steps = TimeSteps {
        order: Order::Controlled(ErrorControl::default()),
        ..StepRule::Constant(TAU).into()
    };
    controlled.stops = vec![Stop::Time(0.1 * TAU)];
    let mut held = case(Flow::Willmore, Method::Hybrid, square(128));
    held.steps = StepRule::ByEnergy(None).into();
    held.held.volume = Some(Target::keep(0.16));
    // Its steps begin on the half grid.
    let mut half = case(Flow::Willmore, Method::Hybrid, disc(256, 0.2));
    for case in [&mut direct, &mut held, &mut half] {
        case.stops = vec![Stop::Steps(2)];
    }
    for (case, every) in [(direct, 2), (controlled, 31), (held, 31), (half, 13)] {
        let whole = finished(case.clone());
        let (run, count) = cancelled(&case, every);
        assert!(count > whole.records().len(), "{every}: {count}");
        assert_eq!(run.records().len(), whole.records().len());
        assert_eq!(run.field(), whole.field());
        let sizes = |run: &Run<2>| -> Vec<(f64, u32)> {
            let records = run.records().iter();
            records
                .map(|record| (record.tau, record.halvings))
                .collect()
        };
        assert_eq!(sizes(&run), sizes(&whole));
    }
}

/// The step during which the interruption comes is dropped, and the state before it is kept.
#[test]
fn an_interruption_drops_the_step_that_is_being_made() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    let whole = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
    let reference = finished(whole.clone());
    let interrupt = Interrupt::never();
    interrupt.request();
    let every = Checkpoints::EverySteps(3);
    let mut run = Run::new(whole.clone(), &device()).unwrap();
    let mut store = Store::create(&folder, &[], &run, Value::from("notes"), every).unwrap();
    let ending = run.advance(Some(&mut store), &mut [], &interrupt).unwrap();
    assert_eq!((ending, run.records().len()), (None, 0));
    drop(store);
    let stored = RunDirectory::open(&folder).unwrap();
    let (mut store, mut run) = Store::resume(stored, whole, &device(), every).unwrap();
    run.advance(Some(&mut store), &mut [], &Interrupt::never())
        .unwrap();
    assert_eq!(run.field(), reference.field());
}

/// A region, steps by the energy and an application's notes: from the checkpoint alone.
#[test]
fn a_case_is_built_from_its_checkpoint() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    let mut inpainting = case(Flow::Willmore, Method::Hybrid, square(128));
    inpainting.steps = StepRule::ByEnergy(None).into();
    let grid = *inpainting.grid();
    let corner = |node: usize| grid.node(node).iter().all(|x| *x > 0.1);
    inpainting.region = Some((0..grid.len()).map(corner).collect());
    let reference = finished(inpainting.clone());
    let every = Checkpoints::EverySteps(3);
    let mut run = engine::Run::new(inpainting.clone(), &device()).unwrap();
    let mut store = Store::create(&folder, &[], &run, Value::from("notes"), every).unwrap();
    let interrupt = Interrupt::never();
    let mut first = After(1, &interrupt);
    let ending = run.advance(Some(&mut store), &mut [&mut first], &interrupt);
    let ending = ending.unwrap();
    assert_eq!((ending, run.records().len()), (None, 1));
    drop(store);

    let stored = RunDirectory::open(&folder).unwrap();
    assert_eq!(engine::dimension(&stored).unwrap(), 2);
    assert_eq!(engine::notes(&stored), "notes");
    let (initial, region) = engine::initial::<2>(&stored).unwrap();
    let built = Case {
        initial,
        region,
        ..inpainting.clone()
    };
    let mut wrong = built.clone();
    wrong.scales.newton.tolerance *= 0.5;
    let error = Store::resume(stored, wrong, &device(), every)
        .err()
        .unwrap();
    assert!(error.to_string().contains("scales"), "{error}");
    let stored = RunDirectory::open(&folder).unwrap();
    let (mut store, mut run) = Store::resume(stored, built, &device(), every).unwrap();
    run.advance(Some(&mut store), &mut [], &Interrupt::never())
        .unwrap();
    assert_eq!(run.field(), reference.field());
    let outside = |node: &usize| !corner(*node);
    let start = inpainting.initial.field().unwrap();
    let moved = (0..grid.len())
        .filter(outside)
        .any(|node| run.field().values()[node].to_bits() != start.values()[node].to_bits());
    assert!(!moved);
    store.finish(&run).unwrap();
    assert!(RunDirectory::open(&folder).unwrap().is_finished());
    let table = std::fs::read_to_string(folder.join(engine::METRICS)).unwrap();
    assert_eq!(table.lines().count(), 5);
}
