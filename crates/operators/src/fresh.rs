//! Vectors that tasks fill piece by piece, without a pass over memory that zeroes them first.

use std::mem::MaybeUninit;

use bytemuck::Pod;
use rayon::prelude::*;

/// Shorter vectors are filled on one thread.
pub(crate) const PARALLEL_FROM: usize = 1 << 15;

/// A vector of this length, filled in pieces of this size by calls with the number of the piece and its entries, which are zeros. A piece is
/// zeroed right before it is filled, while it comes to the cache anyway.
pub(crate) fn filled<T: Pod + Send>(
    len: usize,
    size: usize,
    fill: impl Fn(usize, &mut [T]) + Sync,
) -> Vec<T> {
    let mut values = Vec::new();
    let room = room(&mut values, len);
    let fill = |(number, piece)| fill(number, zeroed(piece));
    if len < PARALLEL_FROM {
        room.chunks_mut(size).enumerate().for_each(fill);
    } else {
        room.par_chunks_mut(size).enumerate().for_each(fill);
    }
    #[allow(unsafe_code, reason = "the standard library has no safe way")]
    // SAFETY: all pieces were zeroed.
    unsafe {
        values.set_len(len);
    }
    values
}

/// Room for the entries of a vector that is empty.
pub(crate) fn room<T>(values: &mut Vec<T>, len: usize) -> &mut [MaybeUninit<T>] {
    values.reserve_exact(len);
    &mut values.spare_capacity_mut()[..len]
}

/// Zeros in place of what memory holds.
pub(crate) fn zeroed<T: Pod>(piece: &mut [MaybeUninit<T>]) -> &mut [T] {
    piece.fill(MaybeUninit::new(T::zeroed()));
    #[allow(unsafe_code, reason = "the standard library has no safe way")]
    // SAFETY: all entries were just written.
    unsafe {
        std::slice::from_raw_parts_mut(piece.as_mut_ptr().cast(), piece.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_zero_and_then_filled_once() {
        for len in [0, 1, 100, PARALLEL_FROM + 7] {
            let values = filled(len, 64, |number, piece: &mut [f32]| {
                for (k, entry) in piece.iter_mut().enumerate() {
                    *entry += (64 * number + k) as f32;
                }
            });
            let expected: Vec<f32> = (0..len).map(|k| k as f32).collect();
            assert_eq!(values, expected);
        }
    }
}
