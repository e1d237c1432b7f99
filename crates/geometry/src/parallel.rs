//! Loops on all cores whose results do not depend on the number of threads.
//!
//! The work is called through a pointer, so that a loop is compiled once and not again for every closure: these loops were a third of the
//! code of a program.

use rayon::prelude::*;

/// Values per task, and terms per partial sum; fixed, so that the order of additions is.
pub(crate) const CHUNK: usize = 4096;

/// Writes the values from an index on.
pub type Reader<'a> = dyn Fn(usize, &mut [f64]) + Sync + 'a;

/// Calls `work` with the first index and the values of each `chunk` in a row.
pub fn over_chunks<T: Send>(
    values: &mut [T],
    chunk: usize,
    work: &(dyn Fn(usize, &mut [T]) + Sync + '_),
) {
    let chunks = values.par_chunks_mut(chunk).enumerate();
    chunks.for_each(|(number, part)| work(number * chunk, part));
}

/// `f(0), f(1), ...`, where one value alone is worth a call. At least `share` of them make a task.
pub fn map<T: Send>(len: usize, share: usize, f: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let indices = (0..len).into_par_iter().with_min_len(share);
    indices.map(f).collect()
}

/// Calls `work` with each index. At least `share` of them make a task.
pub(crate) fn over(len: usize, share: usize, work: &(dyn Fn(usize) + Sync)) {
    let indices = (0..len).into_par_iter().with_min_len(share);
    indices.for_each(work);
}

/// Those of `f(0), f(1), ...` that there are, in this order.
pub fn filter_map<T: Send>(
    len: usize,
    share: usize,
    f: &(dyn Fn(usize) -> Option<T> + Sync),
) -> Vec<T> {
    let indices = (0..len).into_par_iter().with_min_len(share);
    indices.filter_map(f).collect()
}

/// `f(0), f(1), ...`, where one value is little work.
pub fn values(len: usize, f: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
    let mut values = vec![0.0; len];
    over_chunks(&mut values, CHUNK, &|first, part| {
        for (value, index) in part.iter_mut().zip(first..) {
            *value = f(index);
        }
    });
    values
}

/// `sum of term(i) for i in 0..len`: partial sums over fixed chunks, added in order.
pub(crate) fn sum(len: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let parts = map(len.div_ceil(CHUNK), 1, &|chunk| {
        (chunk * CHUNK..len.min((chunk + 1) * CHUNK))
            .map(&term)
            .sum()
    });
    total(&parts)
}

/// The sum of the squares of the differences of so many values that two functions write, in the order of [`sum`].
pub(crate) fn squared_distance(len: usize, a: &Reader<'_>, b: &Reader<'_>) -> f64 {
    let parts = map(len.div_ceil(CHUNK), 1, &|chunk| {
        let first = chunk * CHUNK;
        let [a, b] = [a, b].map(|read| {
            let mut values = vec![0.0; CHUNK.min(len - first)];
            read(first, &mut values);
            values
        });
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| (a - b) * (a - b)).sum()
    });
    total(&parts)
}

/// Not `sum`, which is -0.0 of nothing.
fn total(parts: &[f64]) -> f64 {
    parts.iter().fold(0.0, |total, part| total + part)
}
