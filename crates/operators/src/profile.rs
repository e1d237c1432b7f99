//! Moves that respect the interface profile, value by value and as Burn operations.
#![cfg_attr(not(any(feature = "wgpu", feature = "cuda")), allow(dead_code))]

use burn::tensor::Tensor;

/// Width of the transition between the two variables, in units of `1 - u^2`.
const WINDOW: f64 = 0.05;
/// Largest shift in `atanh u`: two interface widths.
const LARGEST_SHIFT: f64 = 1.5;
/// Largest extrapolated shift, as a hyperbolic tangent.
const LARGEST_EXTRAPOLATION: f64 = 0.9;
/// Extrapolation leaves what is nearer to a pure phase than this alone.
const PHASE: f64 = 0.99999;
/// Below this `tanh x = x` in double precision.
const LINEAR: f64 = 1e-8;

/// The hyperbolic translation `(u + s) / (1 + u s)`: adds `atanh s` to `atanh u`.
fn translated(u: f64, s: f64) -> f64 {
    (u + s) / (1.0 + u * s)
}

pub(crate) fn retracted(u: f64, motion: f64) -> f64 {
    let phase = u.clamp(-1.0, 1.0);
    let q = (1.0 - u * u).max(0.0);
    let shift = motion * q / (q * q + WINDOW * WINDOW);
    let shift = shift.clamp(-LARGEST_SHIFT, LARGEST_SHIFT);
    let s = if shift.abs() < LINEAR {
        shift
    } else {
        shift.tanh()
    };
    u + (translated(phase, s) - phase) + (motion - q * shift)
}

pub(crate) fn extrapolated(u: f64, previous: f64, factor: f64) -> f64 {
    let (a, b) = (u.clamp(-PHASE, PHASE), previous.clamp(-PHASE, PHASE));
    let shift = factor * (a - b) / (1.0 - a * b);
    let shift = shift.clamp(-LARGEST_EXTRAPOLATION, LARGEST_EXTRAPOLATION);
    let q = 1.0 - u * u;
    let window = q * q / (q * q + WINDOW * WINDOW);
    u + (translated(a, shift * window) - a)
}

fn translate<const R: usize>(u: Tensor<R>, s: Tensor<R>) -> Tensor<R> {
    (u.clone() + s.clone()) / (u * s + 1.0)
}

pub(crate) fn retract<const R: usize>(u: Tensor<R>, p: Tensor<R>, t: f64) -> Tensor<R> {
    let phase = u.clone().clamp(-1.0, 1.0);
    let q = ((u.clone() * u.clone()).neg() + 1.0).clamp_min(0.0);
    let motion = p * t;
    let shift = motion.clone() * q.clone() / (q.clone() * q.clone() + WINDOW * WINDOW);
    let shift = shift.clamp(-LARGEST_SHIFT, LARGEST_SHIFT);
    let moved = translate(phase.clone(), shift.clone().tanh());
    u + (moved - phase) + (motion - q * shift)
}

pub(crate) fn extrapolate<const R: usize>(
    u: Tensor<R>,
    previous: Tensor<R>,
    factor: f64,
) -> Tensor<R> {
    let (a, b) = (
        u.clone().clamp(-PHASE, PHASE),
        previous.clamp(-PHASE, PHASE),
    );
    let shift = (a.clone() - b.clone()) * factor / ((a.clone() * b).neg() + 1.0);
    let shift = shift.clamp(-LARGEST_EXTRAPOLATION, LARGEST_EXTRAPOLATION);
    let q = (u.clone() * u.clone()).neg() + 1.0;
    let square = q.clone() * q;
    let window = square.clone() / (square + WINDOW * WINDOW);
    let moved = translate(a.clone(), shift * window);
    u + (moved - a)
}
