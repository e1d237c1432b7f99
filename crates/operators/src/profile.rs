//! Moves that respect the interface profile, value by value and as Burn operations.
#![cfg_attr(not(any(feature = "wgpu", feature = "cuda")), allow(dead_code))]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is compiled without the instructions that were detected"
)]

use burn::tensor::Tensor;
use pulp::Arch;

use crate::fft::Real;
use crate::slices::over_chunks;

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
/// Values that are moved together.
const TOGETHER: usize = 16;

/// The hyperbolic translation `(u + s) / (1 + u s)`: adds `atanh s` to `atanh u`.
#[inline(always)]
fn translated(u: f64, s: f64) -> f64 {
    (u + s) / (1.0 + u * s)
}

/// Moves values of a phase field by `factor p`, see [`crate::retract`].
pub(crate) fn retract_values<T: Real>(u: &mut [T], p: &[T], factor: f64) {
    let arch = Arch::new();
    over_chunks(u, p, &|u, p| arch.dispatch(|| retract_block(u, p, factor)));
}

/// A few at once, so that all but the hyperbolic tangents is done in vector registers.
#[inline(always)]
fn retract_block<T: Real>(u: &mut [T], p: &[T], factor: f64) {
    for (u, p) in u.chunks_mut(TOGETHER).zip(p.chunks(TOGETHER)) {
        let mut block = [[0.0; TOGETHER]; 3];
        let [values, motions, shifts] = &mut block;
        for (k, (u, p)) in u.iter().zip(p).enumerate() {
            (values[k], motions[k]) = (u.double(), factor * p.double());
        }
        for k in 0..TOGETHER {
            shifts[k] = shift(values[k], motions[k]);
        }
        let mut tangents = *shifts;
        for tangent in &mut tangents {
            if tangent.abs() >= LINEAR {
                *tangent = tangent.tanh();
            }
        }
        let mut moved = [0.0; TOGETHER];
        for k in 0..TOGETHER {
            moved[k] = retracted(values[k], motions[k], shifts[k], tangents[k]);
        }
        for (u, moved) in u.iter_mut().zip(moved) {
            *u = T::of(moved);
        }
    }
}

/// The shift of `atanh u` for a motion.
#[inline(always)]
fn shift(u: f64, motion: f64) -> f64 {
    let q = (1.0 - u * u).max(0.0);
    let shift = motion * q / (q * q + WINDOW * WINDOW);
    shift.clamp(-LARGEST_SHIFT, LARGEST_SHIFT)
}

/// The moved value, where the shift has this hyperbolic tangent.
#[inline(always)]
fn retracted(u: f64, motion: f64, shift: f64, tangent: f64) -> f64 {
    let (phase, q) = (u.clamp(-1.0, 1.0), (1.0 - u * u).max(0.0));
    u + (translated(phase, tangent) - phase) + (motion - q * shift)
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
