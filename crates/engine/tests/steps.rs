//! Sizes of steps, and what is done where a minimization fails.

use crate::common::{EPS, TAU, case, device, disc, divided, finished, square};
use engine::{
    Case, Error, ErrorControl, Flow, Method, Record, Run, StepRule, Stop, TimeSteps,
    estimated_time_error,
};

/// With three Newton steps a whole step of a square's flow is too much, substeps are not.
#[test]
fn a_step_that_is_too_large_is_made_in_substeps() {
    let mut whole = case(Flow::Willmore, Method::Hybrid, square(128));
    whole.scales.newton.newton_iterations = 3;
    let tau = 16.0 * TAU;
    whole.steps = StepRule::Constant(tau).into();
    whole.stops = vec![Stop::Steps(1)];
    let mut run = Run::new(whole.clone(), &device()).unwrap();
    let error = run.step().unwrap_err();
    assert!(matches!(error, Error::Step { .. }), "{error}");
    assert_eq!((run.steps(), run.records().len()), (0, 0));

    whole.steps = divided(tau, tau);
    let run = finished(whole);
    let records = run.records();
    assert!(records.len() > 2 && records[0].tau < tau && records[0].halvings > 0);
    let sum: f64 = records.iter().map(|r| r.tau).sum();
    assert_eq!(sum.to_bits(), tau.to_bits());
    assert!((run.time() - tau).abs() < 1e-15);
    let falls = |record: &Record| {
        record
            .minimization
            .is_some_and(|m| m.energy < m.energy_before)
    };
    assert!(records.iter().all(falls));
    let ends: Vec<bool> = records.iter().map(|r| r.completes_step).collect();
    assert!(ends[ends.len() - 1] && ends[..ends.len() - 1].iter().all(|end| !end));
}

/// A disc grows by a quarter of the interface width in a whole step. What the next step would be refused for is known from how far the last one
/// went.
#[test]
fn a_step_that_moves_the_interface_too_far_is_halved() {
    let mut one = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
    one.steps = TimeSteps {
        longest_move: Some(0.04),
        ..StepRule::Constant(TAU).into()
    };
    one.stops = vec![Stop::Steps(3)];
    let run = finished(one);
    let records = run.records();
    assert!(records[0].halvings == 3 && records[0].refused_hvp > 0.0);
    let after_far = records.windows(2).filter(|pair| pair[0].far);
    assert!(after_far.clone().count() > 0);
    for pair in after_far {
        assert!(pair[1].refused_hvp == 0.0 || pair[1].tau < pair[0].tau);
    }
}

/// A minimization that fails at every size ends the run with the last size that was tried.
#[test]
fn halving_gives_up_with_the_size_and_the_step() {
    let mut hopeless = case(Flow::Willmore, Method::Hybrid, square(128));
    hopeless.scales.newton.newton_iterations = 1;
    hopeless.scales.newton.tolerance = 1e-9;
    hopeless.steps = StepRule::ByEnergy(Some(TAU)).into();
    let mut run = Run::new(hopeless, &device()).unwrap();
    let error = run.step().unwrap_err();
    let message = error.to_string();
    let Error::TooStiff {
        step: 1,
        tau,
        halvings: 24,
        ..
    } = error
    else {
        panic!("{message}");
    };
    assert!(
        (tau / TAU * 2.0_f64.powi(24) - 1.0).abs() < 1e-12,
        "{message}"
    );
    assert!(message.contains("Willmore flow of the shape") && message.contains("step 1"));
}

#[test]
fn steps_by_the_energy_grow_and_end_at_the_time() {
    let mut growing = case(Flow::Willmore, Method::Hybrid, square(128));
    growing.steps = StepRule::ByEnergy(None).into();
    let end = 5.5 * TAU;
    growing.stops = vec![Stop::Steps(100), Stop::Time(end)];
    let run = finished(growing);
    assert_eq!(run.ended(), Some(Stop::Time(end)));
    assert!((run.time() - end).abs() <= 1e-12 * end);
    let sizes: Vec<f64> = run.records().iter().map(|r| r.tau).collect();
    assert!((sizes[0] - TAU / 16.0).abs() < 1e-18);
    assert!(sizes.iter().any(|size| *size > 4.0 * sizes[0]), "{sizes:?}");
}

/// Substeps end at multiples of the smallest one, below which none is halved.
#[test]
fn substeps_that_move_the_interface_too_far_have_a_smallest_size() {
    let mut case = case(Flow::Willmore, Method::Hybrid, square(128));
    case.steps = divided(TAU, TAU / 64.0);
    case.steps.longest_move = Some(1e-9);
    let mut run = Run::new(case, &device()).unwrap();
    let sizes = [1, 2].map(|_| run.step().unwrap().unwrap().tau / TAU);
    assert_eq!(sizes.map(f64::to_bits), [0.5_f64.powi(18).to_bits(); 2]);
}

