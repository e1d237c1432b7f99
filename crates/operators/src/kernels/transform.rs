//! Fourier transforms along an axis.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{launch, like};

/// Real and imaginary part.
type Parts = (CubeTensor, CubeTensor);

/// The Fourier transform along one axis, not normalised; an imaginary part that is absent is zero, and `roots` are those of unity, `cos` and then
/// `sin`.
///
/// With `n = a b` and `k = p + a q` it is `sum_j w^(j p) w^(j q a) sum_i x_(i b + j) w^(i p b)`, `w = exp(-2 pi i / n)`: sums of `a` and then of
/// `b` terms instead of `n`, whatever `n` is, and of `n` terms where it is prime.
pub(crate) fn transform(
    re: CubeTensor,
    im: Option<CubeTensor>,
    roots: &CubeTensor,
    axis: usize,
    inverse: bool,
) -> Parts {
    let n = re.shape()[axis];
    let a = (1..=n.isqrt())
        .rev()
        .find(|a| n.is_multiple_of(*a))
        .unwrap_or(1);
    if a == 1 {
        return sums((re, im), roots, axis, (1, n), false, inverse);
    }
    let (re, im) = sums((re, im), roots, axis, (a, n / a), true, inverse);
    sums((re, Some(im)), roots, axis, (a, n / a), false, inverse)
}

/// The inner sums, in the order `(p, j)`, or the outer ones.
fn sums(
    (re, im): (CubeTensor, Option<CubeTensor>),
    roots: &CubeTensor,
    axis: usize,
    (a, b): (usize, usize),
    inner: bool,
    inverse: bool,
) -> Parts {
    let real = im.is_none();
    let re = into_contiguous(re);
    let im = im.map_or_else(|| re.clone(), into_contiguous);
    let (of_re, of_im) = (like(&re), like(&re));
    let (count, threads) = launch(&re);
    let dtype = dtype_to_storage_type(re.dtype);
    let shape = re.shape();
    let client = re.client.clone();
    transform_sum::launch(
        &client,
        count,
        threads,
        re.into_buffer_arg(),
        im.into_buffer_arg(),
        roots.clone().into_buffer_arg(),
        of_re.clone().into_buffer_arg(),
        of_im.clone().into_buffer_arg(),
        shape.num_elements(),
        a,
        b,
        shape[axis + 1..].iter().product(),
        inner,
        real,
        inverse,
        dtype,
    );
    (of_re, of_im)
}

#[cube(launch)]
fn transform_sum<E: Float>(
    re: &[E],
    im: &[E],
    roots: &[E],
    of_re: &mut [E],
    of_im: &mut [E],
    len: usize,
    a: usize,
    b: usize,
    stride: usize,
    #[comptime] inner: bool,
    #[comptime] real: bool,
    #[comptime] inverse: bool,
    #[define(E)] _dtype: ElemType,
) {
    let place = ABSOLUTE_POS;
    if place >= len {
        terminate!();
    }
    let n = a * b;
    let along = (place / stride) % n;
    let line = place - along * stride;
    // Of the outer sums: where the first term is and how far apart they are, which root it has and by how much the next one is further, and
    // how many terms there are.
    let mut at = line + (along % a) * b * stride;
    let mut step = stride;
    let mut turn = 0usize;
    let mut turns = (along / a) * a;
    let mut terms = b;
    if comptime!(inner) {
        let p = along / b;
        let j = along % b;
        at = line + j * stride;
        step = b * stride;
        turn = (j * p) % n;
        turns = p * b;
        terms = a;
    }
    let mut sum_re = E::new(0.0);
    let mut sum_im = E::new(0.0);
    for _ in 0..terms {
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
        turn += turns;
        turn = select(turn >= n, turn - n, turn);
        at += step;
    }
    of_re[place] = sum_re;
    of_im[place] = sum_im;
}
