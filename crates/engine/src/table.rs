//! Records as rows of numbers, as checkpoints hold them: a run of a hundred thousand steps takes megabytes.

use solver::{Exit, NewtonInfo, PhaseTimes, Start, StartKind, StepRecord};

use crate::{Record, Values};

/// Columns before the measures.
const COLUMNS: usize = 21;
const EXITS: [Exit; 4] = [
    Exit::Converged,
    Exit::Stationary,
    Exit::Precision,
    Exit::IterationLimit,
];
const STARTS: [StartKind; 3] = [
    StartKind::Rest,
    StartKind::Extrapolated,
    StartKind::HalfGrid,
];

/// The row of a record, the measures of these names at its end. What a record does not have is NaN.
pub(crate) fn to_row(record: &Record, names: &[&str]) -> Vec<f64> {
    let count = |number: usize| number as f64;
    let mut row = vec![
        count(record.step),
        f64::from(u8::from(record.completes_step)),
        record.time,
        record.tau,
        f64::from(record.halvings),
        record.moved,
        record.travelled,
    ];
    if let Some(made) = &record.minimization {
        let index = |found: Option<usize>| found.map_or(f64::NAN, |k| k as f64);
        row.extend([
            made.energy_before,
            made.energy,
            made.willmore_energy,
            index(STARTS.iter().position(|kind| *kind == made.start.kind)),
            made.start.hvp,
            index(EXITS.iter().position(|exit| *exit == made.newton.exit)),
            count(made.newton.newton),
            count(made.newton.hvp),
            count(made.newton.values),
            count(made.newton.gradients),
            count(made.newton.negative_curvature),
            made.newton.energy_before,
            made.newton.energy,
            made.newton.estimate,
        ]);
    }
    row.resize(COLUMNS, f64::NAN);
    row.extend(
        names
            .iter()
            .map(|name| record.measure(name).unwrap_or(f64::NAN)),
    );
    row
}

/// The records of [rows](to_row); nothing if they are not of that form.
pub(crate) fn from_rows(rows: &[f64], names: &[&str]) -> Option<Vec<Record>> {
    let rows = rows.chunks(COLUMNS + names.len());
    rows.enumerate()
        .map(|(k, row)| from_row(k + 1, row, names))
        .collect()
}

fn from_row(number: usize, row: &[f64], names: &[&str]) -> Option<Record> {
    let count = |column: usize| row.get(column).map(|value| *value as usize);
    let [time, tau] = [*row.get(2)?, *row.get(3)?];
    let made = |row: &[f64]| {
        Some(StepRecord {
            step: number,
            time,
            tau,
            energy_before: row[7],
            energy: row[8],
            willmore_energy: row[9],
            start: Start {
                kind: *STARTS.get(count(10)?)?,
                hvp: row[11],
            },
            newton: NewtonInfo {
                exit: *EXITS.get(count(12)?)?,
                newton: count(13)?,
                hvp: count(14)?,
                values: count(15)?,
                gradients: count(16)?,
                negative_curvature: count(17)?,
                energy_before: row[18],
                energy: row[19],
                estimate: row[20],
            },
            seconds: 0.0,
            times: PhaseTimes::default(),
        })
    };
    let minimization = match row.get(12)? {
        exit if exit.is_nan() => None,
        _ => Some(made(row)?),
    };
    let measures = names.iter().zip(row.get(COLUMNS..)?);
    let measures = measures.filter(|(_, value)| !value.is_nan());
    Some(Record {
        step: count(0)?,
        completes_step: row[1] > 0.5,
        time,
        tau,
        halvings: row[4] as u32,
        moved: row[5],
        travelled: row[6],
        minimization,
        measures: measures
            .map(|(name, value)| ((*name).to_owned(), *value))
            .collect::<Values>(),
        seconds: 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::record;

    #[test]
    fn rows_are_read_back() {
        let mut first = record(1.0 / 3.0, 7);
        first.seconds = 0.0;
        let mut second = Record {
            minimization: None,
            completes_step: true,
            halvings: 3,
            ..first.clone()
        };
        second.measures.insert("tip".to_owned(), 0.1);
        if let Some(made) = &mut first.minimization {
            made.start.kind = StartKind::HalfGrid;
            made.newton.exit = Exit::Precision;
        }
        let names = ["tip", "volume"];
        let rows: Vec<f64> = [&first, &second]
            .iter()
            .flat_map(|r| to_row(r, &names))
            .collect();
        assert_eq!(from_rows(&rows, &names), Some(vec![first, second]));
        assert_eq!(from_rows(&rows[1..], &names), None);
    }
}
