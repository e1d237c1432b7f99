//! Time steps made in substeps of adaptive size.
//!
//! A large step from a shape with corners is too much for one minimization: the corners move by many widths of the interface,
//! and the minimizer is in another valley. In substeps that begin small and grow it is reached.

use geometry::{positive, require};

use crate::{Error, Record};

/// Steps and substeps of adaptive size grow while the minimization takes at most this many Newton steps,
pub(crate) const EASY: usize = 8;
/// and shrink when it takes more than this.
pub(crate) const HARD: usize = 20;
/// After a failure so many substeps are made before a longer one is tried again: failures are dear.
const PATIENCE: u32 = 4;
/// A substep is halved at most this often with respect to the first one.
const HALVINGS: i32 = 12;
/// Sizes are the step's divided by `2^k`, `k` at most this, so that places in a step are exact numbers.
const DEEPEST: u32 = 48;

/// A time step of size `tau` that is made in substeps, and where in it the flow is.
///
/// Sizes are `tau / 2^k`, and a substep begins at a multiple of its size: the substeps add up to `tau` without rounding, none goes
/// beyond it, and every `tau / 2^k` not smaller than the first substep is the end of one. After a substep that took few Newton steps
/// the next one is twice as long, after one that took many half as long, as far as that rule allows; after a failure that takes
/// a few substeps longer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Substeps {
    tau: f64,
    /// The next substep has size `tau / 2^depth`,
    depth: u32,
    /// none is smaller than `tau / 2^deepest`,
    deepest: u32,
    /// and so many of those are made.
    done: u64,
    /// Substeps to be made before one is longer than the one before.
    wait: u32,
}

impl Substeps {
    /// A step of size `tau`, the first substep of which is at most of size `first`; none is smaller than `2^-12` of `scale`.
    pub(crate) fn new(tau: f64, first: f64, scale: f64) -> Result<Self, Error> {
        positive("tau", tau)?;
        positive("first substep", first)?;
        positive("substep", scale)?;
        let deepest = (tau / (scale * 2.0_f64.powi(-HALVINGS))).log2().floor();
        let depth = (tau / first).log2().ceil().max(0.0);
        require(
            "substep",
            scale,
            "at most the first substep and the time step, at least 2^-36 of the latter",
            |scale| scale <= first.min(tau) && deepest <= f64::from(DEEPEST),
        )?;
        Ok(Self {
            tau,
            depth: depth as u32,
            deepest: deepest as u32,
            done: 0,
            wait: 0,
        })
    }

    pub(crate) fn is_complete(&self) -> bool {
        self.done >= 1 << self.deepest
    }

    /// The size of the next substep, also after the end: what a next step can begin with.
    pub(crate) fn size(&self) -> f64 {
        self.tau / (1_u64 << self.depth) as f64
    }

    /// How often that may be halved.
    pub(crate) fn halvings(&self) -> u32 {
        self.deepest - self.depth
    }

    /// Moves on by a substep and chooses the size of the next one.
    pub(crate) fn made(&mut self, record: &Record) {
        let halvings = (self.tau / record.tau).log2().round();
        let depth = (halvings.max(0.0) as u32).min(self.deepest);
        self.wait = if depth > self.depth {
            PATIENCE
        } else {
            self.wait.saturating_sub(1)
        };
        self.depth = depth;
        self.done += 1 << (self.deepest - depth);
        let doubled = self.deepest - depth + 1;
        let newton = record.minimization.map_or(0, |made| made.newton.newton);
        if newton > HARD {
            self.depth = (depth + 1).min(self.deepest);
        } else if newton <= EASY && self.wait == 0 && self.done.is_multiple_of(1 << doubled) {
            self.depth = depth.saturating_sub(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::record;

    fn progress(substeps: &Substeps) -> f64 {
        substeps.done as f64 / (1_u64 << substeps.deepest) as f64
    }

    /// The sizes in units of the step, where the minimization of a substep takes as many Newton steps as `newton` says, or fails.
    fn sizes(substeps: &mut Substeps, newton: impl Fn(f64, f64) -> Option<usize>) -> Vec<f64> {
        let mut sizes = Vec::new();
        while !substeps.is_complete() {
            let mut size = substeps.size();
            let count = loop {
                match newton(progress(substeps), size / substeps.tau) {
                    Some(count) => break count,
                    None => size *= 0.5,
                }
            };
            substeps.made(&record(size, count));
            sizes.push(size / substeps.tau);
        }
        sizes
    }

    #[test]
    fn easy_substeps_grow_and_fill_the_step() {
        let tau = 0.3;
        let mut substeps = Substeps::new(tau, 0.1, 0.1).unwrap();
        let made = sizes(&mut substeps, |_, _| Some(3));
        assert_eq!(made, [0.25, 0.25, 0.5]);
        assert_eq!(substeps.size().to_bits(), tau.to_bits());
        // A first substep as long as the step is the step.
        let mut whole = Substeps::new(tau, 2.0 * tau, tau).unwrap();
        assert_eq!(sizes(&mut whole, |_, _| Some(30)), [1.0]);
        assert_eq!(whole.size().to_bits(), (0.5 * tau).to_bits());
    }

    #[test]
    fn hard_and_failing_substeps_shrink_and_nothing_is_left_out() {
        // Hard up to one half, failing above 1/16 in the third quarter.
        let newton = |progress: f64, size: f64| match progress {
            p if p < 0.5 => Some(21),
            p if p < 0.75 => (size <= 0.0625).then_some(2),
            _ => Some(12),
        };
        let mut substeps = Substeps {
            deepest: 6,
            ..Substeps::new(1.0, 0.125, 0.125).unwrap()
        };
        let made = sizes(&mut substeps, newton);
        assert!((made.iter().sum::<f64>() - 1.0).abs() <= 0.0);
        assert!(made.iter().all(|size| *size >= 1.0 / 64.0));
        assert!(made.windows(2).all(|pair| pair[1] <= 2.0 * pair[0]));
        assert!(made.contains(&(1.0 / 64.0)) && made.contains(&0.0625));
    }

    #[test]
    fn the_records_restore_the_substeps() {
        let start = Substeps {
            deepest: 13,
            ..Substeps::new(1.0, 0.01, 0.01).unwrap()
        };
        let newton = |k: usize| [3, 9, 25, 2, 2][k % 5];
        let (mut substeps, mut records) = (start, Vec::new());
        while !substeps.is_complete() {
            let mut restored = start;
            for record in &records {
                restored.made(record);
            }
            assert_eq!(restored, substeps);
            // Some fail once.
            let part = if records.len() % 7 == 5 { 0.5 } else { 1.0 };
            records.push(record(part * substeps.size(), newton(records.len())));
            substeps.made(&records[records.len() - 1]);
        }
        assert!(records.len() > 5);
    }

    #[test]
    fn sizes_that_cannot_be() {
        for (tau, first, scale) in [
            (0.0, 1.0, 0.1),
            (1.0, f64::NAN, 0.1),
            (1.0, 0.1, 0.2),
            (1.0, 2.0, 1.5),
            (1.0, 0.1, 1e-12),
        ] {
            let error = Substeps::new(tau, first, scale).unwrap_err();
            assert!(matches!(error, Error::Geometry(_)), "{error}");
        }
    }
}
