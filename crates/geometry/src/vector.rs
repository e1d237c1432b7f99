//! The few operations on `[f64; D]` that the crate needs.

use std::array::from_fn;

pub(crate) fn add<const D: usize>(a: [f64; D], b: [f64; D]) -> [f64; D] {
    from_fn(|i| a[i] + b[i])
}

pub(crate) fn sub<const D: usize>(a: [f64; D], b: [f64; D]) -> [f64; D] {
    from_fn(|i| a[i] - b[i])
}

pub(crate) fn scale<const D: usize>(a: [f64; D], factor: f64) -> [f64; D] {
    a.map(|v| v * factor)
}

pub(crate) fn dot<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    (0..D).map(|i| a[i] * b[i]).sum()
}

pub(crate) fn norm<const D: usize>(a: [f64; D]) -> f64 {
    dot(a, a).sqrt()
}

/// Larger of two numbers, NaN if either is: `f64::max` would hide a failed operand.
pub(crate) fn max(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}
