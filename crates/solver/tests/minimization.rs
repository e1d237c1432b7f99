//! Newton's method on objectives with known minimizers.

use crate::common::{
    DoubleWell, Quadratic, SIDE, Scaled, device, distance, grid_tensor, noise, values,
};
use solver::{Error, Exit, NewtonInfo, NewtonParams, NewtonVariant, Objective, minimize};

const N: usize = SIDE * SIDE;
const VARIANTS: [NewtonVariant; 2] = [NewtonVariant::Preconditioned, NewtonVariant::Paper];

fn tight(variant: NewtonVariant) -> NewtonParams {
    NewtonParams {
        variant,
        tolerance: 1e-7,
        cg_tolerance: 1e-8,
        ..NewtonParams::default()
    }
}

fn solve(
    objective: &mut impl Objective<2>,
    previous: &[f64],
    params: NewtonParams,
) -> (Vec<f64>, NewtonInfo) {
    let start = grid_tensor(previous);
    let (u, info) = minimize(objective, &start, &start, params, &device()).unwrap();
    (values(&u), info)
}

#[test]
fn a_quadratic_energy_ends_at_the_solution_of_its_linear_system() {
    for size in [0.1, 1.0] {
        for variant in VARIANTS {
            let mut energy = Quadratic::random(size);
            let (previous, exact) = (energy.a.clone(), energy.minimizer());
            let (u, info) = solve(&mut energy, &previous, tight(variant));
            let error = distance(&u, &exact) / distance(&exact, &previous);
            assert!(error < 1e-6, "{variant:?} {size}: {error:e} {info:?}");
            // Stationary: the last solve was exact to rounding.
            assert!(
                matches!(info.exit, Exit::Converged | Exit::Stationary),
                "{info:?}"
            );
            assert_eq!(info.negative_curvature, 0);
            assert!(info.energy < info.energy_before);
            assert!(
                (info.energy - energy.value(&grid_tensor(&u)).unwrap()).abs() < 1e-12 * info.energy
            );
        }
    }
}

#[test]
fn conjugate_gradients_end_within_as_many_products_as_there_are_unknowns() {
    // Straight lines and the exact solution: one Newton step does it, and one more confirms it.
    let mut energy = Quadratic::random(0.2);
    let previous = energy.a.clone();
    let (_, info) = solve(&mut energy, &previous, tight(NewtonVariant::Paper));
    assert!(info.newton <= 3, "{info:?}");
    assert!(info.hvp <= 2 * N, "{info:?}");
}

#[test]
fn directions_of_negative_curvature_lead_down() {
    for variant in VARIANTS {
        let start: Vec<f64> = noise(N, 5).iter().map(|x| 0.1 * x + 0.05).collect();
        let mut energy = DoubleWell::new(start.clone(), 4.0);
        let (u, info) = solve(&mut energy, &start, tight(variant));
        assert!(info.negative_curvature > 0, "{info:?}");
        assert!(info.energy < 0.8 * info.energy_before, "{info:?}");
        assert_eq!(info.exit, Exit::Converged, "{variant:?} {info:?}");
        for (u, a) in u.iter().zip(&start) {
            let slope = u - a + 4.0 * u * (u * u - 1.0);
            let curvature = 1.0 + 4.0 * (3.0 * u * u - 1.0);
            assert!(slope.abs() < 1e-4, "not stationary: slope {slope} at {u}");
            assert!(
                curvature > 0.0,
                "not a minimizer: curvature {curvature} at {u}"
            );
        }
    }
}

#[test]
fn the_unit_of_energy_does_not_matter() {
    let start: Vec<f64> = noise(N, 5).iter().map(|x| 0.1 * x + 0.05).collect();
    for variant in VARIANTS {
        let params = NewtonParams {
            tolerance: 1e-3,
            ..tight(variant)
        };
        let convex = |scale: f64| {
            let previous = Quadratic::random(0.5).a;
            solve(
                &mut Scaled(Quadratic::random(0.5), scale),
                &previous,
                params,
            )
        };
        let concave = |scale: f64| {
            solve(
                &mut Scaled(DoubleWell::new(start.clone(), 4.0), scale),
                &start,
                params,
            )
        };
        for (name, run) in [
            ("convex", &convex as &dyn Fn(f64) -> (Vec<f64>, NewtonInfo)),
            ("concave", &concave),
        ] {
            let (u, info) = run(1.0);
            // A power of two rounds nowhere: the very same iterates.
            let (v, other) = run(2.0_f64.powi(-40));
            assert_eq!(u, v, "{name} {variant:?}");
            assert_eq!(counts(&info), counts(&other), "{name} {variant:?}");
            assert_eq!(info.estimate.to_bits(), other.estimate.to_bits());
            let (v, other) = run(1e-12);
            // Another rounding, which conjugate gradients amplify.
            let difference = distance(&u, &v);
            assert!(difference < 1e-5, "{name} {variant:?}: {difference:e}");
            assert_eq!(info.exit, other.exit, "{name} {variant:?}");
        }
    }
}

