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

/// Integrates `y' = f(y)` by steps of the classical Runge-Kutta method.
fn integrate<Y: Clone + AsRef<[f64]> + AsMut<[f64]>>(
    mut y: Y,
    length: f64,
    steps: usize,
    f: impl Fn(&Y) -> Y,
) -> Y {
    let step = length / steps as f64;
    let moved = |y: &Y, k: &Y, by: f64| {
        let mut moved = y.clone();
        for (y, k) in moved.as_mut().iter_mut().zip(k.as_ref()) {
            *y += by * k;
        }
        moved
    };
    for _ in 0..steps {
        let a = f(&y);
        let b = f(&moved(&y, &a, step / 2.0));
        let c = f(&moved(&y, &b, step / 2.0));
        let d = f(&moved(&y, &c, step));
        for (k, weight) in [(a, 1.0), (b, 2.0), (c, 2.0), (d, 1.0)] {
            y = moved(&y, &k, step / 6.0 * weight);
        }
    }
    y
}
