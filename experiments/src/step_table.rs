//! The steps of runs as a table.

use engine::Values;

use crate::prelude::libraries::*;
use crate::session::Session;

/// A row of the table: a step of one of several runs, or its beginning, which has no record.
pub struct StepRow<'a, R> {
    pub run: R,
    record: Option<&'a Record>,
    measures: &'a Values,
}

/// The rows of a run.
pub fn rows<R: Copy, const D: usize>(
    run: R,
    trajectory: &Trajectory<D>,
) -> impl Iterator<Item = StepRow<'_, R>> {
    let records = trajectory.records.iter().map(Some);
    [None]
        .into_iter()
        .chain(records)
        .map(move |record| StepRow {
            run,
            record,
            measures: record.map_or(&trajectory.start, |record| &record.measures),
        })
}

/// Writes the steps of runs by any names, with method and formulation, as `steps.csv`.
pub fn write<'a, const D: usize>(
    session: &Session,
    named: &str,
    runs: impl Iterator<Item = (&'a str, &'a Trajectory<D>)>,
) -> Result<()> {
    // Without the beginning.
    let steps = runs.flat_map(|(name, run)| {
        let discretization = run.case.operator.discretization;
        rows((name, discretization), run).skip(1)
    });
    let steps: Vec<_> = steps.collect();
    let sheet = Sheet::of(&steps)
        .text(named, |step| step.run.0)
        .text("method", |step| step.run.1.method.to_string())
        .text("scheme", |step| step.run.1.formulation.to_string());
    session.csv(columns(sheet, &steps), "steps")
}

/// Adds step, time and size, a column for every measure, and what the minimization did.
pub fn columns<'a, R>(
    sheet: Sheet<'a, StepRow<'a, R>>,
    steps: &'a [StepRow<'a, R>],
) -> Sheet<'a, StepRow<'a, R>> {
    let measures = steps.iter().flat_map(|step| step.measures.keys());
    let measures: BTreeSet<&String> = measures.collect();
    let mut sheet = sheet
        .data("step", |s| s.record.map_or(0, |r| r.step))
        .data("time", |s| s.record.map_or(0.0, |r| r.time))
        .data("tau", |s| s.record.map(|r| r.tau));
    for name in measures {
        sheet = sheet.data(name, |s| s.measures.get(name).copied());
    }
    for (name, of) in MINIMIZATION {
        sheet = sheet.data(name, |s| s.record?.minimization.as_ref().map(of));
    }
    sheet
        .data("halvings", |s| s.record.map(|r| r.halvings as usize))
        .data("seconds", |s| s.record.map(|r| r.seconds))
}

/// Columns that are empty for mean curvature flow.
const MINIMIZATION: [(&str, fn(&StepRecord) -> Cell); 10] = [
    ("energy_before", |m| m.energy_before.into()),
    ("energy", |m| m.energy.into()),
    ("willmore_energy", |m| m.willmore_energy.into()),
    // Why a minimization ended, as serde writes it.
    ("exit", |m| {
        let exit = serde_json::to_value(m.newton.exit).ok();
        exit.as_ref().and_then(Value::as_str).into()
    }),
    ("newton", |m| m.newton.newton.into()),
    ("hvp", |m| m.hvp().into()),
    ("values", |m| m.newton.values.into()),
    ("gradients", |m| m.newton.gradients.into()),
    ("negative_curvature", |m| m.newton.negative_curvature.into()),
    ("estimate", |m| m.newton.estimate.into()),
];
