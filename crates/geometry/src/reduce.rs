//! Parallel sums whose result does not depend on the number of threads.

use rayon::prelude::*;

/// Terms per partial sum; fixed, so that the order of additions is.
const CHUNK: usize = 4096;

/// `sum of term(i) for i in 0..len`: partial sums over fixed chunks, added in order.
pub(crate) fn sum(len: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let partial: Vec<f64> = (0..len.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            (chunk * CHUNK..len.min((chunk + 1) * CHUNK))
                .map(&term)
                .sum()
        })
        .collect();
    // Not `sum`, which is -0.0 of nothing.
    partial.iter().fold(0.0, |total, part| total + part)
}
