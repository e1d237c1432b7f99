//! Moves that keep the interface profile.

use crate::common::{device, distance, noise, values};
use geometry::optimal_profile;
use solver::{extrapolate, retract};

const N: usize = 64;
/// `eps / h`.
const EPS: f64 = 4.0;

/// A flat interface at `x`, and its mirror image to make the row periodic, on `[1, N]`.
fn front(x: f64) -> Vec<f64> {
    (0..N)
        .map(|i| optimal_profile((i as f64 - 32.0).abs() - x, EPS))
        .collect()
}

#[test]
fn retraction_is_the_straight_line_to_first_order() {
    let device = device();
    let u = front(12.0);
    let p = noise(N, 7);
    let (tensor, direction) = (device.tensor(&u, [1, N]), device.tensor(&p, [1, N]));
    let error = |t: f64| {
        let line: Vec<f64> = u.iter().zip(&p).map(|(u, p)| u + t * p).collect();
        distance(&values(&retract(&tensor, &direction, t)), &line)
    };
    // The shift in atanh u is t p / (1 - u^2) and so at most 10 t |p|.
    let errors = [1e-3, 5e-4, 2.5e-4].map(error);
    assert!(errors[0] > 0.0, "the retraction is not the straight line");
    for pair in errors.windows(2) {
        let rate = (pair[0] / pair[1]).log2();
        assert!((rate - 2.0).abs() < 0.1, "rate {rate} of {errors:?}");
    }
}

#[test]
fn retraction_moves_a_front_without_bending_its_profile() {
    let device = device();
    let u = front(12.0);
    // The direction of a motion by half of eps.
    let p: Vec<f64> = u.iter().map(|u| 0.75 * (1.0 - u * u) * 0.5).collect();
    let (tensor, direction) = (device.tensor(&u, [1, N]), device.tensor(&p, [1, N]));
    let moved = values(&retract(&tensor, &direction, 1.0));
    let line: Vec<f64> = u.iter().zip(&p).map(|(u, p)| u + p).collect();
    let exact = front(12.0 + 0.5 * EPS);
    let motion = distance(&exact, &u);
    assert!(distance(&moved, &exact) < 0.05 * motion);
    assert!(distance(&line, &exact) > 3.0 * distance(&moved, &exact));
}

#[test]
fn retraction_along_wild_directions_stays_bounded_at_the_interface() {
    let device = device();
    let u: Vec<f64> = front(12.0);
    let p: Vec<f64> = u.iter().map(|u| 100.0 * (1.0 - u * u)).collect();
    let (tensor, direction) = (device.tensor(&u, [1, N]), device.tensor(&p, [1, N]));
    for t in [-1.0, 1.0] {
        let step = values(&retract(&tensor, &direction, 1e-2 * t));
        assert!(step.iter().all(|v| v.abs() <= 1.02), "{step:?}");
        let long = values(&retract(&tensor, &direction, t));
        assert!(long.iter().all(|v| v.is_finite()));
    }
    let still = values(&retract(&tensor, &direction, 0.0));
    assert!(distance(&still, &u) < 1e-14);
}

#[test]
fn extrapolation_continues_a_translation() {
    let device = device();
    let error = |step: f64, factor: f64| {
        let (before, now) = (front(12.0 - step), front(12.0));
        let ahead = front(12.0 + factor * step);
        let (u, previous) = (device.tensor(&now, [1, N]), device.tensor(&before, [1, N]));
        let found = values(&extrapolate(&u, &previous, factor));
        distance(&found, &ahead) / distance(&ahead, &now)
    };
    for factor in [0.5, 1.0, 2.0] {
        assert!(
            error(0.1 * EPS, factor) < 0.05,
            "{}",
            error(0.1 * EPS, factor)
        );
    }
    // Better than the straight line, whose error is of second order: relative to the motion, of first.
    let straight = |step: f64| {
        let (before, now, ahead) = (front(12.0 - step), front(12.0), front(12.0 + step));
        let line: Vec<f64> = now.iter().zip(&before).map(|(u, v)| 2.0 * u - v).collect();
        distance(&line, &ahead) / distance(&ahead, &now)
    };
    let step = 0.4 * EPS;
    assert!(
        error(step, 1.0) < 0.3 * straight(step),
        "{} {}",
        error(step, 1.0),
        straight(step)
    );
    let u = device.tensor(&front(12.0), [1, N]);
    assert!(distance(&values(&extrapolate(&u, &u, 1.0)), &front(12.0)) < 1e-15);
}
