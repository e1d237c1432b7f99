//! The records of runs as rows of a table.

use engine::{Method, Scheme, Trajectory};
use serde::Serialize;

/// One minimization of Willmore flow: a time step, or a substep of one.
#[derive(Serialize)]
pub struct StepRow<'a> {
    shape: &'a str,
    method: Method,
    scheme: Scheme,
    step: usize,
    time: f64,
    tau: f64,
    energy_before: f64,
    energy: f64,
    willmore_energy: f64,
    perimeter: Option<f64>,
    volume: Option<f64>,
    exit: solver::Exit,
    newton: usize,
    hvp: f64,
    negative_curvature: usize,
    seconds: f64,
}

/// A row for each minimization of these runs, the shapes of which have names.
pub fn step_rows<'a, const D: usize>(
    runs: impl IntoIterator<Item = (&'a str, &'a Trajectory<D>)>,
) -> impl Iterator<Item = StepRow<'a>> {
    let rows = |(shape, run): (&'a str, &'a Trajectory<D>)| {
        run.records.iter().filter_map(move |record| {
            let made = record.minimization?;
            Some(StepRow {
                shape,
                method: run.case.operator.method,
                scheme: run.case.operator.scheme,
                step: record.step,
                time: record.time,
                tau: record.tau,
                energy_before: made.energy_before,
                energy: made.energy,
                willmore_energy: made.willmore_energy,
                perimeter: record.measure("perimeter"),
                volume: record.measure("volume"),
                exit: made.newton.exit,
                newton: made.newton.newton,
                hvp: made.hvp(),
                negative_curvature: made.newton.negative_curvature,
                seconds: record.seconds,
            })
        })
    };
    runs.into_iter().flat_map(rows)
}
