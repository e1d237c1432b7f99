//! What parts of one's own get from the loop: bricks, control of the steps, held sizes, and resuming to the same bytes.

use std::path::Path;
use std::sync::OnceLock;

use willmore::prelude::*;

use crate::examples::own_energy::Gravity;
use crate::examples::own_scheme::StepDoubling;
use crate::examples::{own_network, own_operator};

/// Minimizations so accurate that only what is compared makes a difference.
fn exact_newton() -> NewtonParams {
    NewtonParams {
        tolerance: 1e-7,
        cg_tolerance: 1e-4,
        ..NewtonParams::default()
    }
}

fn grid() -> Grid<2> {
    Grid::per_unit(64, 2.0).unwrap()
}

fn egg() -> Ellipse {
    Ellipse::new([0.3, 0.2]).unwrap()
}

fn heavy() -> Willmore<2> {
    Willmore::on(grid()).with(Gravity { g: 300.0 })
}

fn doubling() -> Willmore<2> {
    Willmore::on(grid()).scheme(StepDoubling::default)
}

fn allen_cahn() -> Willmore<2> {
    own_operator::flow().unwrap()
}

/// Its network is trained once.
fn residual() -> Willmore<2> {
    static FLOW: OnceLock<Willmore<2>> = OnceLock::new();
    FLOW.get_or_init(|| own_network::flow().unwrap()).clone()
}

/// The difference of both ways of storing after two steps, over the motion.
fn difference(flow: impl Fn() -> Willmore<2>, steps: impl Into<TimeSteps>) -> f64 {
    let steps = steps.into();
    let [dense, bricks] = [Storage::Dense, Storage::Bricks].map(|storage| {
        let flow = flow().storage(storage).steps(steps).newton(exact_newton());
        let mut flow = flow.start(&egg()).unwrap();
        for record in flow.take(2) {
            record.unwrap();
        }
        assert_eq!(
            flow.stored_cells() < grid().len(),
            storage == Storage::Bricks
        );
        flow
    });
    let start = dense.case().initial.field().unwrap();
    let way = l2_distance(dense.field(), &start).unwrap();
    l2_distance(dense.field(), bricks.field()).unwrap() / way
}

/// In such a step the motion is much more than what bricks cut off.
const TAU: f64 = 1.0 / 16384.0;

#[test]
fn on_bricks_an_own_term_is_that_of_the_whole_grid() {
    let equal = StepRule::Constant(TAU);
    let second = TimeSteps {
        order: Order::Second,
        ..equal.into()
    };
    for steps in [equal.into(), second] {
        let apart = difference(heavy, steps);
        assert!(apart > 0.0 && apart < 1e-5, "{apart:e}");
    }
}

#[test]
fn on_bricks_an_own_scheme_is_that_of_the_whole_grid() {
    let apart = difference(doubling, StepRule::Constant(TAU));
    assert!(apart > 0.0 && apart < 1e-5, "{apart:e}");
}

#[test]
fn steps_of_own_parts_are_controlled_by_their_errors() {
    for flow in [heavy(), doubling(), allen_cahn(), residual()] {
        let mut flow = flow.start(&egg()).unwrap();
        let records: Vec<Record> = flow.take(6).map(Result::unwrap).collect();
        let error = |record: &Record| record.minimization.unwrap().estimates.unwrap().error;
        assert!(records.iter().any(|record| error(record).is_some()));
        let sizes: Vec<f64> = records.iter().map(|record| record.tau).collect();
        assert!(
            sizes
                .windows(2)
                .any(|pair| pair[0].to_bits() != pair[1].to_bits()),
            "{sizes:?}"
        );
        let energies: Vec<f64> = records.iter().filter_map(Record::willmore_energy).collect();
        assert!(
            energies.windows(2).all(|pair| pair[1] < pair[0]),
            "{energies:?}"
        );
    }
}

/// The paper's formulation has no calibration.
#[test]
fn the_formulation_holds_for_an_own_operator() {
    let device = ComputeDevice::default_compiled().unwrap();
    for (formulation, scheme) in [
        (Formulation::Paper, "paper"),
        (Formulation::Accurate, "calibrated"),
    ] {
        let case = allen_cahn().formulation(formulation).case(&egg()).unwrap();
        assert_eq!(case.identity(&device)["operator"]["scheme"], scheme);
        let is_paper = formulation == Formulation::Paper;
        assert_eq!(case.operator.factors == Factors::PAPER, is_paper);
    }
}

/// Euler's scheme has no estimates.
#[test]
fn a_scheme_without_estimates_is_not_controlled_by_them() {
    let refused = Willmore::on(grid()).scheme(Euler::new).start(&egg());
    let error = refused.err().unwrap().to_string();
    assert!(
        error.contains("euler") && error.contains("estimate"),
        "{error}"
    );
}

