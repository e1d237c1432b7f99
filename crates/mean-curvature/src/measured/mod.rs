//! What a step is, measured from what it does.
//!
//! # Inverses in the pure phases
//!
//! Where `u` is constant the Hessian of the energy is `M + c (1 - J)^T M (1 - J)`, with the derivative `J` of the step and its mass matrix `M`.
//! Both are convolutions there, and what they make of a unit impulse is all that there is to know. On the whole grid the inverse is
//! `1 / (m (1 + c |1 - J|^2))` in Fourier space, with the mean `J` of both phases.
//!
//! On active bricks there is no Fourier space. `J` is measured on a small periodic box of bricks, and the inverse is `x + y J`, `J` applied as
//! the derivative of the step itself. Where `J` costs more than it saves, in the plane, or is not symmetric, it is a number.
//!
//! # Calibration
//!
//! Flat interfaces with a rational normal `a` are functions of the plane `a . x` of nodes, and so are their perturbations. The step is applied to
//! them on a periodic box, in which there are two such interfaces; the periods along other normals than the axes are shorter, and the box
//! needs 16 `eps` of them. Everything that [`calibration`](crate::calibration) needs comes from values and derivatives of the step:
//!
//! - the interface at rest is a fixed point of the step, `w' = J w'` and `psi = J^T psi` are fixed points of its derivative and of that's
//!   transpose, found by fixed-point iterations with Anderson's acceleration,
//! - the response `A` to bending is what `J` makes of `-w' |t|^2 / (2 (D - 1))`, `t` along the interface. That is half a second derivative,
//!   `A = Laplace_k J_k w' / (2 (D - 1))` at `k = 0`, of `J_k w' = exp(-i k t) J (exp(i k t) w')`. So the step is applied to `w' cos(k t)`
//!   with four small `k` that fit the box, and extrapolated: exact to the order `k^6`.
//!
//! That takes some 100 applications of the step or of its derivative for each pair of interfaces, of which there are eight in the plane and six in space.

mod calibration;
mod derivative;
mod fixed_point;
mod phase;
mod planes;

pub use calibration::calibrate;
pub use phase::phase_inverses;
