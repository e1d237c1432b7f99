//! Records of the minimizations of a flow.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use solver::{DirectRecord, StepRecord};

/// Values of the measures of a case by their names; those that a shape does not have are absent.
pub type Values = BTreeMap<String, f64>;

/// A time step or a substep of one: a minimization of Willmore flow, two for steps of second order, or a step of mean curvature flow.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Number of the time step to which it belongs, from 1.
    pub step: usize,
    /// Whether that time step is complete.
    pub completes_step: bool,
    /// Time at the end of the step.
    pub time: f64,
    /// Step size.
    pub tau: f64,
    /// Size of the time step to which it belongs.
    pub step_size: f64,
    /// How often it was halved: because the minimization failed, because a controlled step was too long, or because the interface moved too
    /// far, now or in the step before.
    pub halvings: u32,
    /// Whether the interface moved so far that twice the size would have been too long; so that is not tried.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub far: bool,
    /// Hessian-vector products of steps that were too long.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub refused_hvp: f64,
    /// `L2` distance to the phase field before the step.
    pub moved: f64,
    /// `L2` distance to the initial phase field.
    pub travelled: f64,
    /// Energies, iterations and times of the minimization, or what a direct step did; none for mean curvature flow.
    pub minimization: Option<StepRecord>,
    /// Values of the case's measures after the step.
    pub measures: Values,
    /// Wall time in seconds, failed attempts included. Checkpoints do not hold it, since they are the same bytes for the same result.
    #[serde(skip)]
    pub seconds: f64,
}

impl Record {
    /// The energy as the scheme measures it: that of bending, and all terms that the flow has besides.
    pub fn willmore_energy(&self) -> Option<f64> {
        self.minimization.map(|made| made.willmore_energy)
    }

    /// The Willmore energy before the step, as the scheme measures it.
    pub fn energy_at_rest(&self) -> Option<f64> {
        self.minimization.map(|made| made.energy_at_rest())
    }

    /// What a direct step did.
    pub fn direct(&self) -> Option<DirectRecord> {
        self.minimization?.direct
    }

    /// Hessian-vector products; those on coarser grids count by their share of this grid's unknowns.
    pub fn hvp(&self) -> Option<f64> {
        self.minimization.map(|made| made.hvp() + self.refused_hvp)
    }