/// A finished run of a square, in steps as long as this control allows.
fn controlled(control: ErrorControl) -> Run<2> {
    let mut case = case(Flow::Willmore, Method::Hybrid, square(128));
    case.scales.newton.tolerance = 1e-3;
    case.steps = TimeSteps::controlled(control);
    case.stops = vec![Stop::Time(4.0 * TAU)];
    finished(case)
}

/// A tension that is too much for a disc draws it together until nothing is left, by and by.
#[test]
fn a_shape_does_not_vanish_in_one_controlled_step() {
    let mut case = case(Flow::Willmore, Method::Hybrid, disc(128, 0.15));
    case.energy.tension = 2000.0;
    case.steps = TimeSteps::controlled(ErrorControl {
        first: Some(0.25 * TAU),
        ..ErrorControl::default()
    });
    case.stops = vec![Stop::Vanished, Stop::Steps(40)];
    let run = finished(case);
    assert_eq!(run.ended(), Some(Stop::Vanished));
    let areas = run.records().iter().map(|record| record.measures["volume"]);
    let last = areas.rev().find(|area| *area > 0.0).unwrap();
    assert!(last < 0.05 * run.start()["volume"], "{last}");
}

/// A square from its corners on: steps grow, none moves the interface too far, the energy falls, and the result is that of ten times stricter
/// control within the estimated error.
#[test]
fn controlled_steps_are_as_accurate_as_they_say() {
    let run = |relative, longest| {
        controlled(ErrorControl {
            relative,
            longest,
            ..ErrorControl::default()
        })
    };
    // The first step, whose error has no estimate, is the same in both.
    let (usual, strict) = (run(0.02, 1.0), run(0.002, 0.5));
    let steps = |run: &Run<2>| -> Vec<_> {
        let made = run.records().iter().map(|r| r.minimization.unwrap());
        made.collect()
    };
    let made = steps(&usual);
    assert!((made[0].tau - 16.0 * EPS.powi(4)).abs() < 1e-18);
    assert!((usual.time() - 4.0 * TAU).abs() < 1e-15);
    assert!(usual.records().iter().all(|record| record.completes_step));
    let longest = made.iter().map(|step| step.tau).fold(0.0, f64::max);
    assert!(longest > 8.0 * made[0].tau && steps(&strict).len() > made.len());
    for step in &made[1..] {
        assert!(step.energy < step.energy_before, "{step:?}");
        assert!(step.estimates.unwrap().displacement < 1.7 * EPS, "{step:?}");
    }
    let estimated = estimated_time_error(usual.records()).unwrap();
    let crossing = |run: &Run<2>| {
        let last = run.records().last().unwrap();
        [last.measures["tip"], last.measures["diagonal"]]
    };
    let pairs = crossing(&usual).into_iter().zip(crossing(&strict));
    let error = pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    assert!(
        error < 3.0 * estimated && estimated < 10.0 * error,
        "{estimated:e} estimated, {error:e}"
    );
}

#[test]
fn a_time_error_that_is_given_is_kept() {
    let steps = [3e-4, 3e-5].map(|length| {
        let run = controlled(ErrorControl {
            length: Some(length),
            ..ErrorControl::default()
        });
        let estimated = estimated_time_error(run.records()).unwrap();
        assert!(estimated < 1.5 * length, "{estimated:e} of {length:e}");
        run.records().len()
    });
    assert!(steps[1] > steps[0], "{steps:?}");
}

#[test]
fn the_earliest_time_ends_a_run_in_substeps() {
    let case = Case {
        steps: divided(TAU, TAU / 4.0),
        stops: [2.5, 1.25].map(|steps| Stop::Time(steps * TAU)).to_vec(),
        ..case(Flow::Willmore, Method::Hybrid, disc(128, 0.2))
    };
    let run = finished(case);
    assert_eq!(run.ended(), Some(Stop::Time(1.25 * TAU)));
    assert!((run.time() / (1.25 * TAU) - 1.0).abs() < 1e-12);
    let controlled = TimeSteps::from(StepRule::Controlled);
    assert!(controlled == TimeSteps::controlled(ErrorControl::default()));
}

#[test]
fn mean_curvature_flow_takes_its_own_step_alone() {
    let mut other = case(Flow::MeanCurvature, Method::Hybrid, disc(128, 0.2));
    let run = finished(other.clone());
    assert_eq!(run.records().len(), 4);
    assert_eq!(run.time().to_bits(), (4.0 * TAU).to_bits());
    let radius = run.records()[3].measure("tip").unwrap();
    assert!(
        (radius - (0.04 - 8.0 * TAU).sqrt()).abs() < 2e-4,
        "{radius}"
    );
    other.steps = StepRule::Constant(2.0 * TAU).into();
    let error = Run::new(other, &device()).err().unwrap();
    assert!(
        matches!(
            error,
            Error::Geometry(geometry::Error::InvalidParameter { name: "tau", .. })
        ),
        "{error}"
    );
}