fn counts(info: &NewtonInfo) -> (Exit, [usize; 5]) {
    let NewtonInfo {
        newton,
        hvp,
        values,
        gradients,
        negative_curvature,
        ..
    } = *info;
    (
        info.exit,
        [newton, hvp, values, gradients, negative_curvature],
    )
}

#[test]
fn whoever_starts_above_the_minimum_moves() {
    // Energies that differ by far less than a part in a million from those of standing still.
    for variant in VARIANTS {
        for push in [1e-2, 1e-6, 1e-10] {
            let mut energy = Quadratic::random(1.0);
            let mut previous = energy.minimizer();
            // At the minimizer u*, d replaced by B u* makes u* stationary for a = u*.
            let image: Vec<f64> = (energy.matrix.iter())
                .map(|row| row.iter().zip(&previous).map(|(b, u)| b * u).sum())
                .collect();
            energy.d = image;
            previous[3] += push;
            energy.a.clone_from(&previous);
            let (u, info) = solve(
                &mut energy,
                &previous,
                NewtonParams {
                    variant,
                    ..NewtonParams::default()
                },
            );
            let exact = energy.minimizer();
            let moved = distance(&u, &previous);
            assert!(
                moved > 0.5 * distance(&exact, &previous),
                "{variant:?} {push}: {info:?}"
            );
            let error = distance(&u, &exact) / distance(&exact, &previous);
            assert!(error < 0.1, "{variant:?} {push}: {error} {info:?}");
        }
    }
}

#[test]
fn whoever_starts_at_the_minimum_stays() {
    for variant in VARIANTS {
        let mut energy = Quadratic::random(1.0);
        energy.d = vec![0.0; N];
        energy.a = vec![0.0; N];
        let (u, info) = solve(&mut energy, &[0.0; N], tight(variant));
        assert_eq!(info.exit, Exit::Stationary, "{variant:?}");
        assert!(u.iter().all(|u| u.abs() < 1e-15));
        // Not only by symmetry: a well whose bottom is not at zero.
        let bottom = vec![1.0; N];
        let mut energy = DoubleWell::new(bottom.clone(), 4.0);
        let (u, info) = solve(&mut energy, &bottom, tight(variant));
        assert_eq!(info.exit, Exit::Stationary, "{variant:?}");
        assert!(distance(&u, &bottom) < 1e-14);
    }
}

#[test]
fn energies_that_are_not_finite_are_reported() {
    for variant in VARIANTS {
        let mut energy = Quadratic::random(1.0);
        energy.d[2] = f64::NAN;
        let start = grid_tensor(&[0.0; N]);
        let error = minimize(&mut energy, &start, &start, tight(variant), &device()).unwrap_err();
        assert!(
            matches!(
                error,
                Error::NonFinite {
                    field: "energy",
                    ..
                }
            ),
            "{error}"
        );
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let bad: [(&str, fn(&mut NewtonParams)); 4] = [
        ("tolerance", |params| params.tolerance = 0.0),
        ("cg_tolerance", |params| params.cg_tolerance = f64::NAN),
        ("cg_iterations", |params| params.cg_iterations = 0),
        ("newton_iterations", |params| params.newton_iterations = 0),
    ];
    for (expected, spoil) in bad {
        let mut params = NewtonParams::default();
        spoil(&mut params);
        let mut energy = Quadratic::random(1.0);
        let start = grid_tensor(&energy.a);
        let error = minimize(&mut energy, &start, &start, params, &device()).unwrap_err();
        assert!(
            matches!(error, Error::Geometry(geometry::Error::InvalidParameter { name, .. }) if name == expected),
            "{error}"
        );
    }
}
