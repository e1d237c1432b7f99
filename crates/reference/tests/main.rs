//! Tests of the exact references.

mod equilibria;
mod finite_differences;
mod planar;
mod revolution;

use reference::Curve;

/// Tip on the x axis, diagonal, area, length, energy.
fn measures(curve: &Curve) -> [f64; 5] {
    let along = |direction| {
        curve
            .distance_along(direction)
            .expect("the curve goes round its centre")
    };
    [
        along([1.0, 0.0]),
        along([1.0, 1.0]),
        curve.area(),
        curve.length(),
        curve.energy(),
    ]
}

/// NaN if there is one.
fn largest_difference<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.max_by(f64::total_cmp).unwrap_or(0.0)
}
