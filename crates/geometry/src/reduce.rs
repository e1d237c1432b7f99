//! Parallel sums whose result does not depend on the number of threads.

use rayon::prelude::*;

/// Terms per partial sum; fixed, so that the order of additions is.
const CHUNK: usize = 4096;

/// `sum of term(i) for i in 0..len`: partial sums over fixed chunks, added in order.
pub(crate) fn sum(len: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let part = |chunk| {
        (chunk * CHUNK..len.min((chunk + 1) * CHUNK))
            .map(&term)
            .sum()
    };
    let parts: Vec<f64> = (0..len.div_ceil(CHUNK)).into_par_iter().map(part).collect();
    total(&parts)
}

/// Replaces values, and sums the squares of their changes as [`sum`] does. `fill` changes copies of those from a place on.
pub(crate) fn replace(values: &mut [f64], fill: impl Fn(usize, &mut [f64]) + Sync) -> f64 {
    let part = |(chunk, values): (usize, &mut [f64])| {
        let mut now = values.to_vec();
        fill(chunk * CHUNK, &mut now);
        let pairs = values.iter_mut().zip(now);
        pairs
            .map(|(value, now)| {
                let change = now - *value;
                *value = now;
                change * change
            })
            .sum()
    };
    let chunks = values.par_chunks_mut(CHUNK).enumerate();
    let parts: Vec<f64> = chunks.map(part).collect();
    total(&parts)
}

/// Not `sum`, which is -0.0 of nothing.
fn total(parts: &[f64]) -> f64 {
    parts.iter().fold(0.0, |total, part| total + part)
}
