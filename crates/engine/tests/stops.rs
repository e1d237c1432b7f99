//! Every reason to end.

use crate::common::{EPS, TAU, case, device, disc, divided, finished, grid};
use engine::{
    Case, Flow, Formulation, Measure, Method, Operator, Record, Run, Scales, StepRule, Stop,
};
use geometry::{Field, Grid, optimal_profile};
use model::Networks;
use runs::Interrupt;

#[test]
fn energies_and_vanishing_end_a_run() {
    let mut one = case(Flow::Willmore, Method::Hybrid, disc(128, 0.15));
    let exact = std::f64::consts::PI / 0.15;
    one.stops = vec![Stop::Steps(50), Stop::Energy(0.99 * exact)];
    let run = finished(one);
    assert_eq!(run.ended(), Some(Stop::Energy(0.99 * exact)));
    let energies: Vec<f64> = run
        .records()
        .iter()
        .filter_map(Record::willmore_energy)
        .collect();
    assert!(energies.len() < 50);
    let (last, before) = energies.split_last().unwrap();
    assert!(*last <= 0.99 * exact && before.iter().all(|w| *w > 0.99 * exact));

    let mut small = case(Flow::MeanCurvature, Method::Hybrid, disc(128, 0.03));
    small.stops = vec![Stop::Steps(50), Stop::Vanished];
    let run = finished(small);
    assert_eq!(run.ended(), Some(Stop::Vanished));
    assert!(run.steps() < 20);
}

#[test]
fn a_shape_that_comes_to_the_side_ends_a_run_unless_it_was_there_before() {
    let mut growing = case(Flow::Willmore, Method::Hybrid, disc(128, 0.32));
    growing.steps = StepRule::ByEnergy(Some(16.0 * TAU)).into();
    growing.stops = vec![Stop::Steps(40), Stop::AtTheSide];
    let run = finished(growing.clone());
    assert_eq!(run.ended(), Some(Stop::AtTheSide));
    let band = |x: [f64; 2]| x[1].abs() - 0.1;
    growing.initial = Field::from_fn(grid(128), |x| optimal_profile(band(x), EPS)).into();
    growing.stops = vec![Stop::Steps(1), Stop::AtTheSide];
    assert_eq!(finished(growing).ended(), Some(Stop::Steps(1)));
}

/// In the periodic box a closed surface that goes through it may have as little energy as a cylinder, `pi / R` for a length of 1.
#[test]
fn a_surface_through_the_box_may_have_little_energy() {
    let grid = Grid::<3>::per_unit(32, 1.0).unwrap();
    let scales = Scales::of_grid(grid.spacing(), 2.0);
    let cylinder = |[x, y, _]: [f64; 3]| optimal_profile(x.hypot(y) - 0.3, scales.eps);
    let needed = scales.needs(3, grid.spacing());
    let network = Networks::default().find(Formulation::Accurate.shipped(), &needed);
    let operator = Operator::learned(Formulation::Accurate, network.unwrap()).unwrap();
    let initial = Field::from_fn(grid, cylinder);
    let steps = StepRule::Constant(1e-7);
    let mut case = Case::willmore("cylinder", initial, operator, scales, steps, 1);
    case.stops.insert(0, Stop::NoSurface);
    let mut run = Run::new(case, &device()).unwrap();
    run.advance(None, &mut [], &Interrupt::never()).unwrap();
    let energy = run.records()[0].willmore_energy().unwrap();
    assert!(
        (energy * 0.3 / std::f64::consts::PI - 1.0).abs() < 0.1,
        "{energy}"
    );
    assert_eq!(run.ended(), Some(Stop::Steps(1)));
}

/// A disc in a box hardly moves once it is alone with large steps.
#[test]
fn stationary_shapes_end_a_run() {
    let mut slow = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
    slow.steps = divided(TAU, 0.25 * TAU);
    slow.stops = vec![Stop::Steps(4), Stop::Motion(0.55)];
    let run = finished(slow);
    assert_eq!(run.ended(), Some(Stop::Motion(0.55)));
    let sizes: Vec<f64> = run.records().iter().map(|r| r.tau / TAU).collect();
    assert_eq!(sizes, [0.25, 0.25, 0.5, 1.0]);
}

#[test]
fn a_flat_interface_is_at_rest() {
    let mut flat = case(Flow::Willmore, Method::Hybrid, disc(128, 0.2));
    let band = |x: [f64; 2]| x[1].abs() - 0.15;
    flat.initial = Field::from_fn(grid(128), |x| optimal_profile(band(x), EPS)).into();
    let largest = 0.75_f64.powi(4) / 1024.0;
    flat.steps = StepRule::ByEnergy(Some(largest)).into();
    flat.stops = vec![Stop::Steps(12), Stop::EnergyAtRest];
    let run = finished(flat);
    assert_eq!(run.ended(), Some(Stop::EnergyAtRest));
}

/// A disc whose radius grows has gone by that.
#[test]
fn how_far_the_zero_set_has_gone_is_measured() {
    let measure = Measure::displacement(&disc(128, 0.2), EPS);
    for (radius, gone) in [(0.2, 0.0), (0.203, 0.003), (0.19, 0.01)] {
        let mut other = case(Flow::Willmore, Method::Hybrid, disc(128, radius));
        other.measures = vec![measure.clone()];
        let run = Run::new(other, &device()).unwrap();
        let value = run.start()[engine::DISPLACEMENT];
        assert!((value - gone).abs() < 1e-6, "{value} {gone}");
    }
    let mut growing = case(Flow::Willmore, Method::Hybrid, disc(128, 0.15));
    growing.measures = vec![Measure::displacement(&growing.initial, EPS)];
    growing.stops = vec![Stop::Steps(50), Stop::Displacement(0.01)];
    let run = finished(growing);
    assert_eq!(run.ended(), Some(Stop::Displacement(0.01)));
}

#[test]
fn a_measure_that_is_not_finite_stops_a_run() {
    let mut one = case(Flow::MeanCurvature, Method::Hybrid, disc(128, 0.2));
    let ratio = |_: &engine::Current<'_, 2>, t: f64| Ok(Some(if t > 0.0 { f64::NAN } else { 1.0 }));
    one.measures.push(Measure::new("ratio", ratio));
    let mut run = Run::new(one, &device()).unwrap();
    let found = run.step().unwrap_err().to_string();
    assert!(
        found.starts_with("the measure ratio is NaN at t = "),
        "{found}"
    );
    // The run is where it was, and would make the same step again.
    assert!(run.records().is_empty() && run.steps() == 0);
    let again = run.step().unwrap_err().to_string();
    assert_eq!(again, found);
}
