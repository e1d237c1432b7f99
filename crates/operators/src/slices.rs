//! Passes over vectors in the memory of the host, on all cores.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions that were detected"
)]

use pulp::Arch;
use rayon::prelude::*;

use crate::fft::Real;
use crate::fresh::{PARALLEL_FROM, filled};

/// Entries per task; sums are taken in this order whatever the number of threads.
const CHUNK: usize = 1 << 14;
/// Entries of new vectors per task: what is zeroed before it is written stays in the fastest cache.
const PIECE: usize = 1 << 11;

/// `sum a b`, accumulated in double precision, with the same result whatever the number of threads.
pub fn dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    summed(a, b, |a, b| a.double() * b.double())
}

/// `sum (a - b)^2`, likewise.
pub fn squared_distance<T: Real>(a: &[T], b: &[T]) -> f64 {
    summed(a, b, |a, b| {
        let difference = (a - b).double();
        difference * difference
    })
}

fn summed<T: Real>(a: &[T], b: &[T], f: impl Fn(T, T) -> f64 + Copy + Sync) -> f64 {
    let arch = Arch::new();
    let part = |(a, b): (&[T], &[T])| arch.dispatch(|| part_of_sum(a, b, f));
    if a.len() < PARALLEL_FROM {
        return a.chunks(CHUNK).zip(b.chunks(CHUNK)).map(part).sum();
    }
    let parts: Vec<f64> = (a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)))
        .map(part)
        .collect();
    parts.iter().sum()
}

/// The sum over a few entries: eight sums side by side, in a fixed order.
#[inline(always)]
fn part_of_sum<T: Real>(a: &[T], b: &[T], f: impl Fn(T, T) -> f64) -> f64 {
    let mut sums = [0.0; 8];
    let (blocks_a, rest_a) = a.as_chunks::<8>();
    let (blocks_b, rest_b) = b.as_chunks::<8>();
    for (a, b) in blocks_a.iter().zip(blocks_b) {
        for k in 0..8 {
            sums[k] += f(a[k], b[k]);
        }
    }
    let rest = rest_a.iter().zip(rest_b).map(|(a, b)| f(*a, *b));
    sums.iter().sum::<f64>() + rest.sum::<f64>()
}

/// A sum that is accumulated in double precision, eight sums side by side in a fixed order.
#[derive(Clone, Default)]
pub(crate) struct Sum {
    sums: [f64; 8],
    rest: f64,
}

impl Sum {
    /// Adds entries; their number is a multiple of eight but for the last ones.
    #[inline(always)]
    pub(crate) fn add<T: Real>(&mut self, a: &[T]) {
        let (blocks, rest) = a.as_chunks::<8>();
        let mut sums = self.sums;
        for block in blocks {
            for k in 0..8 {
                sums[k] += block[k].double();
            }
        }
        self.sums = sums;
        self.rest += rest.iter().map(|x| x.double()).sum::<f64>();
    }

    pub(crate) fn total(self) -> f64 {
        self.sums.iter().sum::<f64>() + self.rest
    }
}

/// `f(a_i)`
pub(crate) fn map<T: Real, U: Real>(a: &[T], f: impl Fn(T) -> U + Sync) -> Vec<U> {
    filled(a.len(), PIECE, |number, result| {
        for (result, a) in result.iter_mut().zip(&a[number * PIECE..]) {
            *result = f(*a);
        }
    })
}

/// `a_i <- f(a_i, b_i)`
pub fn zip_apply<T: Real>(a: &mut [T], b: &[T], f: impl Fn(T, T) -> T + Sync) {
    over_chunks(a, b, &|a, b| {
        for (a, b) in a.iter_mut().zip(b) {
            *a = f(*a, *b);
        }
    });
}

/// Compiled once, not for every `f`: `work` is called through a pointer.
pub(crate) fn over_chunks<T: Real>(a: &mut [T], b: &[T], work: &(dyn Fn(&mut [T], &[T]) + Sync)) {
    if a.len() < PARALLEL_FROM {
        work(a, b);
    } else {
        a.par_chunks_mut(CHUNK)
            .zip(b.par_chunks(CHUNK))
            .for_each(|(a, b)| work(a, b));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise;

    #[test]
    fn distances_are_those_of_the_difference_bit_by_bit() {
        for len in [5, 100, PARALLEL_FROM + 11] {
            let (a, b) = (noise(len, 1), noise(len, 2));
            let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            let expected = dot(&difference, &difference);
            assert_eq!(squared_distance(&a, &b).to_bits(), expected.to_bits());
            let direct: f64 = difference.iter().map(|x| x * x).sum();
            assert!(
                (expected - direct).abs() < 1e-12 * direct,
                "{expected} {direct}"
            );
        }
    }

    #[test]
    fn sums_of_pieces_are_those_of_the_whole() {
        let a = noise(1003, 3);
        let whole = whole_of(&a);
        let mut pieces = Sum::default();
        a.chunks(256).for_each(|piece| pieces.add(piece));
        assert_eq!(whole.to_bits(), pieces.total().to_bits());
        let direct: f64 = a.iter().sum();
        assert!((direct - whole).abs() < 1e-12, "{direct}");
    }

    fn whole_of(a: &[f64]) -> f64 {
        let mut sum = Sum::default();
        sum.add(a);
        sum.total()
    }
}
