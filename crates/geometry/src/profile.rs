//! The optimal profile: from signed distances to phase fields and back.

use crate::error::positive;
use crate::{Error, Field, Grid, PhaseField, SignedDistance, Stored, parallel};

/// Beyond so many interface widths the optimal profile is `-1` or `1` exactly, by rounding.
pub const PURE_BEYOND: f64 = 26.0;

/// The optimal profile `u = tanh(-3 s / (4 eps))` at signed distance `s`.
///
/// It minimises the perimeter functional across a flat interface: `eps^2 u'^2 = Psi(u)` with
/// `Psi(u) = 9/16 (1 - u^2)^2`. `u` is positive inside, where `s < 0`.
pub fn optimal_profile(distance: f64, eps: f64) -> f64 {
    (-0.75 * distance / eps).tanh()
}

/// The largest `|u|` that the inverse of the profile sees,
const CLAMP: f64 = 1.0 - f64::EPSILON;
/// and its `atanh`, which most nodes of most fields have.
const FARTHEST: f64 = 18.368_400_284_838_55;

/// `atanh` of `u`, clamped to `|u| <= 1 - 2^-52`: positive inside, zero on the interface. NaN stays NaN.
pub fn profile_variable(u: f64) -> f64 {
    let size = u.abs();
    let variable = if size >= CLAMP {
        FARTHEST
    } else {
        size.atanh()
    };
    variable.copysign(u)
}

/// The signed distance `-(4 eps / 3) atanh u` at which the optimal profile takes the value `u`.
///
/// `u` is clamped to `|u| <= 1 - 2^-52`, so that values at and beyond `-1` and `1` give the
/// finite distances `24.5 eps` and `-24.5 eps`. Rounding of `u` near `-1` and `1` limits what can
/// be recovered: the error of `s` is about `2^-53 eps exp(3 |s| / (2 eps)) / 3`, below `1e-9 eps`
/// up to `|s| = 11 eps` (for values from single precision: `1e-3 eps` up to `7 eps`).
pub fn distance_from_phase_field(u: f64, eps: f64) -> f64 {
    -4.0 / 3.0 * eps * profile_variable(u)
}

/// The [distances](distance_from_phase_field), where the phase field is stored.
///
/// # Errors
/// `eps` must be finite and positive, the values finite.
pub fn distances_from_phase_field<const D: usize>(
    u: &impl PhaseField<D>,
    eps: f64,
) -> Result<Stored<D>, Error> {
    positive("eps", eps)?;
    u.check_finite()?;
    let (distance, values) = (|u| distance_from_phase_field(u, eps), u.values());
    let distances = parallel::values(values.len(), |node| distance(values[node]));
    Ok(Stored::new(
        distances,
        u.nodes().clone(),
        u.phase_values().map(distance),
    ))
}

/// The phase field `u = tanh(-3 s(x) / (4 eps))` of a shape with signed distance `s`.
///
/// The distance is that of the shape in the whole space, not its periodic image: keep the shape a
/// few `eps` away from the faces of the box, or `u` jumps there.
///
/// # Errors
/// `eps` must be finite and positive, the distances not NaN.
pub fn phase_field<const D: usize>(
    grid: Grid<D>,
    shape: &(impl SignedDistance<D> + ?Sized),
    eps: f64,
) -> Result<Field<D>, Error> {
    positive("eps", eps)?;
    Field::read_from(grid, &|first, part| {
        of_shape(&grid, shape, eps, first, part);
    })
}

/// The same [phase field](phase_field), of which only what is near the interface is in memory.
///
/// # Errors
/// As for [`phase_field`].
pub fn stored_phase_field<const D: usize>(
    grid: Grid<D>,
    shape: &(impl SignedDistance<D> + ?Sized),
    eps: f64,
) -> Result<Stored<D>, Error> {
    positive("eps", eps)?;
    Stored::read_from(grid, &|first, part| {
        of_shape(&grid, shape, eps, first, part);
    })
}

/// Writes the values of a shape's phase field from a node on.
fn of_shape<const D: usize>(
    grid: &Grid<D>,
    shape: &(impl SignedDistance<D> + ?Sized),
    eps: f64,
    first: usize,
    part: &mut [f64],
) {
    for (value, node) in part.iter_mut().zip(first..) {
        *value = optimal_profile(shape.signed_distance(grid.node(node)), eps);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_the_profile_ends_where_it_says() {
        assert_eq!(FARTHEST.to_bits(), CLAMP.atanh().to_bits());
        for u in [CLAMP, 1.0, 1.5] {
            assert_eq!(profile_variable(-u).to_bits(), (-FARTHEST).to_bits());
        }
        assert!(profile_variable(f64::NAN).is_nan());
    }
}
