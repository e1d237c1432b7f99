//! Sizes of time steps.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::substeps::{EASY, HARD, Substeps};
use crate::{Error, Record};

/// A rule for the sizes of time steps, written `auto`, `auto:FIRST`, `TAU`, `doubling:FIRST`, `growing:TAU,ALIKE` or `ramp:TAU,HALVINGS`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepRule {
    /// By the energy: twice as long after a step that took little of it away, half as long after one that took much. The first one
    /// is a sixteenth of the inner step unless it is given, since corners move fast at first. A step that fails is halved.
    ByEnergy(Option<f64>),
    /// All alike.
    Constant(f64),
    /// The first one; each of the others is twice as long as the one before.
    Doubling(f64),
    /// The first `alike` ones have size `tau`; each of the others is twice as long as the one before.
    Growing {
        /// Size of the first ones.
        tau: f64,
        /// How many of them there are.
        alike: usize,
    },
    /// All alike, but for the first: that is divided into `halvings + 1` steps, the first two of length `tau / 2^halvings` and each
    /// of the others twice as long as the one before.
    Ramp {
        /// The size in the end.
        tau: f64,
        /// How often the first step is halved.
        halvings: u32,
    },
}

/// Steps by the energy grow while they take away less than this part of it,
const LITTLE: f64 = 0.1;
/// and shrink when they take away more than this.
const MUCH: f64 = 0.3;
/// How often a step by the energy is halved before the run gives up.
const HALVINGS: u32 = 24;

impl StepRule {
    /// The rule with everything filled in, for an inner step `mcf_step`.
    #[must_use]
    pub fn resolved(self, mcf_step: f64) -> Self {
        match self {
            Self::ByEnergy(None) => Self::ByEnergy(Some(mcf_step / 16.0)),
            other => other,
        }
    }

    /// Size of a step, counted from 1, as far as it does not depend on the steps before it.
    pub fn size(self, step: usize) -> f64 {
        let doublings = |n: usize| 2.0_f64.powi(i32::try_from(n).unwrap_or(i32::MAX));
        match self {
            Self::ByEnergy(first) => first.unwrap_or(f64::NAN),
            Self::Constant(tau) => tau,
            Self::Doubling(first) => first * doublings(step - 1),
            Self::Growing { tau, alike } => tau * doublings(step.saturating_sub(alike)),
            Self::Ramp { tau, halvings } => {
                let halvings = halvings as usize;
                // The first and the second part have the same length.
                tau * doublings((step.max(2) - 2).min(halvings)) / doublings(halvings)
            }
        }
    }
}

/// How the time of a flow is divided into steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TimeSteps {
    /// Sizes of the steps.
    pub rule: StepRule,
    /// If steps are made in substeps of adaptive size: the largest size of the very first one. Every other step begins with substeps
    /// like the last ones before it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_substep: Option<f64>,
    /// If the interface may move by no more than so many widths of it in a step, up to 3: a longer step is halved, up to
    /// twelve times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longest_move: Option<f64>,
}

impl From<StepRule> for TimeSteps {
    fn from(rule: StepRule) -> Self {
        Self {
            rule,
            first_substep: None,
            longest_move: None,
        }
    }
}

/// Where in its time steps a flow is, and what size comes next. It depends on nothing but the records so far, so that
/// [accepting](Self::accept) them again restores it.
#[derive(Clone, Debug)]
pub(crate) struct StepControl {
    steps: TimeSteps,
    /// The time at which the flow ends, if any.
    end: f64,
    /// Steps by the energy grow up to this: beyond it nothing is left to be seen.
    largest: f64,
    /// Steps completed, and the time reached.
    completed: usize,
    time: f64,
    /// Size of the present step by the rule, and as far as it does not go beyond the end.
    wanted: f64,
    size: f64,
    /// Substeps of the present step.
    substeps: Option<Substeps>,
}

impl StepControl {
    /// Before the first step.
    pub(crate) fn new(
        steps: TimeSteps,
        (mcf_step, largest): (f64, f64),
        end: Option<f64>,
    ) -> Result<Self, Error> {
        let rule = steps.rule.resolved(mcf_step);
        let mut control = Self {
            steps: TimeSteps { rule, ..steps },
            end: end.unwrap_or(f64::INFINITY),
            largest,
            completed: 0,
            time: 0.0,
            wanted: rule.size(1),
            size: f64::NAN,
            substeps: None,
        };
        control.begin(f64::INFINITY)?;
        Ok(control)
    }

    /// Begins a step whose substeps, if there are any, are at first at most of this size.
    fn begin(&mut self, substep: f64) -> Result<(), Error> {
        self.size = self.wanted.min(self.end - self.time);
        if let Some(very_first) = self.steps.first_substep {
            let largest = if self.completed == 0 {
                very_first
            } else {
                self.size
            };
            let first = substep.min(largest);
            let least = first.min(very_first).min(self.size);
            self.substeps = Some(Substeps::new(self.size, first, least)?);
        }
        Ok(())
    }

    /// The size of the present step by the rule.
    pub(crate) fn step_size(&self) -> f64 {
        self.wanted
    }

    /// The size of the next minimization.
    pub(crate) fn next_size(&self) -> f64 {
        self.substeps.map_or(self.size, |substeps| substeps.size())
    }

    /// How often that size may be halved where a minimization fails.
    pub(crate) fn halvings(&self) -> u32 {
        match (self.steps.rule, self.substeps) {
            (_, Some(substeps)) => substeps.halvings(),
            (StepRule::ByEnergy(_), None) => HALVINGS,
            _ => 0,
        }
    }

