//! Loops on all cores whose results do not depend on the number of threads.
//!
//! The work is called through a pointer, so that the loop on all cores is compiled once and not again for every closure and type: these
//! loops were a third of the code of a program.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

/// Values per task, and terms per partial sum; fixed, so that the order of additions is.
pub(crate) const CHUNK: usize = 4096;
/// Tasks per thread, so that one that takes long delays little.
const PARTS_PER_THREAD: usize = 16;

/// Writes the values from an index on.
pub type Reader<'a> = dyn Fn(usize, &mut [f64]) + Sync + 'a;

/// Calls `work` with the first index and the values of each `chunk` in a row.
pub fn over_chunks<T: Send>(
    values: &mut [T],
    chunk: usize,
    work: &(dyn Fn(usize, &mut [T]) + Sync + '_),
) {
    let parts: Vec<Mutex<&mut [T]>> = values.chunks_mut(chunk).map(Mutex::new).collect();
    over(parts.len(), 1, &|number| {
        work(number * chunk, &mut lock(&parts[number]));
    });
}

/// `f(0), f(1), ...`, where one value alone is worth a call. At least `share` of them make a task.
pub fn map<T: Send>(len: usize, share: usize, f: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    collect(len, share, &|indices| indices.map(f).collect())
}

/// `f(0), f(1), ...` in a table, which holds `first` before. It takes half of the memory that [`map`] needs.
pub fn table<T: Copy + Send + Sync>(
    len: usize,
    share: usize,
    first: T,
    f: &(dyn Fn(usize) -> T + Sync),
) -> Vec<T> {
    let mut values = vec![first; len];
    over_chunks(&mut values, share, &|start, part| {
        for (value, index) in part.iter_mut().zip(start..) {
            *value = f(index);
        }
    });
    values
}

/// Calls `take` with those of `f(0), f(1), ...` that there are, in this order, and keeps only a part of them at a time.
pub fn in_order<T: Send>(
    len: usize,
    share: usize,
    f: &(dyn Fn(usize) -> Option<T> + Sync),
    mut take: impl FnMut(T),
) {
    let batch = share * PARTS_PER_THREAD;
    for start in (0..len).step_by(batch) {
        let of_batch = |index: usize| f(start + index);
        filter_map(batch.min(len - start), share, &of_batch)
            .into_iter()
            .for_each(&mut take);
    }
}

/// Those of `f(0), f(1), ...` that there are, in this order.
pub fn filter_map<T: Send>(
    len: usize,
    share: usize,
    f: &(dyn Fn(usize) -> Option<T> + Sync),
) -> Vec<T> {
    collect(len, share, &|indices| indices.filter_map(f).collect())
}

/// What `work` makes of ranges of indices below `len`, in their order.
fn collect<T: Send>(
    len: usize,
    share: usize,
    work: &(dyn Fn(Range<usize>) -> Vec<T> + Sync),
) -> Vec<T> {
    let part = share.max(len.div_ceil(PARTS_PER_THREAD * rayon::current_num_threads()));
    let parts: Vec<Mutex<Vec<T>>> = (0..len.div_ceil(part.max(1)))
        .map(|_| Mutex::default())
        .collect();
    over(parts.len(), 1, &|number| {
        let first = number * part;
        let made = work(first..len.min(first + part));
        *lock(&parts[number]) = made;
    });
    let made = |part: Mutex<Vec<T>>| part.into_inner().unwrap_or_else(PoisonError::into_inner);
    let mut parts: Vec<Vec<T>> = parts.into_iter().map(made).collect();
    if parts.len() == 1 {
        return parts.swap_remove(0);
    }
    let mut all = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    for mut made in parts {
        all.append(&mut made);
    }
    all
}

/// A part of the result, which one task alone writes: a task that panics ends the loop.
fn lock<T>(part: &Mutex<T>) -> MutexGuard<'_, T> {
    part.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Calls `work` with each index. At least `share` of them make a task.
pub(crate) fn over(len: usize, share: usize, work: &(dyn Fn(usize) + Sync)) {
    let indices = (0..len).into_par_iter().with_min_len(share);
    indices.for_each(work);
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
    sum_of_chunks(len, &|indices| indices.map(&term).sum())
}

/// The same, of partial sums that `part` makes of the indices of a chunk.
pub(crate) fn sum_of_chunks(len: usize, part: &(dyn Fn(Range<usize>) -> f64 + Sync)) -> f64 {
    let parts = map(len.div_ceil(CHUNK), 1, &|chunk| {
        part(chunk * CHUNK..len.min((chunk + 1) * CHUNK))
    });
    // Not `sum`, which is -0.0 of nothing.
    parts.iter().fold(0.0, |total, part| total + part)
}
