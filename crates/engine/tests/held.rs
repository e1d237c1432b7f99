//! Sizes that are driven to targets.

use crate::common::{EPS, TAU, case, device, finished, grid};
use engine::{
    Case, ErrorControl, Flow, Held, Measure, Method, Run, StepRule, Stop, Target, TimeSteps,
};
use geometry::zero_set::reduced_volume;
use geometry::{Field, ZeroSet, phase_field, shapes::Ellipse};

fn ellipse() -> Field<2> {
    phase_field(grid(128), &Ellipse::new([0.25, 0.17]).unwrap(), EPS).unwrap()
}

/// The area goes to that of the reduced volume .85 over so many steps.
pub fn driven(over: usize, steps: impl Into<TimeSteps>) -> Case<2> {
    let mut case = case(Flow::Willmore, Method::Hybrid, ellipse());
    case.held = Held::at_reduced_volume(&case.initial, EPS, 0.85, over).unwrap();
    case.measures = vec![Measure::zero_set(EPS, &case.held)];
    case.steps = steps.into();
    case
}

fn reduced(u: &Field<2>) -> f64 {
    let zero_set = ZeroSet::of(u, EPS).unwrap();
    reduced_volume(2, zero_set.perimeter, zero_set.volume)
}

/// The area goes evenly to its target, in steps that grow, and the run ends at rest only after that.
#[test]
fn a_reduced_volume_is_reached_and_then_the_shape_rests() {
    for steps in [
        StepRule::Growing { tau: TAU, alike: 8 }.into(),
        TimeSteps::controlled(ErrorControl::default()),
    ] {
        let mut case = driven(8, steps);
        case.stops = vec![Stop::EnergyAtRest, Stop::Steps(60)];
        let run = finished(case);
        let held = run.case().held;
        let areas: Vec<f64> = (run.records().iter())
            .map(|record| record.measure("area").unwrap())
            .collect();
        assert!((areas[1] / held.at(2.0).volume.unwrap() - 1.0).abs() < 1e-9);
        assert!(areas.windows(2).all(|pair| pair[1] < pair[0] + 1e-9));
        let last = run.records().last().unwrap();
        let measured = |name: &str| last.measure(name).unwrap();
        assert!((reduced(run.field()) - 0.85).abs() < 1e-9);
        assert!((measured("area") / held.targets().volume.unwrap() - 1.0).abs() < 1e-9);
        assert!((measured("reduced_volume") - 0.85).abs() < 1e-9);
        assert_eq!(run.ended(), Some(Stop::EnergyAtRest));
        // A closed curve turns once.
        let turned = measured("integrated_mean_curvature");
        assert!(
            (turned / std::f64::consts::TAU - 1.0).abs() < 2e-3,
            "{turned}"
        );
    }
}

/// The area is to become a hundredth at once, which no step can do: a part of it is made.
#[test]
fn a_step_that_cannot_hold_its_target_is_halved_with_it() {
    let mut case = driven(1, StepRule::Constant(TAU));
    let area = case.held.volume.unwrap().from;
    case.held = Held {
        perimeter: None,
        volume: Some(Target {
            from: area,
            to: 0.01 * area,
            over: 1,
        }),
    };
    case.stops = vec![Stop::Steps(1)];
    let run = finished(case);
    let first = &run.records()[0];
    assert!(first.halvings > 0, "{first:?}");
    let part = 0.5_f64.powi(first.halvings as i32);
    assert!((first.tau / TAU - part).abs() < 1e-12);
    let expected = run.case().held.at(part).volume.unwrap();
    let found = first.measure("area").unwrap();
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

/// At both ends there are shapes with these sizes, but not half-way.
#[test]
fn targets_that_no_shape_has_on_the_way_are_refused() {
    let u = ellipse();
    let sizes = ZeroSet::of(&u, EPS).unwrap();
    let driven = |from: f64, factor: f64| {
        Some(Target {
            from,
            to: factor * from,
            over: 10,
        })
    };
    let held = Held {
        perimeter: driven(sizes.perimeter, 2.0),
        volume: driven(sizes.volume, 3.9),
    };
    let case = Case {
        held,
        ..case(Flow::Willmore, Method::Hybrid, u)
    };
    let refused = Run::new(case, &device()).err().unwrap();
    let source = std::error::Error::source(&refused).map(ToString::to_string);
    assert!(
        format!("{refused} {source:?}").contains("length"),
        "{refused}"
    );
}

/// A bound on the way of the interface is a part of the case, and stops what would go on.
#[test]
fn an_interface_goes_no_farther_than_its_bound() {
    let free = driven(0, StepRule::Constant(TAU));
    let free = Case {
        held: Held::default(),
        ..free
    };
    let length = 0.3 * grid(128).spacing();
    let bound = Case {
        max_distance: Some(length),
        ..free.clone()
    };
    assert!(free.identity(&device())["max_distance"].is_null());
    assert_eq!(bound.identity(&device())["max_distance"], length);
    let start = free.initial.field().unwrap();
    let farthest = |case: Case<2>| {
        let u = finished(case).field().clone();
        let gone = |(u, start): (&f64, &f64)| {
            let depth = |u| geometry::distance_from_phase_field(u, EPS);
            if start.abs() < 0.6 {
                (depth(*u) - depth(*start)).abs()
            } else {
                0.0
            }
        };
        let pairs = u.values().iter().zip(start.values());
        pairs.map(gone).fold(0.0, f64::max)
    };
    let [free, bound] = [free, bound].map(farthest);
    assert!(
        bound < 1.01 * length && free > 1.5 * length,
        "{bound} {free} {length}"
    );
}
