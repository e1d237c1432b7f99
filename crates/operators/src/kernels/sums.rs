//! Sums over all entries.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{threads_for, values};

/// A sum is shared by at most this many threads. Burn's own sum of everything has a thousand.
const PARTS: usize = 1 << 15;

/// Parts of `sum a b`, or of `sum a`, which are to be summed.
pub(crate) fn partial_sums(a: CubeTensor, b: Option<CubeTensor>) -> CubeTensor {
    let (client, dtype, len) = (a.client.clone(), a.dtype, a.shape().num_elements());
    if let Some(b) = &b {
        assert_eq!(a.shape(), b.shape(), "factors have the same shape");
    }
    // Every place is counted in 32 bits, also behind the last one.
    assert!(
        u32::try_from(len + PARTS).is_ok(),
        "kernels count in 32 bits"
    );
    let parts = PARTS.min(len);
    let shape = [parts].into();
    let sums = empty_device_contiguous_dtype(client.clone(), a.device.clone(), shape, dtype);
    let (count, threads) = threads_for(&client, parts);
    let product = b.is_some();
    let b = b.unwrap_or_else(|| a.clone());
    partial_sum::launch(
        &client,
        count,
        threads,
        values(a, dtype),
        values(b, dtype),
        values(sums.clone(), dtype),
        len,
        parts,
        product,
        dtype_to_storage_type(dtype),
    );
    sums
}

#[cube(launch)]
fn partial_sum<E: Float>(
    a: &[E],
    b: &[E],
    sums: &mut [E],
    len: usize,
    parts: usize,
    #[comptime] product: bool,
    #[define(E)] _dtype: ElemType,
) {
    if ABSOLUTE_POS >= parts {
        terminate!();
    }
    let mut sum = E::new(0.0);
    let mut entry = ABSOLUTE_POS;
    while entry < len {
        let value = a[entry];
        if comptime!(product) {
            sum += value * b[entry];
        } else {
            sum += value;
        }
        entry += parts;
    }
    sums[ABSOLUTE_POS] = sum;
}
