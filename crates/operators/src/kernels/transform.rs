//! Fourier transforms along an axis.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{like, threads_for, values};

/// Real and imaginary part.
type Parts = (CubeTensor, CubeTensor);

/// The Fourier transform along one axis, not normalized; an imaginary part that is absent is zero, and `roots` are those of unity, `cos` and then
/// `sin`.
///
/// It is one step of Cooley and Tukey. With `n = a b`, where `a` is the largest divisor up to `sqrt n`, and `k = p + a q` the transform is
/// `sum_j w^(j p) w^(j q a) sum_i x_(i b + j) w^(i p b)`, `w = exp(-2 pi i / n)`: inner sums of `a` terms and outer ones of `b`. Where `n` is prime,
/// there is one sum of `n` terms.
pub(crate) fn transform(
    re: CubeTensor,
    im: Option<CubeTensor>,
    roots: &CubeTensor,
    axis: usize,
    inverse: bool,
) -> Parts {
    let n = re.shape()[axis];
    let mut divisors = (1..=n.isqrt()).rev().filter(|a| n.is_multiple_of(*a));
    let a = divisors.next().unwrap_or(1);
    if a == 1 {
        return sums(re, im, roots, axis, [1, n], false, inverse);
    }
    let factors = [a, n / a];
    let (re, im) = sums(re, im, roots, axis, factors, true, inverse);
    sums(re, Some(im), roots, axis, factors, false, inverse)
}

/// The inner sums, in the order `(p, j)`, or the outer ones.
fn sums(
    re: CubeTensor,
    im: Option<CubeTensor>,
    roots: &CubeTensor,
    axis: usize,
    [a, b]: [usize; 2],
    inner: bool,
    inverse: bool,
) -> Parts {
    let real = im.is_none();
    let im = im.unwrap_or_else(|| re.clone());
    let (of_re, of_im) = (like(&re), like(&re));
    let (client, dtype, shape) = (re.client.clone(), re.dtype, re.shape());
    let (count, threads) = threads_for(&client, shape.num_elements());
    transform_sum::launch(
        &client,
        count,
        threads,
        values(re, dtype),
        values(im, dtype),
        values(roots.clone(), dtype),
        values(of_re.clone(), dtype),
        values(of_im.clone(), dtype),
        shape.num_elements(),
        a,
        b,
        shape[axis + 1..].iter().product(),
        inner,
        real,
        inverse,
        dtype_to_storage_type(dtype),
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
    // The outer sums: the index of the first term and how far the next one is, the root of the first one and how far the next one is.
    let mut index = line + (along % a) * b * stride;
    let mut index_step = stride;
    let mut root = 0usize;
    let mut root_step = (along / a) * a;
    let mut terms = b;
    if comptime!(inner) {
        let p = along / b;
        let j = along % b;
        index = line + j * stride;
        index_step = b * stride;
        root = (j * p) % n;
        root_step = p * b;
        terms = a;
    }
    let mut sum_re = E::new(0.0);
    let mut sum_im = E::new(0.0);
    for _ in 0..terms {
        let cos = roots[root];
        let mut sin = roots[n + root];
        // exp(-i t) forward, exp(i t) backward.
        if comptime!(inverse) {
            sin = E::new(0.0) - sin;
        }
        let x = re[index];
        sum_re += x * cos;
        sum_im -= x * sin;
        if comptime!(!real) {
            let y = im[index];
            sum_re += y * sin;
            sum_im += y * cos;
        }
        root += root_step;
        root = select(root >= n, root - n, root);
        index += index_step;
    }
    of_re[place] = sum_re;
    of_im[place] = sum_im;
}
