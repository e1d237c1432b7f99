//! How the time of a flow is divided into steps.

use std::fmt;
use std::str::FromStr;

use direct::DirectParams;
use geometry::Grid;
use serde::{Serialize, Serializer};

use crate::ErrorControl;

/// A rule for the sizes of time steps, written `auto`, `auto:FIRST`, `TAU`, `doubling:FIRST`, `growing:TAU,ALIKE`, `graded:FIRST,PART`,
/// `ramp:TAU,HALVINGS` or `controlled`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepRule {
    /// By the energy: twice as long after a step that took little of it away, half as long after one that took much. The first one
    /// is a sixteenth of the inner step unless it is given, since corners move fast at first. A step that fails is halved.
    ByEnergy(Option<f64>),
    /// Constant steps.
    Constant(f64),
    /// The size of the first step; each of the others is twice as long as the one before.
    Doubling(f64),
    /// The first `alike` ones have size `tau`; each of the others is twice as long as the one before.
    Growing {
        /// Size of the first steps.
        tau: f64,
        /// Number of steps of that size.
        alike: usize,
    },
    /// In proportion to the time reached: `part` of it, and `first` at least.
    Graded {
        /// Size of the first ones.
        first: f64,
        /// Part of the time reached.
        part: f64,
    },
    /// As long as [`ErrorControl`] allows: every controlled step is a step.
    Controlled,
    /// All alike, but for the first: that is divided into `halvings + 1` steps, the first two of length `tau / 2^halvings` and each
    /// of the others twice as long as the one before.
    Ramp {
        /// The size after the first step.
        tau: f64,
        /// How often the first step is halved.
        halvings: u32,
    },
}

impl StepRule {
    /// The rule with its default values filled in, for an inner step `mcf_step`.
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
            Self::Graded { first, .. } => first,
            Self::Controlled => f64::INFINITY,
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

/// The largest time step by the energy, `side^4 / 1024`: in such times shapes as large as the box become stationary.
pub(crate) fn largest_step<const D: usize>(grid: &Grid<D>) -> f64 {
    grid.side().powi(4) / 1024.0
}

/// An energy below that of any closed curve in the box, or surface: changes of smaller ones are measured by it.
pub(crate) fn least_energy<const D: usize>(grid: &Grid<D>) -> f64 {
    grid.side().powi(D as i32 - 3)
}

/// How the time of a flow is divided into steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TimeSteps {
    /// The rule for the sizes of the steps.
    pub rule: StepRule,
    /// The largest size of the very first substep, if steps are made in substeps of adaptive size; controlled ones never are. Every other step begins
    /// with substeps like the last ones before it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_substep: Option<f64>,
    /// If the interface may move by no more than so many widths of it in a step, up to 3: a longer step is halved, up to twelve
    /// times, a substep down to the smallest one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longest_move: Option<f64>,
    /// How a step is made.
    #[serde(skip_serializing_if = "Order::is_first")]
    pub order: Order,
}

/// How a time step is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// As one minimization: implicit Euler, the scheme of the paper.
    #[default]
    First,
    /// As two minimizations ([`solver::SecondOrder`]).
    Second,
    /// In second-order steps whose sizes are controlled; the steps of the rule end when they are due.
    Controlled(ErrorControl),
    /// By convolutions, without a minimization ([`direct::Direct`]), in as many parts as the reach of the interface asks for.
    Direct(DirectParams),
}

impl Order {
    fn is_first(&self) -> bool {
        *self == Self::First
    }
}

impl TimeSteps {
    /// Steps of second order as long as their errors allow.
    pub fn controlled(control: ErrorControl) -> Self {
        Self {
            order: Order::Controlled(control),
            ..StepRule::Controlled.into()
        }
    }
}

impl TimeSteps {
    /// Direct steps by a rule, which errors cannot control.
    pub fn direct(rule: StepRule, params: DirectParams) -> Self {
        Self {
            order: Order::Direct(params),
            ..rule.into()
        }
    }
}

impl From<StepRule> for TimeSteps {
    fn from(rule: StepRule) -> Self {
        let order = match rule {
            StepRule::Controlled => Order::Controlled(ErrorControl::default()),
            _ => Order::First,
        };
        Self {
            rule,
            first_substep: None,
            order,
            longest_move: None,
        }
    }
}

impl FromStr for StepRule {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const RULES: &str = "auto, auto:FIRST, controlled, VALUE, doubling:FIRST, graded:FIRST,PART, growing:VALUE,COUNT or \
             ramp:VALUE,HALVINGS";
        let positive = |text: &str| match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
            _ => Err(format!("{text:?} is no positive number; give {RULES}")),
        };
        let count = |text: &str, what: &str| match text.trim().parse::<u32>() {
            Ok(count @ 0..=60) => Ok(count),
            _ => Err(format!("{text:?} is no number of {what} from 0 to 60")),
        };
        let (rule, numbers) = text.split_once(':').unwrap_or((text, ""));
        let numbers: Vec<&str> = numbers.split(',').collect();
        Ok(match (rule, &numbers[..]) {
            ("auto", [""]) => Self::ByEnergy(None),
            ("controlled", [""]) => Self::Controlled,
            ("auto", [first]) => Self::ByEnergy(Some(positive(first)?)),
            ("doubling", [first]) => Self::Doubling(positive(first)?),
            ("growing", [tau, alike]) => Self::Growing {
                tau: positive(tau)?,
                alike: count(alike, "equal steps")? as usize,
            },
            ("ramp", [tau, halvings]) => Self::Ramp {
                tau: positive(tau)?,
                halvings: count(halvings, "halvings")?,
            },
            ("graded", [first, part]) => Self::Graded {
                first: positive(first)?,
                part: positive(part)?,
            },
            (tau, [""]) => Self::Constant(positive(tau)?),
            _ => return Err(format!("{text:?} is no rule; there are {RULES}")),
        })
    }
}

impl fmt::Display for StepRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ByEnergy(None) => f.write_str("auto"),
            Self::ByEnergy(Some(first)) => write!(f, "auto:{first:e}"),
            Self::Constant(tau) => write!(f, "{tau:e}"),
            Self::Controlled => f.write_str("controlled"),
            Self::Graded { first, part } => write!(f, "graded:{first:e},{part}"),
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
            "graded:1e-6,0.2",
            "controlled",
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
