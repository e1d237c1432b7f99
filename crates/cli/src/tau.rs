//! Sizes of time steps.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
use solver::StepRecord;

/// A rule for the sizes of time steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tau {
    /// By the energy, from a first size on; none until the scales of the run are known.
    Auto(Option<f64>),
    /// All alike.
    Constant(f64),
    /// The first one; each of the others is twice as long as the one before.
    Doubling(f64),
    /// All alike, but for the first: that is divided into `halvings + 1` parts, the first two of length `tau / 2^halvings` and
    /// each of the others twice as long as the one before.
    Ramp {
        /// The size in the end.
        tau: f64,
        /// How often the first part is halved.
        halvings: u32,
    },
}

/// The automatic step grows while it takes away less than this part of the energy.
const LITTLE: f64 = 0.1;
/// And shrinks when it takes away more than this.
const MUCH: f64 = 0.3;
/// It grows while the minimization takes at most this many Newton steps.
const QUICK: usize = 8;
/// And shrinks when it takes more than this.
const SLOW: usize = 20;

impl Tau {
    /// The rule with everything filled in, for an inner step `mcf_step`.
    pub fn resolved(self, mcf_step: f64) -> Self {
        match self {
            // Corners move fast at first.
            Self::Auto(None) => Self::Auto(Some(mcf_step / 16.0)),
            other => other,
        }
    }

    /// Whether a step that fails is repeated with half its size.
    pub fn adapts(self) -> bool {
        matches!(self, Self::Auto(_))
    }

    /// Size of the step with this number, counted from 1; `next` is what [`Self::after`] said last, if anything.
    pub fn size(self, step: usize, next: f64) -> f64 {
        let doublings = |n: usize| 2.0_f64.powi(i32::try_from(n).unwrap_or(i32::MAX));
        match self {
            Self::Auto(first) if next.is_nan() => first.unwrap_or(f64::NAN),
            Self::Auto(_) => next,
            Self::Constant(tau) => tau,
            Self::Doubling(first) => first * doublings(step - 1),
            Self::Ramp { tau, halvings } => {
                let halvings = halvings as usize;
                // The first and the second part have the same length.
                tau * doublings((step.max(2) - 2).min(halvings)) / doublings(halvings)
            }
        }
    }

    /// The automatic size after a step, at most `largest`.
    pub fn after(record: &StepRecord, largest: f64) -> f64 {
        let before = record.energy_before / (2.0 * record.tau);
        let drop = (before - record.willmore_energy) / before.max(f64::MIN_POSITIVE);
        let newton = record.newton.newton;
        let factor = if drop > MUCH || newton > SLOW {
            0.5
        } else if drop < LITTLE && newton <= QUICK {
            2.0
        } else {
            1.0
        };
        (factor * record.tau).min(largest)
    }
}

impl FromStr for Tau {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let positive = |text: &str| match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
            _ => Err(format!(
                "{text:?} is no positive number; give auto, auto:FIRST, VALUE, doubling:FIRST or ramp:VALUE,HALVINGS"
            )),
        };
        match text.split_once(':') {
            None if text == "auto" => Ok(Self::Auto(None)),
            None => Ok(Self::Constant(positive(text)?)),
            Some(("auto", first)) => Ok(Self::Auto(Some(positive(first)?))),
            Some(("doubling", first)) => Ok(Self::Doubling(positive(first)?)),
            Some(("ramp", rest)) => {
                let (tau, halvings) = rest
                    .split_once(',')
                    .ok_or("a ramp needs a step and a number of halvings, ramp:VALUE,HALVINGS")?;
                let Ok(halvings @ 0..=60) = halvings.trim().parse() else {
                    return Err(format!(
                        "{halvings:?} is no number of halvings from 0 to 60"
                    ));
                };
                Ok(Self::Ramp {
                    tau: positive(tau)?,
                    halvings,
                })
            }
            Some((rule, _)) => Err(format!(
                "{rule:?} is no rule; there are auto, doubling and ramp"
            )),
        }
    }
}

impl fmt::Display for Tau {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto(None) => f.write_str("auto"),
            Self::Auto(Some(first)) => write!(f, "auto:{first:e}"),
            Self::Constant(tau) => write!(f, "{tau:e}"),
            Self::Doubling(first) => write!(f, "doubling:{first:e}"),
            Self::Ramp { tau, halvings } => write!(f, "ramp:{tau:e},{halvings}"),
        }
    }
}

impl Serialize for Tau {
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
            "ramp:1.1e-3,12",
        ] {
            let tau: Tau = text.parse().unwrap();
            assert_eq!(tau.to_string(), text);
            let exact = Tau::Constant(1.0 / 3.0);
            assert_eq!(exact.to_string().parse::<Tau>().unwrap(), exact);
        }
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
            assert!(text.parse::<Tau>().is_err(), "{text:?}");
        }
    }

    #[test]
    fn the_parts_of_a_ramp_add_up_to_its_step() {
        let ramp = Tau::Ramp {
            tau: 0.5,
            halvings: 6,
        };
        let parts: f64 = (1..=7).map(|step| ramp.size(step, f64::NAN)).sum();
        assert_eq!(parts.to_bits(), 0.5_f64.to_bits());
        assert_eq!(ramp.size(8, f64::NAN).to_bits(), 0.5_f64.to_bits());
        let doubling = Tau::Doubling(0.25);
        assert_eq!(doubling.size(4, f64::NAN).to_bits(), 2.0_f64.to_bits());
    }
}
