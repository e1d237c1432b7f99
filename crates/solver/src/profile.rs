//! Moves that respect the interface profile.
//!
//! A time step moves the interface by a fraction of `eps`. A straight update `u + t p` leaves the `tanh` profile and
//! Armijo's rule cuts it short; the same motion in the variable `atanh u`, which is the distance, does not.

use burn::tensor::Tensor;

/// Width of the transition between the two variables, in units of `1 - u^2`.
const WINDOW: f64 = 0.05;
/// Largest shift in `atanh u`: two interface widths.
const LARGEST_SHIFT: f64 = 1.5;
/// Largest extrapolated shift, as a hyperbolic tangent.
const LARGEST_EXTRAPOLATION: f64 = 0.9;

/// The hyperbolic translation `(u + s) / (1 + u s)`: adds `atanh s` to `atanh u`.
fn translate<const D: usize>(u: Tensor<D>, s: Tensor<D>) -> Tensor<D> {
    (u.clone() + s.clone()) / (u * s + 1.0)
}

/// `u` moved along `p`: in `atanh u` where the interface is, straight elsewhere.
///
/// With `q = 1 - u^2` and `d = t p q / (q^2 + 0.05^2)`, the interface part of the motion becomes the translation by
/// `tanh d`; what is left of `t p` is added straight. Agrees with `u + t p` to first order in `t`.
pub fn retract<const D: usize>(u: &Tensor<D>, p: &Tensor<D>, t: f64) -> Tensor<D> {
    let phase = u.clone().clamp(-1.0, 1.0);
    let q = (u.clone() * u.clone()).neg() + 1.0;
    let q = q.clamp_min(0.0);
    let motion = p.clone() * t;
    let shift = motion.clone() * q.clone() / (q.clone() * q.clone() + WINDOW * WINDOW);
    let shift = shift.clamp(-LARGEST_SHIFT, LARGEST_SHIFT);
    let moved = translate(phase.clone(), shift.clone().tanh());
    u.clone() + (moved - phase) + (motion - q * shift)
}

/// The phase field after one more step like the last one, extrapolated in `atanh u`.
///
/// `(u + s) / (1 + u s)` with `s = (u - u_previous) / (1 - u u_previous)`, windowed to the interface.
pub fn extrapolate<const D: usize>(u: &Tensor<D>, previous: &Tensor<D>, factor: f64) -> Tensor<D> {
    const PHASE: f64 = 0.99999;
    let (a, b) = (
        u.clone().clamp(-PHASE, PHASE),
        previous.clone().clamp(-PHASE, PHASE),
    );
    let shift = (a.clone() - b.clone()) / ((a.clone() * b).neg() + 1.0);
    let shift = shift.clamp(-LARGEST_EXTRAPOLATION, LARGEST_EXTRAPOLATION);
    let q = (u.clone() * u.clone()).neg() + 1.0;
    let square = q.clone() * q;
    let window = square.clone() / (square + WINDOW * WINDOW);
    let moved = translate(a.clone(), shift * window * factor);
    u.clone() + (moved - a)
}
