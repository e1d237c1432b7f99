//! Exact solutions and energies.
//!
//! The Willmore energy is `w = 1/2 integral of kappa^2` with `kappa` the sum of the principal curvatures.
//! Mean curvature flow is the L2 gradient flow of the perimeter, Willmore flow that of `w`, both
//! with unit speed. `dimension` is that of the space: 2 for circles, 3 for spheres.

use std::f64::consts::PI;

/// Willmore energy of every sphere in 3D, `8 pi`.
pub const WILLMORE_ENERGY_SPHERE: f64 = 8.0 * PI;

/// Radius `sqrt(r^2 - 2 (d-1) t)` of a sphere of radius `r` after mean curvature flow for time `t`.
///
/// The sphere vanishes at `t = r^2 / (2 (d-1))`; the radius is zero from then on, where
/// there is no interface any more and the phase field is `-1`.
pub fn mean_curvature_radius(r: f64, t: f64, dimension: usize) -> f64 {
    (r * r - 2.0 * (dimension as f64 - 1.0) * t).max(0.0).sqrt()
}

/// Radius `(r^4 - 2 (d-1)^2 (d-3) t)^(1/4)` of a sphere after Willmore flow for time `t`.
///
/// In 2D circles grow, `(r^4 + 2t)^(1/4)`; in 3D spheres are stationary; beyond they shrink, with
/// radius zero once they have vanished.
pub fn willmore_radius(r: f64, t: f64, dimension: usize) -> f64 {
    if dimension == 3 {
        return r;
    }
    let d = dimension as f64;
    (r.powi(4) - 2.0 * (d - 1.0).powi(2) * (d - 3.0) * t)
        .max(0.0)
        .sqrt()
        .sqrt()
}
