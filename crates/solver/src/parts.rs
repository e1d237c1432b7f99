//! Time steps made in parts of adaptive size.
//!
//! A large step from a shape with corners is too much for one minimization: the corners move by many widths of the interface,
//! and the minimizer is in another valley. In parts that begin small and grow it is reached.

use serde::{Deserialize, Serialize};

use crate::{Error, StepRecord, WillmoreFlow};

/// The next part is twice as long if a part took at most this many Newton steps,
const EASY: usize = 8;
/// and half as long if it took more than this.
const HARD: usize = 20;
/// After a failure so many parts are made before a longer one is tried again: failures are dear.
const PATIENCE: u32 = 4;
/// Sizes are the step's divided by `2^k`, `k` at most this, so that places in a step are exact numbers.
const DEEPEST: u32 = 48;

/// A time step of size `tau` that is made in parts, and where in it the flow is.
///
/// Sizes are `tau / 2^k`, and a part begins at a multiple of its size: the parts add up to `tau` without rounding, none goes beyond
/// it, and every `tau / 2^k` not smaller than the first part is the end of one. After a part that took few Newton steps the next one
/// is twice as long, after one that took many half as long, as far as that rule allows; after a failure that takes a few parts longer.
///
/// What comes next depends on nothing but the [records](StepRecord) of the parts made, so that [`Self::made`] also restores it.
///
/// ```
/// use solver::Parts;
///
/// # fn main() -> Result<(), solver::Error> {
/// let parts = Parts::new(0.5, 0.1, 1e-6)?;
/// assert_eq!(parts.next_size(), Some(0.0625));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parts {
    tau: f64,
    /// The next part has size `tau / 2^depth`,
    depth: u32,
    /// none is smaller than `tau / 2^deepest`,
    deepest: u32,
    /// and so many of those are made.
    done: u64,
    /// Parts to be made before one is longer than the one before.
    wait: u32,
}

impl Parts {
    /// A step of size `tau`, the first part of which is at most of size `first`; no part is smaller than `least`.
    ///
    /// # Errors
    /// [`Error::Parameter`] unless all are positive and finite, and `least` neither larger than `first` and `tau` nor smaller than
    /// `tau / 2^48`.
    pub fn new(tau: f64, first: f64, least: f64) -> Result<Self, Error> {
        for (name, value) in [("tau", tau), ("first part", first), ("least part", least)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::Parameter {
                    name,
                    value,
                    expected: "positive and finite",
                });
            }
        }
        let deepest = (tau / least).log2().floor();
        let depth = (tau / first).log2().ceil().max(0.0);
        if deepest < depth || deepest > f64::from(DEEPEST) {
            return Err(Error::Parameter {
                name: "least part",
                value: least,
                expected: "at most the first part and the time step, at least 2^-48 of the latter",
            });
        }
        Ok(Self {
            tau,
            depth: depth as u32,
            deepest: deepest as u32,
            done: 0,
            wait: 0,
        })
    }

    /// Size of the next part, unless the step is complete.
    pub fn next_size(&self) -> Option<f64> {
        (self.done < 1 << self.deepest).then(|| self.size())
    }

    /// How much of the step is made, from 0 to 1.
    pub fn progress(&self) -> f64 {
        self.done as f64 / (1_u64 << self.deepest) as f64
    }

    /// The size that a next part would have, also after the end: what a next step can begin with.
    pub fn size(&self) -> f64 {
        self.tau / (1_u64 << self.depth) as f64
    }

    /// Takes note of a part.
    pub fn made(&mut self, part: &StepRecord) {
        let halvings = (self.tau / part.tau).log2().round();
        let depth = (halvings.max(0.0) as u32).min(self.deepest);
        self.wait = if depth > self.depth {
            PATIENCE
        } else {
            self.wait.saturating_sub(1)
        };
        self.depth = depth;
        self.done += 1 << (self.deepest - depth);
        let doubled = self.deepest - depth + 1;
        let (easy, hard) = (part.newton.newton <= EASY, part.newton.newton > HARD);
        if hard {
            self.depth = (depth + 1).min(self.deepest);
        } else if easy && self.wait == 0 && self.done.is_multiple_of(1 << doubled) {
            self.depth = depth.saturating_sub(1);
        }
    }
}

impl<const D: usize> WillmoreFlow<D> {
    /// One step of size `tau`, or where the minimization fails of half that size, and so on, but at most `halvings` times; the
    /// record says of which size.
    ///
    /// # Errors
    /// [`Error::TooStiff`] if the last one fails, too, and without halvings or for other reasons than [`Error::NotConverged`] and
    /// [`Error::NonFinite`] what [`Self::advance`] raises; the flow stays where it was.
    pub fn advance_halving(&mut self, tau: f64, halvings: u32) -> Result<StepRecord, Error> {
        let mut size = tau;
        let mut made = 0;
        loop {
            match self.advance(size) {
                Err(source @ (Error::NotConverged { .. } | Error::NonFinite { .. })) => {
                    if halvings == 0 {
                        return Err(source);
                    }
                    if made == halvings {
                        return Err(Error::TooStiff {
                            step: self.steps() + 1,
                            tau: size,
                            halvings,
                            source: Box::new(source),
                        });
                    }
                    size *= 0.5;
                    made += 1;
                }
                other => return other,
            }
        }
    }

