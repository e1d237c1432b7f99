//! The steps of runs as a table.

use std::collections::BTreeSet;

use engine::Values;

use crate::prelude::*;

pub struct Rows<'a> {
    /// Which run it is: a cell for each leading column.
    pub leading: Vec<Cell>,
    /// The measures of the initial phase field, if there is to be a row for them.
    pub start: Option<&'a Values>,
    pub records: &'a [Record],
}

/// The steps of runs by any names, with method and scheme, as CSV.
pub fn steps_csv<'a, const D: usize>(
    named: &str,
    runs: impl Iterator<Item = (&'a str, &'a Trajectory<D>)>,
) -> Result<String, Error> {
    let rows = runs.map(|(name, run)| {
        let operator = &run.case.operator;
        Rows {
            leading: [name, operator.method.key(), operator.scheme.key()]
                .map(Cell::from)
                .to_vec(),
            start: None,
            records: &run.records,
        }
    });
    let rows: Vec<Rows<'_>> = rows.collect();
    Ok(table(&[named, "method", "scheme"], &rows)?.to_csv()?)
}

/// A row for every step: the leading columns, step, time and size, a column for every measure, and what the minimization did.
pub fn table(leading: &[&str], runs: &[Rows<'_>]) -> Result<Table, Error> {
    let records = || runs.iter().flat_map(|run| run.records);
    let values = records().map(|record| &record.measures);
    let values = values.chain(runs.iter().filter_map(|run| run.start));
    let measures: BTreeSet<&str> = values.flat_map(|v| v.keys().map(String::as_str)).collect();
    let minimization = MINIMIZATION.map(|(name, _)| name);
    let names = (leading.iter().chain(&["step", "time", "tau"]))
        .chain(&measures)
        .chain(&minimization)
        .chain(&["halvings", "seconds"]);
    let mut table = Table::data(names);
    for run in runs {
        let start = run.start.map(|values| (None, values));
        let steps = run.records.iter().map(|r| (Some(r), &r.measures));
        for (record, values) in start.into_iter().chain(steps) {
            let mut row = run.leading.clone();
            row.extend(match record {
                Some(r) => [r.step.into(), r.time.into(), r.tau.into()],
                None => [0_usize.into(), 0.0.into(), Cell::Missing],
            });
            let value = |name: &&str| values.get(*name).copied().into();
            row.extend(measures.iter().map(value));
            let made = record.and_then(|r| r.minimization.as_ref());
            row.extend(MINIMIZATION.map(|(_, of)| made.map_or(Cell::Missing, of)));
            row.push(record.map(|r| r.halvings as usize).into());
            row.push(record.map(|r| r.seconds).into());
            table.push(row)?;
        }
    }
    Ok(table)
}

/// Columns that are empty for mean curvature flow.
const MINIMIZATION: [(&str, fn(&StepRecord) -> Cell); 10] = [
    ("energy_before", |m| m.energy_before.into()),
    ("energy", |m| m.energy.into()),
    ("willmore_energy", |m| m.willmore_energy.into()),
    ("exit", exit),
    ("newton", |m| m.newton.newton.into()),
    ("hvp", |m| m.hvp().into()),
    ("values", |m| m.newton.values.into()),
    ("gradients", |m| m.newton.gradients.into()),
    ("negative_curvature", |m| m.newton.negative_curvature.into()),
    ("estimate", |m| m.newton.estimate.into()),
];

/// Why a minimization ended, as serde writes it.
fn exit(made: &StepRecord) -> Cell {
    let exit = serde_json::to_value(made.newton.exit).ok();
    exit.as_ref().and_then(|name| name.as_str()).into()
}
