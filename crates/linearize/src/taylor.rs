//! Taylor tests: does a derivative belong to a function?
//!
//! For `φ(t) = E(u + t p)` with a derivative `φ′(0) = ⟨∇E(u), p⟩`, the remainder
//! `|φ(t) − φ(0) − t φ′(0)|` decays like `t²`; with the second derivative `φ″(0) = ⟨p, ∇²E(u) p⟩`
//! as well, `|φ(t) − φ(0) − t φ′(0) − ½t² φ″(0)|` decays like `t³`. A wrong derivative shows as a
//! rate of one less. The remainder cannot fall below the rounding error of `φ`, so steps that come
//! close to it are left out.
//!
//! ```
//! use burn_linearize::taylor::{remainder, halvings};
//!
//! let steps = halvings(0.5, 12);
//! let cos_at_one = |t: f64| (1.0 + t).cos();
//! let slope = -(1.0_f64).sin();
//! let right = remainder(cos_at_one, &[slope], &steps, f64::EPSILON);
//! assert!((right.rate().unwrap() - 2.0).abs() < 0.1);
//! let wrong = remainder(cos_at_one, &[slope + 0.01], &steps, f64::EPSILON);
//! assert!(!wrong.is_consistent(0.2));
//! ```

/// How far above the rounding error of `φ` a remainder must be to count, so that its logarithm is
/// good to a few percent.
const MARGIN: f64 = 64.0;

/// Remainders of a Taylor expansion at decreasing steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Remainder {
    /// Number of derivatives used.
    pub order: usize,
    /// Steps, as given.
    pub steps: Vec<f64>,
    /// Remainder at each step.
    pub remainders: Vec<f64>,
    /// Remainders below this are mostly rounding error.
    pub floor: f64,
}

/// `first`, `first/2`, `first/4`, …
pub fn halvings(first: f64, count: usize) -> Vec<f64> {
    std::iter::successors(Some(first), |step| Some(step / 2.0))
        .take(count)
        .collect()
}

/// Remainders of the expansion of `value` about 0 with the given derivatives `φ′(0), φ″(0), …`.
///
/// `precision` is the relative accuracy of `value`, for instance `f64::EPSILON`.
pub fn remainder(
    mut value: impl FnMut(f64) -> f64,
    derivatives: &[f64],
    steps: &[f64],
    precision: f64,
) -> Remainder {
    let start = value(0.0);
    let mut largest = start.abs();
    let remainders = steps
        .iter()
        .map(|&t| {
            let there = value(t);
            largest = largest.max(there.abs());
            let mut power = 1.0;
            let mut rest = there - start;
            for (k, derivative) in derivatives.iter().enumerate() {
                power *= t / (k + 1) as f64;
                rest -= power * derivative;
            }
            rest.abs()
        })
        .collect();
    Remainder {
        order: derivatives.len(),
        steps: steps.to_vec(),
        remainders,
        floor: MARGIN * precision * largest,
    }
}

impl Remainder {
    /// Observed rates between successive steps, up to where rounding takes over.
    pub fn rates(&self) -> Vec<f64> {
        let usable = self
            .remainders
            .iter()
            .take_while(|r| r.is_finite() && **r > self.floor)
            .count();
        (1..usable)
            .map(|i| {
                let decay = self.remainders[i - 1] / self.remainders[i];
                decay.ln() / (self.steps[i - 1] / self.steps[i]).ln()
            })
            .collect()
    }

    /// Observed rate: the median of the last three. `None` if the remainder is rounding error from
    /// the second step on, as for a polynomial of degree [`order`](Self::order).
    pub fn rate(&self) -> Option<f64> {
        let rates = self.rates();
        let mut last: Vec<f64> = rates.iter().rev().take(3).copied().collect();
        last.sort_by(f64::total_cmp);
        last.get(last.len() / 2).copied()
    }

    /// Whether the remainder decays at least like `t^(order + 1 − tolerance)`, or is nothing but
    /// rounding error.
    pub fn is_consistent(&self, tolerance: f64) -> bool {
        if self.remainders.iter().any(|r| !r.is_finite()) {
            return false;
        }
        match self.rate() {
            Some(rate) => rate >= (self.order + 1) as f64 - tolerance,
            None => self.remainders.last().is_some_and(|r| *r <= self.floor),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_tell_right_from_wrong_derivatives() {
        let steps = halvings(0.25, 16);
        let value = |t: f64| (0.3 + t).exp();
        let d = 0.3_f64.exp();
        let first = remainder(value, &[d], &steps, f64::EPSILON);
        let second = remainder(value, &[d, d], &steps, f64::EPSILON);
        assert!((first.rate().unwrap() - 2.0).abs() < 0.05, "{first:?}");
        assert!((second.rate().unwrap() - 3.0).abs() < 0.1, "{second:?}");
        let wrong = remainder(value, &[d, d * 1.001], &steps, f64::EPSILON);
        assert!((wrong.rate().unwrap() - 2.0).abs() < 0.3, "{wrong:?}");
        assert!(!wrong.is_consistent(0.3));
    }

    #[test]
    fn polynomials_of_the_order_are_consistent_without_a_rate() {
        let steps = halvings(0.5, 8);
        let square = |t: f64| (1.0 + t) * (1.0 + t);
        let exact = remainder(square, &[2.0, 2.0], &steps, f64::EPSILON);
        assert_eq!(exact.rate(), None);
        assert!(exact.is_consistent(0.1));
        assert!(!remainder(square, &[2.0, 2.1], &steps, f64::EPSILON).is_consistent(0.1));
    }

    #[test]
    fn not_a_number_is_inconsistent() {
        let steps = halvings(0.5, 8);
        let root = |t: f64| (t - 0.1).sqrt();
        assert!(!remainder(root, &[1.0], &steps, f64::EPSILON).is_consistent(0.1));
    }
}
