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

/// `sum a b`, accumulated in double precision, with the same result whatever the number of threads.
pub fn dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    let arch = Arch::new();
    let part = |(a, b): (&[T], &[T])| arch.dispatch(|| part_of_dot(a, b));
    if a.len() < PARALLEL_FROM {
        return a.chunks(CHUNK).zip(b.chunks(CHUNK)).map(part).sum();
    }
    let parts: Vec<f64> = (a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)))
        .map(part)
        .collect();
    parts.iter().sum()
}

/// `sum a b` of a few entries: eight sums side by side, in a fixed order.
#[inline(always)]
fn part_of_dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    let mut sums = [0.0; 8];
    let (blocks_a, rest_a) = a.as_chunks::<8>();
    let (blocks_b, rest_b) = b.as_chunks::<8>();
    for (a, b) in blocks_a.iter().zip(blocks_b) {
        for k in 0..8 {
            sums[k] += a[k].double() * b[k].double();
        }
    }
    let rest: f64 = (rest_a.iter().zip(rest_b))
        .map(|(a, b)| a.double() * b.double())
        .sum();
    sums.iter().sum::<f64>() + rest
}

/// `sum a`, accumulated in double precision, eight sums side by side in a fixed order.
#[inline(always)]
pub(crate) fn sum<T: Real>(a: &[T]) -> f64 {
    let mut sums = [0.0; 8];
    let (blocks, rest) = a.as_chunks::<8>();
    for block in blocks {
        for k in 0..8 {
            sums[k] += block[k].double();
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|x| x.double()).sum::<f64>()
}

/// `f(a_i)`
pub(crate) fn map<T: Real>(a: &[T], f: impl Fn(T) -> T + Sync) -> Vec<T> {
    filled(a.len(), CHUNK, |number, result| {
        for (result, a) in result.iter_mut().zip(&a[number * CHUNK..]) {
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