    /// The value of the measure with this name.
    pub fn measure(&self, name: &str) -> Option<f64> {
        self.measures.get(name).copied()
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_zero(number: &f64) -> bool {
    number.to_bits() == 0
}

/// The minimizations behind the records; none for mean curvature flow.
pub fn minimizations(records: &[Record]) -> impl Iterator<Item = &StepRecord> {
    (records.iter()).filter_map(|record| record.minimization.as_ref())
}

/// Minimizations that ended at a higher energy than they began with; where the shape is stationary the energy stays.
pub fn energy_increases(records: &[Record]) -> usize {
    let risen = |made: &&StepRecord| made.energy > made.energy_before;
    minimizations(records).filter(risen).count()
}

/// By how much the sum of estimates is multiplied, for the errors that have none: with it the estimates for curves in `work_precision` are at least a third of the truth, or nearly.
pub(crate) const ESTIMATES_MISS: f64 = 1.35;

/// The estimated time error of second-order steps at the end of the last of them, largest over the interface; none before the first
/// [estimate](solver::StepEstimates).
///
/// The flow does not depend on time: what a step is late lasts. So the local error `e_k` of a step in which the interface moves at the rate
/// `F_k` is taken for a delay, and all of them count at the present rate, `1.35 F_n sum_k e_k / F_k`. Their plain sum would not see that shapes forget
/// errors as they slow down. The factor makes up for what has no estimate: the first steps, and what minimizations leave.
pub fn estimated_time_error(records: &[Record]) -> Option<f64> {
    let estimates = minimizations(records).filter_map(|made| Some((made.tau, made.estimates?)));
    let (mut delay, mut rate) = (None, 0.0);
    for (tau, estimates) in estimates {
        rate = estimates.motion / tau;
        if let Some(error) = estimates.error.filter(|_| rate > 0.0) {
            delay = Some(delay.unwrap_or(0.0) + error / rate);
        }
    }
    Some(ESTIMATES_MISS * delay? * rate)
}

/// All Hessian-vector products.
pub fn total_hvp(records: &[Record]) -> f64 {
    records.iter().filter_map(Record::hvp).sum()
}

/// Hessian-vector products per record, those of steps that were too long included.
pub fn mean_hvp(records: &[Record]) -> f64 {
    total_hvp(records) / records.len().max(1) as f64
}

/// All records as CSV, with a column for each measure.
pub(crate) fn to_csv(records: &[Record]) -> String {
    type Column<'a> = (&'a str, Box<dyn Fn(&Record) -> Option<f64> + 'a>);
    fn column<'a>(name: &'a str, of: impl Fn(&Record) -> Option<f64> + 'a) -> Column<'a> {
        (name, Box::new(of))
    }
    let mut columns = vec![
        column("step", |r| Some(r.step as f64)),
        column("time", |r| Some(r.time)),
        column("tau", |r| Some(r.tau)),
        column("energy_before", |r| Some(r.minimization?.energy_before)),
        column("energy", |r| Some(r.minimization?.energy)),
        column("willmore_energy", Record::willmore_energy),
    ];
    let names = records.iter().flat_map(|record| record.measures.keys());
    let names: BTreeSet<&str> = names.map(String::as_str).collect();
    columns.extend((names.into_iter()).map(|name| column(name, move |r| r.measure(name))));
    let multipliers = [
        column("tension", |r| r.minimization?.tension),
        column("pressure", |r| r.minimization?.pressure),
    ];
    let is_used = |(_, of): &Column<'_>| records.iter().any(|record| of(record).is_some());
    columns.extend(multipliers.into_iter().filter(is_used));
    let direct = [
        column("convolutions", |r| Some(r.direct()?.convolutions as f64)),
        column("reach", |r| Some(r.direct()?.reach)),
        column("run_distance", |r| Some(r.direct()?.run_distance)),
    ];
    columns.extend(direct.into_iter().filter(is_used));
    columns.extend([
        column("newton", |r| Some(r.minimization?.newton.newton as f64)),
        column("hvp", Record::hvp),
        column("halvings", |r| Some(f64::from(r.halvings))),
    ]);
    let head: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let mut text = head.join(",") + "\n";
    for record in records {
        let cell = |of: Option<f64>| of.map_or(String::new(), |value| value.to_string());
        let row: Vec<String> = columns.iter().map(|(_, of)| cell(of(record))).collect();
        text += &(row.join(",") + "\n");
    }
    text
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use solver::NewtonInfo;

    /// A minimization of a size that took so many Newton steps.
    pub(crate) fn record(tau: f64, newton: usize) -> Record {
        Record {
            step: 1,
            tau,
            minimization: Some(StepRecord {
                tau,
                energy_before: 1.0,
                energy: 1.0,
                willmore_energy: 1.0,
                newton: NewtonInfo {
                    newton,
                    ..NewtonInfo::default()
                },
                ..StepRecord::default()
            }),
            measures: Values::from([("volume".to_owned(), 0.5)]),
            ..Record::default()
        }
    }

    #[test]
    fn tables_have_a_column_for_each_measure() {
        let mut curve = record(0.25, 3);
        curve.minimization = None;
        curve.measures.insert("tip".to_owned(), 1.5);
        let text = to_csv(&[record(0.5, 2), curve]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "step,time,tau,energy_before,energy,willmore_energy,tip,volume,newton,hvp,halvings"
        );
        assert_eq!(lines[1], "1,0,0.5,1,1,1,,0.5,2,0,0");
        assert_eq!(lines[2], "1,0,0.25,,,,1.5,0.5,,,0");
    }
}