    /// The next part of a step, or nothing if it is complete.
    ///
    /// # Errors
    /// As [`Self::advance_halving`]; the flow and the parts stay where they were.
    pub fn advance_part(&mut self, parts: &mut Parts) -> Result<Option<StepRecord>, Error> {
        let Some(size) = parts.next_size() else {
            return Ok(None);
        };
        let record = self.advance_halving(size, parts.deepest - parts.depth)?;
        parts.made(&record);
        Ok(Some(record))
    }

    /// All that is left of a step, part by part.
    ///
    /// # Errors
    /// As [`Self::advance_part`]; the flow and `parts` stay after the last part that succeeded.
    pub fn advance_in_parts(&mut self, parts: &mut Parts) -> Result<Vec<StepRecord>, Error> {
        let mut records = Vec::new();
        while let Some(record) = self.advance_part(parts)? {
            records.push(record);
        }
        Ok(records)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Exit, NewtonInfo, PhaseTimes};

    fn record(tau: f64, newton: usize) -> StepRecord {
        StepRecord {
            step: 1,
            time: 0.0,
            tau,
            energy_before: 1.0,
            energy: 1.0,
            willmore_energy: 1.0,
            perimeter: 1.0,
            volume: 1.0,
            newton: NewtonInfo {
                exit: Exit::Converged,
                newton,
                hvp: 0,
                values: 0,
                gradients: 0,
                negative_curvature: 0,
                energy_before: 1.0,
                energy: 1.0,
                estimate: 0.0,
            },
            seconds: 0.0,
            times: PhaseTimes::default(),
        }
    }

    /// The sizes in units of the step, where the minimization of a part takes as many Newton steps as `newton` says, or fails.
    fn sizes(parts: &mut Parts, newton: impl Fn(f64, f64) -> Option<usize>) -> Vec<f64> {
        let mut sizes = Vec::new();
        while let Some(mut size) = parts.next_size() {
            let count = loop {
                match newton(parts.progress(), size / parts.tau) {
                    Some(count) => break count,
                    None => size *= 0.5,
                }
            };
            parts.made(&record(size, count));
            sizes.push(size / parts.tau);
        }
        sizes
    }

    #[test]
    fn easy_parts_grow_and_fill_the_step() {
        let tau = 0.3;
        let mut parts = Parts::new(tau, 0.1, 1e-3).unwrap();
        let made = sizes(&mut parts, |_, _| Some(3));
        assert_eq!(made, [0.25, 0.25, 0.5]);
        assert_eq!(parts.next_size(), None);
        assert_eq!(parts.size().to_bits(), tau.to_bits());
        // A first part as long as the step is the step.
        let mut whole = Parts::new(tau, 2.0 * tau, 1e-3).unwrap();
        assert_eq!(sizes(&mut whole, |_, _| Some(30)), [1.0]);
        assert_eq!(whole.size().to_bits(), (0.5 * tau).to_bits());
    }

    #[test]
    fn hard_and_failing_parts_shrink_and_nothing_is_left_out() {
        // Hard up to one half, failing above 1/16 in the third quarter.
        let newton = |progress: f64, size: f64| match progress {
            p if p < 0.5 => Some(21),
            p if p < 0.75 => (size <= 0.0625).then_some(2),
            _ => Some(12),
        };
        let mut parts = Parts::new(1.0, 0.125, 1.0 / 64.0).unwrap();
        let made = sizes(&mut parts, newton);
        assert!((made.iter().sum::<f64>() - 1.0).abs() <= 0.0);
        assert!(made.iter().all(|size| *size >= 1.0 / 64.0));
        assert!(made.windows(2).all(|pair| pair[1] <= 2.0 * pair[0]));
        assert!(made.contains(&(1.0 / 64.0)) && made.contains(&0.0625));
    }

    #[test]
    fn the_records_restore_the_parts() {
        let start = Parts::new(1.0, 0.01, 1e-4).unwrap();
        let newton = |k: usize| [3, 9, 25, 2, 2][k % 5];
        let (mut parts, mut records) = (start, Vec::new());
        while let Some(size) = parts.next_size() {
            let mut restored = start;
            for part in &records {
                restored.made(part);
            }
            assert_eq!(restored, parts);
            // Some fail once.
            let size = if records.len() % 7 == 5 {
                0.5 * size
            } else {
                size
            };
            records.push(record(size, newton(records.len())));
            parts.made(&records[records.len() - 1]);
        }
        assert!(records.len() > 5);
    }

    #[test]
    fn sizes_that_cannot_be() {
        for (tau, first, least) in [
            (0.0, 1.0, 0.1),
            (1.0, f64::NAN, 0.1),
            (1.0, 0.1, 0.2),
            (1.0, 2.0, 1.5),
            (1.0, 0.1, 1e-15),
        ] {
            let error = Parts::new(tau, first, least).unwrap_err();
            assert!(matches!(error, Error::Parameter { .. }), "{error}");
        }
    }
}
