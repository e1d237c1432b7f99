//! The steps of mean curvature flow: equations, orders, reference values, failures.

use std::f64::consts::{PI, TAU};

use fem::{Error, FiniteElementStep, FiniteElements, LinearSolver, Tolerances};
use geometry::exact::mean_curvature_radius;
use geometry::measure::l2_distance;
use geometry::shapes::{Ball, Torus};
use geometry::{Field, Grid, phase_field};
use rayon::prelude::*;

/// Data without an interface: smooth on any grid.
fn smooth(grid: Grid<2>) -> Field<2> {
    Field::from_fn(grid, |[x, y]| {
        0.6 * (TAU * x).sin() * (TAU * y).cos() + 0.2 * (TAU * (x + 2.0 * y)).cos()
    })
}

fn step_by(semi: bool, grid: &Grid<2>, eps: f64, size: f64) -> FiniteElementStep<2> {
    let step = if semi {
        FiniteElementStep::semi_implicit(grid, eps, size)
    } else {
        FiniteElementStep::implicit(grid, eps, size)
    };
    step.unwrap()
}

fn disc(grid: Grid<2>, radius: f64, eps: f64) -> Field<2> {
    phase_field(grid, &Ball::new([0.0, 0.0], radius).unwrap(), eps).unwrap()
}

/// `eps |u - v|^2 + 2 tautilde P_eps[v]` by quadrature with five points per axis, in 2D.
fn functional(u: &Field<2>, v: &Field<2>, eps: f64, step: f64) -> f64 {
    let (a, b) = (0.538_469_310_105_683_1, 0.906_179_845_938_664);
    let (wa, wb, w0) = (
        0.478_628_670_499_366_47,
        0.236_926_885_056_189_08,
        0.568_888_888_888_888_9,
    );
    let rule = [(-b, wb), (-a, wa), (0.0, w0), (a, wa), (b, wb)];
    let rule = rule.map(|(s, w)| (0.5 + 0.5 * s, 0.5 * w));
    let (n, h) = (u.grid().cells(), u.grid().spacing());
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let corners = |f: &Field<2>| {
                let at = |a: usize, b: usize| f.values()[(a % n) * n + b % n];
                [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]
            };
            let (cu, cv) = (corners(u), corners(v));
            for (s, ws) in rule {
                for (t, wt) in rule {
                    let value = |c: [f64; 4]| {
                        (1.0 - s) * ((1.0 - t) * c[0] + t * c[1])
                            + s * ((1.0 - t) * c[2] + t * c[3])
                    };
                    let dx = ((1.0 - t) * (cv[2] - cv[0]) + t * (cv[3] - cv[1])) / h;
                    let dy = ((1.0 - s) * (cv[1] - cv[0]) + s * (cv[3] - cv[2])) / h;
                    let (u, v) = (value(cu), value(cv));
                    let well = 9.0 / 16.0 * (1.0 - v * v).powi(2);
                    let perimeter = 0.5 * (eps * (dx * dx + dy * dy) + well / eps);
                    sum += ws * wt * h * h * (eps * (u - v).powi(2) + 2.0 * step * perimeter);
                }
            }
        }
    }
    sum
}

#[test]
fn the_implicit_step_minimizes_the_papers_functional() {
    let grid = Grid::<2>::centred(24, 1.0).unwrap();
    let (eps, step) = (0.08, 0.08_f64.powi(2) / 4.0);
    let u = disc(grid, 0.3, eps);
    let v = FiniteElementStep::implicit(&grid, eps, step)
        .unwrap()
        .step(&u)
        .unwrap();
    let at = |t: f64, seed: u64| {
        let moved = Field::from_fn(grid, |[x, y]| {
            (3.0 * x + seed as f64).sin() * (5.0 * y + 1.0).cos()
        });
        let moved = v.zip_map(&moved, |v, p| v + t * p).unwrap();
        functional(&u, &moved, eps, step)
    };
    for seed in 0..4 {
        let t = 1e-4;
        let (low, middle, high) = (at(-t, seed), at(0.0, seed), at(t, seed));
        // Slope zero, curvature positive.
        let (slope, curvature) = (
            (high - low) / (2.0 * t),
            (high - 2.0 * middle + low) / (t * t),
        );
        assert!(curvature > 0.0);
        assert!(slope.abs() < 1e-8 * curvature, "{slope:e} {curvature:e}");
    }
    assert!(functional(&u, &v, eps, step) < functional(&u, &u, eps, step));
}