    /// Number of the present step, from 1.
    pub(crate) fn step(&self) -> usize {
        self.completed + 1
    }

    /// Takes note of a minimization, and says whether it completes the present step.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the next step cannot be divided into substeps.
    pub(crate) fn accept(&mut self, record: &Record) -> Result<bool, Error> {
        self.time = record.time;
        let mut substep = f64::INFINITY;
        if let Some(substeps) = &mut self.substeps {
            substeps.made(record);
            if !substeps.is_complete() {
                return Ok(false);
            }
            substep = substeps.size();
        }
        let before = self.wanted;
        self.completed += 1;
        self.wanted = match self.steps.rule {
            // A step that was cut short by the end says nothing about the next one.
            StepRule::ByEnergy(_) if self.size < before && record.halvings == 0 => before,
            StepRule::ByEnergy(_) => after(record).min(self.largest),
            rule => rule.size(self.step()),
        };
        // Steps that double begin with twice the size, too.
        self.begin(self.wanted / before * substep)?;
        Ok(true)
    }
}

/// The size by the energy after a step.
fn after(record: &Record) -> f64 {
    let Some(made) = &record.minimization else {
        return record.tau;
    };
    let before = made.energy_at_rest();
    let drop = (before - made.willmore_energy) / before.max(f64::MIN_POSITIVE);
    let newton = made.newton.newton;
    let factor = if drop > MUCH || newton > HARD {
        0.5
    } else if drop < LITTLE && newton <= EASY {
        2.0
    } else {
        1.0
    };
    factor * record.tau
}

impl FromStr for StepRule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let positive = |text: &str| match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
            _ => Err(format!(
                "{text:?} is no positive number; give auto, auto:FIRST, VALUE, doubling:FIRST, growing:VALUE,ALIKE or \
                 ramp:VALUE,HALVINGS"
            )),
        };
        let pair = |rest: &str, rule: &str, name: &str| match rest.split_once(',') {
            Some((tau, count)) => match count.trim().parse::<u32>() {
                Ok(count @ 0..=60) => Ok((positive(tau)?, count)),
                _ => Err(format!("{count:?} is no number of {name} from 0 to 60")),
            },
            None => Err(format!(
                "a {rule} needs a step and a number of {name}, VALUE,COUNT"
            )),
        };
        match text.split_once(':') {
            None if text == "auto" => Ok(Self::ByEnergy(None)),
            None => Ok(Self::Constant(positive(text)?)),
            Some(("auto", first)) => Ok(Self::ByEnergy(Some(positive(first)?))),
            Some(("doubling", first)) => Ok(Self::Doubling(positive(first)?)),
            Some(("growing", rest)) => {
                pair(rest, "growing rule", "equal steps").map(|(tau, alike)| Self::Growing {
                    tau,
                    alike: alike as usize,
                })
            }
            Some(("ramp", rest)) => {
                pair(rest, "ramp", "halvings").map(|(tau, halvings)| Self::Ramp { tau, halvings })
            }
            Some((rule, _)) => Err(format!(
                "{rule:?} is no rule; there are auto, doubling, growing and ramp"
            )),
        }
    }
}

impl fmt::Display for StepRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ByEnergy(None) => f.write_str("auto"),
            Self::ByEnergy(Some(first)) => write!(f, "auto:{first:e}"),
            Self::Constant(tau) => write!(f, "{tau:e}"),
            Self::Doubling(first) => write!(f, "doubling:{first:e}"),
            Self::Growing { tau, alike } => write!(f, "growing:{tau:e},{alike}"),
            Self::Ramp { tau, halvings } => write!(f, "ramp:{tau:e},{halvings}"),
        }
    }
}

impl Serialize for StepRule {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_read_back_as_they_are_written() {
        for text in [
            "auto",
            "auto:1e-7",
            "3e-5",
            "doubling:2e-7",
            "growing:6.1e-5,3",
            "ramp:1.1e-3,12",
        ] {
            let rule: StepRule = text.parse().unwrap();
            assert_eq!(rule.to_string(), text);
        }
        let exact = StepRule::Constant(1.0 / 3.0);
        assert_eq!(exact.to_string().parse::<StepRule>().unwrap(), exact);
        for text in [
            "",
            "fast",
            "-1",
            "0",
            "nan",
            "inf",
            "ramp:1",
            "ramp:1,61",
            "doubling:",
            "halving:1",
        ] {
            assert!(text.parse::<StepRule>().is_err(), "{text:?}");
        }
    }

    #[test]
    fn sizes_double_where_they_should() {
        let sizes = |rule: StepRule| -> Vec<f64> { (1..=5).map(|step| rule.size(step)).collect() };
        assert_eq!(sizes(StepRule::Doubling(0.25)), [0.25, 0.5, 1.0, 2.0, 4.0]);
        let growing = StepRule::Growing {
            tau: 0.25,
            alike: 3,
        };
        assert_eq!(sizes(growing), [0.25, 0.25, 0.25, 0.5, 1.0]);
    }

    #[test]
    fn the_parts_of_a_ramp_add_up_to_its_step() {
        let ramp = StepRule::Ramp {
            tau: 0.5,
            halvings: 6,
        };
        let sum: f64 = (1..=7).map(|step| ramp.size(step)).sum();
        assert_eq!(sum.to_bits(), 0.5_f64.to_bits());
        assert_eq!(ramp.size(8).to_bits(), 0.5_f64.to_bits());
    }
}
