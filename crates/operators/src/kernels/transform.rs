//! Fourier transforms along an axis.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{launch, like};

/// The Fourier transform along one axis, not normalised, as the sum that it is. An imaginary part that is absent is zero; `roots` are those of
/// unity, `cos` and then `sin`.
pub(crate) fn transform(
    re: CubeTensor,
    im: Option<CubeTensor>,
    roots: CubeTensor,
    axis: usize,
    inverse: bool,
) -> (CubeTensor, CubeTensor) {
    let real = im.is_none();
    let re = into_contiguous(re);
    let im = im.map_or_else(|| re.clone(), into_contiguous);
    let (of_re, of_im) = (like(&re), like(&re));
    let (count, threads) = launch(&re);
    let dtype = dtype_to_storage_type(re.dtype);
    let shape = re.shape();
    let client = re.client.clone();
    transform_value::launch(
        &client,
        count,
        threads,
        re.into_buffer_arg(),
        im.into_buffer_arg(),
        roots.into_buffer_arg(),
        of_re.clone().into_buffer_arg(),
        of_im.clone().into_buffer_arg(),
        shape.num_elements(),
        shape[axis],
        shape[axis + 1..].iter().product(),
        real,
        inverse,
        dtype,
    );
    (of_re, of_im)
}

#[cube(launch)]
fn transform_value<E: Float>(
    re: &[E],
    im: &[E],
    roots: &[E],
    of_re: &mut [E],
    of_im: &mut [E],
    len: usize,
    n: usize,
    stride: usize,
    #[comptime] real: bool,
    #[comptime] inverse: bool,
    #[define(E)] _dtype: ElemType,
) {
    let place = ABSOLUTE_POS;
    if place >= len {
        terminate!();
    }
    let frequency = (place / stride) % n;
    let mut at = place - frequency * stride;
    // Which root comes next.
    let mut turn = 0usize;
    let mut sum_re = E::new(0.0);
    let mut sum_im = E::new(0.0);
    for _ in 0..n {
        let cos = roots[turn];
        let mut sin = roots[n + turn];
        // exp(-i t) forward, exp(i t) backward.
        if comptime!(inverse) {
            sin = E::new(0.0) - sin;
        }
        let x = re[at];
        sum_re += x * cos;
        sum_im -= x * sin;
        if comptime!(!real) {
            let y = im[at];
            sum_re += y * sin;
            sum_im += y * cos;
        }
        turn += frequency;
        turn = select(turn >= n, turn - n, turn);
        at += stride;
    }
    of_re[place] = sum_re;
    of_im[place] = sum_im;
}