#[test]
fn sizes_are_held_with_own_parts() {
    for flow in [heavy(), doubling(), allen_cahn(), residual()] {
        let mut flow = flow.keep_volume().start(&egg()).unwrap();
        let eps = flow.case().scales.eps;
        let area = |u: &Field<2>| ZeroSet::of(u, eps).unwrap().volume;
        let before = area(flow.field());
        for record in flow.take(3) {
            record.unwrap();
        }
        let after = area(flow.field());
        assert!((after / before - 1.0).abs() < 1e-9, "{before} {after}");
    }
}

/// An own rule that is a function of an own measure ends flows with each of the other parts.
#[test]
fn rules_and_measures_see_flows_with_own_parts() {
    const EPS: f64 = 2.0 / 64.0;
    const CHANGE: f64 = 1e-4;
    for flow in [heavy(), doubling(), allen_cahn(), residual()] {
        let length = Measure::new("length", |u, _| perimeter(u, EPS).map(Some));
        let changed = |length: f64, flow: &Progress<'_, 2>| {
            (length / perimeter(flow.initial, EPS).unwrap() - 1.0).abs() >= CHANGE
        };
        let rule = StopWhen::new("longer or shorter", move |flow: &Progress<'_, 2>| {
            let last = flow.records.last().and_then(|last| last.measure("length"));
            last.is_some_and(|length| changed(length, flow))
        });
        let flow = flow.measure(length).until_rule(rule).until(Stop::Steps(60));
        let mut flow = flow.start(&egg()).unwrap();
        let start = flow.start()["length"];
        while flow.step().unwrap().is_some() {}
        let named = Stop::Own("longer or shorter".to_owned());
        assert_eq!(flow.ended(), Some(named));
        let lengths = flow.records().iter().map(|record| record.measure("length"));
        let changes: Vec<f64> = lengths
            .map(|length| (length.unwrap() / start - 1.0).abs())
            .collect();
        let (last, before) = changes.split_last().unwrap();
        let went_on = before.iter().all(|change| *change < CHANGE);
        assert!(*last >= CHANGE && went_on, "{changes:?}");
    }
}

/// Flows with own parts, by the names that a process of its own is given.
pub const FLOWS: [(&str, fn() -> Willmore<2>); 5] = [
    ("term", heavy),
    ("scheme", doubling),
    ("operator", allen_cahn),
    ("network", residual),
    ("term on bricks", || {
        heavy().storage(Storage::Bricks).keep_volume()
    }),
];

/// Asks for an end after so many records.
struct After(usize, Interrupt);

impl Observer<2> for After {
    fn observe(&mut self, event: &mut Event<'_, 2>) -> Result<(), FlowError> {
        if event.run.records().len() == self.0 {
            self.1.request();
        }
        Ok(())
    }
}

/// Four steps of a flow that is kept in a folder, or what is left of them.
pub fn four_steps(
    flow: fn() -> Willmore<2>,
    folder: &Path,
    observers: &mut [&mut dyn Observer<2>],
    interrupt: &Interrupt,
) -> Run<2> {
    let flow = flow().until(Stop::Steps(4));
    let mut kept = flow.start_in(folder, &egg()).unwrap();
    kept.advance(observers, interrupt).unwrap();
    kept.run
}

pub fn bits(run: &Run<2>) -> Vec<u64> {
    run.field().values().iter().map(|u| u.to_bits()).collect()
}

#[test]
fn interrupted_runs_with_own_parts_go_on_to_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    for (name, flow) in FLOWS {
        let [whole, parts] =
            ["whole", "parts"].map(|part| root.path().join(format!("{name} {part}")));
        let interrupt = Interrupt::never();
        let mut after = After(2, interrupt.clone());
        let first = four_steps(flow, &parts, &mut [&mut after], &interrupt);
        assert_eq!(first.records().len(), 2, "{name}");
        let [whole, parts] = [whole, parts].map(|folder| {
            let run = four_steps(flow, &folder, &mut [], &Interrupt::never());
            assert_eq!(run.records().len(), 4, "{name}");
            bits(&run)
        });
        assert!(whole == parts, "{name}");
    }
}

#[test]
fn what_a_program_does_not_have_is_named() {
    let root = tempfile::tempdir().unwrap();
    drop(heavy().start_in(root.path().join("run"), &egg()).unwrap());
    let refused = Willmore::on(grid()).start_in(root.path().join("run"), &egg());
    let error = refused.err().unwrap().to_string();
    assert!(
        error.contains("the term of the energy \"gravity\""),
        "{error}"
    );
}