#[test]
fn the_semi_implicit_step_solves_its_equation() {
    // (M + tautilde S) v = M u - tautilde/(2 eps^2) M Psi'(u)
    let grid = Grid::<2>::centred(20, 1.0).unwrap();
    let (eps, step) = (0.1, 0.002);
    let u = smooth(grid);
    let h2 = grid.spacing().powi(2);
    let mass = |x: &[f64]| fem::element::mass::<2>(20, x);
    let cubes: Vec<f64> = u.values().iter().map(|u| u.powi(3)).collect();
    let cubic = mass(&cubes);
    let step_of_mcf = FiniteElementStep::semi_implicit(&grid, eps, step).unwrap();
    let v = step_of_mcf.step(&u).unwrap();
    let left = fem::element::Stencil::<2>::constant(20, 1.0, step / h2).apply(v.values());
    let mass = mass(u.values());
    for i in 0..left.len() {
        let well = 9.0 / 4.0 * (cubic[i] - mass[i]);
        let right = mass[i] - step / (2.0 * eps * eps) * well;
        assert!((left[i] - right).abs() < 1e-13, "{} {right}", left[i]);
    }
}

#[test]
fn conjugate_gradients_and_cholesky_agree() {
    let eps = 0.07;
    let grid = Grid::<2>::centred(40, 1.0).unwrap();
    let u = disc(grid, 0.3, eps);
    let step =
        |solver| FiniteElementStep::implicit_with(&grid, eps, eps * eps / 4.0, solver).unwrap();
    let (iterative, direct) = (
        step(LinearSolver::ConjugateGradients),
        step(LinearSolver::Direct),
    );
    let (a, b) = (iterative.step(&u).unwrap(), direct.step(&u).unwrap());
    assert!(l2_distance(&a, &b).unwrap() < 1e-11);
    let (x, y) = (
        iterative
            .elements()
            .linearized_solve(a.values(), u.values()),
        direct.elements().linearized_solve(a.values(), u.values()),
    );
    let (x, y) = (x.unwrap(), y.unwrap());
    assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-8));
    let statistics = iterative.statistics();
    assert!(statistics.newton >= 2 && statistics.factorizations == 0);
    let per_solve = statistics.cg as f64 / statistics.solves as f64;
    assert!((2.0..20.0).contains(&per_solve), "{statistics:?}");
    assert!(direct.statistics().cg == 0 && direct.statistics().factorizations >= 2);
    // The same in three dimensions.
    let grid = Grid::<3>::centred(10, 1.0).unwrap();
    let ball = phase_field(grid, &Ball::new([0.0; 3], 0.3).unwrap(), 0.2).unwrap();
    let step = |solver| {
        let step = FiniteElementStep::implicit_with(&grid, 0.2, 0.01, solver).unwrap();
        step.step(&ball).unwrap()
    };
    let (a, b) = (
        step(LinearSolver::ConjugateGradients),
        step(LinearSolver::Direct),
    );
    assert!(l2_distance(&a, &b).unwrap() < 1e-11);
}

#[test]
fn clones_of_a_direct_step_work_in_parallel_to_the_same_bytes_on_any_number_of_threads() {
    let grid = Grid::<3>::centred(14, 1.0).unwrap();
    let ball = phase_field(grid, &Ball::new([0.0; 3], 0.3).unwrap(), 0.15).unwrap();
    let run = |threads: usize| -> Vec<Vec<f64>> {
        let direct = LinearSolver::Direct;
        let step = FiniteElementStep::implicit_with(&grid, 0.15, 0.005, direct).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let steps = (0..4).into_par_iter().map(|_| step.clone().step(&ball));
            steps.map(|v| v.unwrap().into_values()).collect()
        })
    };
    let alone = run(1);
    assert!(alone.windows(2).all(|pair| pair[0] == pair[1]));
    assert_eq!(run(2), alone);
    assert_eq!(run(5), alone);
}

/// Ratio of the differences between successively refined results.
fn observed_order(results: [f64; 3]) -> f64 {
    let [coarse, middle, fine] = results;
    ((coarse - middle) / (middle - fine)).abs().log2()
}

