//! Vesicles and elastic curves.

use std::f64::consts::{PI, TAU};

use reference::Error;
use reference::equilibria::{Branch, Vesicle, elastica, vesicles};

use crate::integrate;

/// Steps of an integration.
const STEPS: usize = 20_000;

fn energies(branch: Branch, volumes: &[f64]) -> Vec<f64> {
    let vesicles = vesicles(branch, 0.0, volumes).unwrap();
    vesicles.iter().map(|v| v.energy() / (8.0 * PI)).collect()
}

/// Energies of an independent solver of the shape equations.
#[test]
fn energies_of_vesicles_are_the_known_ones() {
    let prolate = energies(Branch::Prolate, &[0.95, 0.9, 0.8, 0.7]);
    let oblate = energies(Branch::Oblate, &[0.7, 0.65, 0.6]);
    let known = [1.0956, 1.1896, 1.3874, 1.6433, 1.6991, 1.8262, 1.9557];
    for (energy, known) in prolate.into_iter().chain(oblate).zip(known) {
        assert!((energy - known).abs() < 6e-5, "{energy} {known}");
    }
}

/// Seifert, Berndl, Lipowsky (1991): prolate above 0.652, cups below about 0.592.
#[test]
fn branches_cross_where_they_should() {
    let volumes = [0.653, 0.651, 0.5925, 0.5895];
    let oblate = energies(Branch::Oblate, &volumes);
    let prolate = energies(Branch::Prolate, &volumes[..2]);
    assert!(prolate[0] < oblate[0] && prolate[1] > oblate[1]);
    let cups = vesicles(Branch::Stomatocyte, 0.0, &[0.5925, 0.591, 0.5895]).unwrap();
    assert!(oblate[2] < cups[0].energy() / (8.0 * PI));
    assert!(oblate[3] > cups[2].energy() / (8.0 * PI));
    derivatives_agree(&cups);
}

/// Of three neighbours on a branch.
fn derivatives_agree(vesicles: &[Vesicle]) {
    let rise = vesicles[0].energy() - vesicles[2].energy();
    let slope = rise / (vesicles[0].surface.volume() - vesicles[2].surface.volume());
    let (middle, surface) = (&vesicles[1], &vesicles[1].surface);
    assert!(
        (slope / -middle.pressure - 1.0).abs() < 1e-4,
        "{slope} {}",
        middle.pressure
    );
    // When all lengths grow, and the spontaneous curvature falls, by the same factor, the energy stays.
    let c = middle.spontaneous_curvature;
    let bending = c * (c * surface.area() - surface.mean_curvature());
    let scaling = -3.0 * middle.pressure * surface.volume() - 2.0 * middle.tension * surface.area();
    assert!((scaling - bending).abs() < 1e-6, "{scaling} {bending}");
}

/// The shape equations of Seifert, Berndl and Lipowsky for `(r, psi, psi', gamma)` over the arc length, from pole to pole or equator.
#[test]
fn vesicles_solve_the_shape_equations_from_their_pole() {
    let cases = [
        (Branch::Prolate, 0.0, 0.8),
        (Branch::Oblate, 0.0, 0.62),
        (Branch::Prolate, 1.5, 0.85),
        (Branch::Oblate, -1.0, 0.7),
    ];
    for (branch, c, volume) in cases {
        let vesicle = &vesicles(branch, c, &[volume]).unwrap()[0];
        assert!((vesicle.surface.area() - 4.0 * PI).abs() < 1e-9);
        assert!((vesicle.surface.reduced_volume() - volume).abs() < 1e-9);
        let (pressure, tension) = (vesicle.pressure, vesicle.tension);
        let profile = vesicle.surface.profile();
        let (start, pole) = (1e-3, profile.curvature_at(0.0));
        let slope = (pole - c).powi(2) / 2.0 - pole * pole / 2.0 + tension;
        let equations = |&[r, psi, u, gamma]: &[f64; 4]| {
            let (sin, cos) = psi.sin_cos();
            let bending =
                -u / r * cos + sin * cos / (r * r) + gamma / r * sin + pressure * r / 2.0 * cos;
            let multiplier =
                (u - c).powi(2) / 2.0 - sin * sin / (2.0 * r * r) + pressure * r * sin + tension;
            [cos, u, bending, multiplier]
        };
        let length = profile.length() / 4.0 - start;
        let begin = [start, pole * start, pole, slope * start];
        let [r, psi, ..] = integrate(begin, length, STEPS, equations);
        let errors = [r - profile.point(PI / 2.0)[0], psi - PI / 2.0];
        assert!(
            errors.iter().all(|e| e.abs() < 1e-4),
            "{branch:?} {errors:?}"
        );
    }
}

#[test]
fn pressure_and_tension_are_derivatives_of_the_energy() {
    let step = 1e-4;
    for (branch, c, volume) in [(Branch::Oblate, 0.0, 0.65), (Branch::Prolate, 1.0, 0.8)] {
        derivatives_agree(&vesicles(branch, c, &[volume + step, volume, volume - step]).unwrap());
    }
}

#[test]
fn elastic_curves_close_and_enclose_their_area() {
    let quotients = [0.95, 0.7, 0.4];
    for (curve, quotient) in elastica(&quotients).unwrap().iter().zip(quotients) {
        let (pressure, tension, curvature) =
            (curve.pressure, curve.tension, curve.curve.curvature_at(0.0));
        // x, y, theta, kappa, its derivative, area, energy.
        let equations = |&[x, y, theta, k, slope, ..]: &[f64; 7]| {
            let (sin, cos) = theta.sin_cos();
            let bending = tension * k - k.powi(3) / 2.0 + pressure;
            [
                cos,
                sin,
                k,
                slope,
                bending,
                (x * sin - y * cos) / 2.0,
                k * k / 2.0,
            ]
        };
        let begin = [0.0, 0.0, 0.0, curvature, 0.0, 0.0, 0.0];
        let end = integrate(begin, TAU, STEPS, equations);
        let exact = [
            0.0,
            0.0,
            TAU,
            curvature,
            0.0,
            PI * quotient,
            curve.curve.energy(),
        ];
        for (end, exact) in end.into_iter().zip(exact) {
            assert!((end - exact).abs() < 1e-7, "{end} {exact}");
        }
    }
}

#[test]
fn ends_of_branches_are_reported() {
    for quotient in [1.1, 0.0, f64::NAN] {
        let result = elastica(&[quotient]);
        assert!(matches!(result, Err(Error::InvalidParameter { .. })));
    }
    let beyond = vesicles(Branch::Stomatocyte, 0.0, &[0.7]);
    assert!(matches!(beyond, Err(Error::NoEquilibrium { .. })));
}