#[test]
fn second_order_in_space_on_smooth_data() {
    let (eps, step) = (0.1, 0.0025);
    for semi in [false, true] {
        // A functional of the solution that sees it on every grid: its values on the coarsest.
        let solve = |n: usize| -> Vec<f64> {
            let grid = Grid::<2>::centred(n, 1.0).unwrap();
            let mut u = smooth(grid);
            let step = step_by(semi, &grid, eps, step);
            for _ in 0..2 {
                u = step.step(&u).unwrap();
            }
            let stride = n / 16;
            (0..256)
                .map(|i| u.values()[(i / 16) * stride * n + (i % 16) * stride])
                .collect()
        };
        let [a, b, c] = [32, 64, 128].map(solve);
        let distance = |a: &[f64], b: &[f64]| {
            a.iter()
                .zip(b)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let order = (distance(&a, &b) / distance(&b, &c)).log2();
        assert!((order - 2.0).abs() < 0.1, "semi-implicit {semi}: {order}");
    }
}

#[test]
fn first_order_in_time() {
    let eps = 0.1;
    let grid = Grid::<2>::centred(32, 1.0).unwrap();
    let time = 0.004;
    for semi in [false, true] {
        let solve = |steps: usize| {
            let size = time / steps as f64;
            let step = step_by(semi, &grid, eps, size);
            let mut u = smooth(grid);
            for _ in 0..steps {
                u = step.step(&u).unwrap();
            }
            u.values()[33 * 7]
        };
        let order = observed_order([16, 32, 64].map(solve));
        assert!((order - 1.0).abs() < 0.1, "semi-implicit {semi}: {order}");
    }
}

#[test]
fn a_disc_shrinks_like_the_reference() {
    // Mean over 30 radii of an independent implementation, h = 1/128, after 1 and 8 steps of 2^-14: .00035, .00112 implicit,
    // .00070, .00227 semi-implicit. One radius near the middle of the list is within 40 % of the mean.
    let (eps, size) = (1.0 / 64.0, 1.0 / 16384.0);
    let radius = 0.125 * PI;
    let grid = Grid::<2>::per_unit(128, 1.5).unwrap();
    for (semi, expected) in [(false, [0.00035, 0.00112]), (true, [0.00070, 0.00227])] {
        let step = step_by(semi, &grid, eps, size);
        let mut u = disc(grid, radius, eps);
        for k in 1..=8 {
            u = step.step(&u).unwrap();
            let exact = disc(
                grid,
                mean_curvature_radius(radius, f64::from(k) * size, 2),
                eps,
            );
            let error = l2_distance(&u, &exact).unwrap();
            if k == 1 || k == 8 {
                let expected = expected[usize::from(k == 8)];
                assert!(
                    (error / expected - 1.0).abs() < 0.4,
                    "{k}: {error:e} {expected:e}"
                );
            }
        }
    }
}

#[test]
fn willmore_energies_of_spheres_and_clifford_tori() {
    // Values of an independent implementation; the exact energies are 8 pi = 25.13 and 4 pi^2 = 39.48.
    let grid = Grid::<3>::per_unit(64, 1.0).unwrap();
    let (eps, size) = (1.0 / 32.0, 1.0 / 4096.0);
    let step = FiniteElementStep::implicit(&grid, eps, size).unwrap();
    let w = |shape: Field<3>| step.willmore_energy(&shape).unwrap();
    for (radius, expected) in [(0.2, 25.64), (0.3, 25.63)] {
        let ball = phase_field(grid, &Ball::new([0.0; 3], radius).unwrap(), eps).unwrap();
        let found = w(ball);
        assert!((found / expected - 1.0).abs() < 0.01, "{radius}: {found}");
    }
    for (outer, expected) in [(0.40, 41.53), (0.45, 41.13)] {
        let torus = phase_field(grid, &Torus::clifford(outer).unwrap(), eps).unwrap();
        let found = w(torus);
        assert!((found / expected - 1.0).abs() < 0.01, "{outer}: {found}");
    }
}

#[test]
fn failures_are_typed_and_carry_their_numbers() {
    let (eps, grid) = (0.1, Grid::<2>::centred(16, 1.0).unwrap());
    let error = FiniteElementStep::implicit(&grid, eps, 0.9 * eps * eps)
        .err()
        .unwrap();
    assert!(matches!(error, Error::StepTooLarge { .. }), "{error}");
    assert!(error.to_string().contains("8/9 eps^2"), "{error}");
    for (cells, spacing, eps, size) in [
        (3, 0.1, 0.1, 0.001),
        (16, f64::NAN, 0.1, 0.001),
        (16, 0.1, -0.1, 0.001),
        (16, 0.1, 0.1, 0.0),
    ] {
        let solver = LinearSolver::default();
        let error = FiniteElements::<2>::new(cells, spacing, eps, size, solver)
            .err()
            .unwrap();
        assert!(matches!(error, Error::Geometry(_)), "{error}");
    }
    let elements =
        FiniteElements::<2>::new(16, 1.0 / 16.0, eps, 0.002, LinearSolver::default()).unwrap();
    let mut broken = vec![0.5; 256];
    broken[7] = f64::NAN;
    let error = elements.implicit_step(&broken).unwrap_err();
    assert!(matches!(error, Error::NonFinite { .. }), "{error}");
    elements.set_tolerances(Tolerances {
        iterations: 3,
        ..Tolerances::default()
    });
    let rough: Vec<f64> = (0..256).map(|i| f64::from(i * 7919 % 13) / 13.0).collect();
    let error = elements.linearized_solve(&rough, &rough).unwrap_err();
    let Error::NotConverged {
        iterations,
        residual,
        tolerance,
        ..
    } = error
    else {
        panic!("{error}")
    };
    assert!(iterations == 3 && residual > tolerance && residual < 0.1);
}
