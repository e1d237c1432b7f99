//! The nested scheme: derivatives of its energy, and steps of Willmore flow.

use std::sync::Arc;

use burn::tensor::Tensor;
use chacha20::ChaCha8Rng;
use fem::{FiniteElementStep, LinearSolver, Tolerances};
use geometry::measure::{l2_distance, zero_set_volume};
use geometry::shapes::Ball;
use geometry::{Field, Grid, exact, phase_field};
use linearize::dual::{self, Dual};
use linearize::taylor::{halvings, remainder};
use operators::ComputeDevice;
use rand::{RngExt, SeedableRng};
use solver::{
    Error, Exit, FlowParams, MeanCurvatureFlow, MeanCurvatureStep, MinimizingMovement, Objective,
    Problem, Scheme, StepSize, Stepper,
};

const STIFFNESS: f64 = 40.0;

fn noise(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random_range(-0.5..0.5)).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn ball<const D: usize>(grid: Grid<D>, radius: f64, eps: f64) -> Field<D> {
    phase_field(grid, &Ball::new([0.0; D], radius).unwrap(), eps).unwrap()
}

/// All steps, solved to rounding.
fn steps<const D: usize>(grid: &Grid<D>) -> [FiniteElementStep<D>; 3] {
    let (eps, size) = (2.0 * grid.spacing(), grid.spacing().powi(2));
    let direct = LinearSolver::Direct;
    let steps = [
        FiniteElementStep::implicit(grid, eps, size).unwrap(),
        FiniteElementStep::semi_implicit(grid, eps, size).unwrap(),
        FiniteElementStep::implicit_with(grid, eps, size, direct).unwrap(),
    ];
    for step in &steps {
        step.elements().set_tolerances(Tolerances {
            linear: 1e-13,
            newton: 1e-15,
            ..Tolerances::default()
        });
    }
    steps
}

/// The derivatives of one energy at one point.
fn derivatives<const D: usize>(cells: usize) {
    let grid = Grid::<D>::centred(cells, 1.0).unwrap();
    let device = ComputeDevice::default_compiled().unwrap();
    let rough = |radius: f64, seed: u64| -> Vec<f64> {
        let field = ball(grid, radius, 2.0 * grid.spacing());
        let noise = noise(grid.len(), seed);
        (field.values().iter().zip(noise))
            .map(|(u, x)| u + 0.05 * x)
            .collect()
    };
    let (u, previous) = (rough(0.3, 1), rough(0.28, 2));
    let (p, q) = (noise(grid.len(), 3), noise(grid.len(), 4));
    let tensor = |x: &[f64]| -> Tensor<D> { device.tensor(x, grid.shape()) };
    for (which, step) in steps(&grid).into_iter().enumerate() {
        let mut energy = MinimizingMovement::new(Arc::new(step.clone()), cells, &device).unwrap();
        energy.set(&tensor(&previous), STIFFNESS).unwrap();

        // By hand, on the host.
        let field = Field::from_values(grid, u.clone()).unwrap();
        let v = step.step(&field).unwrap();
        let square = |x: &[f64]| dot(x, &step.elements().mass(x));
        let minus =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        let expected =
            0.5 * (square(&minus(&u, &previous)) + STIFFNESS * square(&minus(v.values(), &u)));
        let (value, gradient) = energy.evaluate(&tensor(&u)).unwrap();
        assert!((value / expected - 1.0).abs() < 1e-12, "{value} {expected}");

        let gradient = device.values(gradient).unwrap();
        let mut apply = |p: &[f64]| {
            let product = energy.hessian_vector_product(&tensor(p)).unwrap();
            device.values(product).unwrap()
        };
        let (hp, hq) = (apply(&p), apply(&q));
        let scale = (dot(&hp, &hp) * dot(&q, &q)).sqrt();
        let asymmetry = (dot(&hp, &q) - dot(&p, &hq)).abs() / scale;
        assert!(asymmetry < 1e-11, "{which}: {asymmetry:e}");

        // Reverse over forward.
        let independent = dual::hessian_vector_product(&tensor(&u), &tensor(&p), |u| {
            let v = step.apply(u.primal.clone());
            let dv = step.derivative(u.primal.clone(), v.clone(), u.tangent.clone());
            let residual = Dual::new(v, dv) - u.clone();
            let motion = u - tensor(&previous).autodiff();
            let square = |x: Dual<D>| (x.clone() * x.linear(|x| step.mass(x))).sum();
            (square(motion) + square(residual) * STIFFNESS) * 0.5
        });
        let independent = device.values(independent).unwrap();
        let error = minus(&hp, &independent);
        let error = (dot(&error, &error) / dot(&hp, &hp)).sqrt();
        assert!(error < 1e-10, "{which}: {error:e}");

        // Taylor tests.
        let mut at = |t: f64| {
            let moved: Vec<f64> = u.iter().zip(&p).map(|(u, p)| u + t * p).collect();
            energy.value(&tensor(&moved)).unwrap()
        };
        let times = halvings(0.5, 12);
        let (first, second) = (dot(&gradient, &p), dot(&hp, &p));
        let precision = 1e-13;
        let rate = |derivatives: &[f64], at: &mut dyn FnMut(f64) -> f64| {
            remainder(at, derivatives, &times, precision)
                .rate()
                .unwrap()
        };
        let two = rate(&[first], &mut at);
        let three = rate(&[first, second], &mut at);
        assert!((two - 2.0).abs() < 0.1, "{which}: {two}");
        assert!((three - 3.0).abs() < 0.2, "{which}: {three}");
    }
}

/// Willmore flow with a step inside, from a phase field.
fn flow_of<const D: usize>(
    step: FiniteElementStep<D>,
    start: &Field<D>,
    params: FlowParams,
) -> Stepper<D> {
    let device = ComputeDevice::default_compiled().unwrap();
    let problem = Problem::new(step, start.grid(), params, &device).unwrap();
    let start = problem.start(start).unwrap();
    Stepper::new(problem, start)
}

#[test]
fn gradients_and_hessians_are_right_in_two_dimensions() {
    derivatives::<2>(20);
}

#[test]
fn gradients_and_hessians_are_right_in_three_dimensions() {
    derivatives::<3>(9);
}

/// `A(v)` is symmetric, and so is what solves with it.
#[test]
fn linearized_steps_are_self_adjoint() {
    let grid = Grid::<2>::centred(24, 1.0).unwrap();
    for step in steps(&grid) {
        let elements = step.elements();
        let v = ball(grid, 0.3, 2.0 * grid.spacing());
        let (a, b) = (noise(grid.len(), 1), noise(grid.len(), 2));
        let pairs = [
            (
                elements.linearized(v.values(), &a),
                elements.linearized(v.values(), &b),
            ),
            (
                elements.linearized_solve(v.values(), &a).unwrap(),
                elements.linearized_solve(v.values(), &b).unwrap(),
            ),
            (elements.heat_solve(&a), elements.heat_solve(&b)),
            (elements.mass(&a), elements.mass(&b)),
        ];
        for (xa, xb) in pairs {
            let scale = (dot(&xa, &xa) * dot(&b, &b)).sqrt();
            assert!((dot(&xa, &b) - dot(&a, &xb)).abs() < 1e-12 * scale);
        }
        let x = elements.linearized_solve(v.values(), &a).unwrap();
        let back = elements.linearized(v.values(), &x);
        let error: Vec<f64> = back.iter().zip(&a).map(|(x, y)| x - y).collect();
        assert!(dot(&error, &error) < 1e-22 * dot(&a, &a));
    }
}

#[test]
fn a_disc_grows_like_the_reference() {
    // r = 0.19635, tau = tautilde = 2^-14, eps = 2^-6, h = 1/128, steps 1, 8, 16, 32: values of an independent implementation.
    const RADIUS: f64 = 0.19635;
    let grid = Grid::<2>::per_unit(128, 0.875).unwrap();
    let (eps, tau) = (1.0 / 64.0, 1.0 / 16384.0);
    let params = FlowParams::paper(eps, tau);
    let start = ball(grid, RADIUS, eps);
    let step = FiniteElementStep::implicit(&grid, eps, tau).unwrap();
    let mut flow = flow_of(step, &start, params);
    let mut willmore = f64::INFINITY;
    for k in 1..=32 {
        let record = flow.step(tau).unwrap();
        assert_eq!(record.newton.exit, Exit::Converged, "{record:?}");
        assert!(record.energy < record.energy_before);
        assert!(record.willmore_energy < willmore);
        willmore = record.willmore_energy;
        let radius = exact::willmore_radius(RADIUS, f64::from(k) * tau, 2);
        let error = l2_distance(&flow.field().unwrap(), &ball(grid, radius, eps)).unwrap();
        let expected = match k {
            1 => 0.00174,
            8 => 0.00530,
            16 => 0.00872,
            32 => 0.01375,
            _ => continue,
        };
        assert!((error / expected - 1.0).abs() < 0.05, "{k}: {error:e}");
    }
}

#[test]
fn a_ball_stays_put_and_discs_shrink() {
    let grid = Grid::<3>::per_unit(24, 1.0).unwrap();
    let (eps, size) = (2.0 * grid.spacing(), grid.spacing().powi(2));
    let params = FlowParams::paper(eps, size);
    let start = ball(grid, 0.3, eps);
    let steps = [
        FiniteElementStep::implicit(&grid, eps, size).unwrap(),
        FiniteElementStep::semi_implicit(&grid, eps, size).unwrap(),
    ];
    for step in steps {
        let mut flow = flow_of(step.clone(), &start, params);
        // The nested scheme is unstable for large steps with eps = 2h, as its authors found: the cube's step size.
        let record = flow.step(size / 64.0).unwrap();
        assert_eq!(record.newton.exit, Exit::Converged);
        let radius = |u: &Field<3>| (zero_set_volume(u) * 0.75 / std::f64::consts::PI).cbrt();
        let moved = radius(&flow.field().unwrap()) - radius(&start);
        assert!(
            moved.abs() < 0.15 * grid.spacing(),
            "{} h, {record:?}",
            moved / grid.spacing()
        );
        let Stepper { problem, state, .. } = flow_of(step, &start, params);
        let mut flow = Stepper::by(MeanCurvatureFlow, problem, state);
        for _ in 0..4 {
            flow.step(size).unwrap();
        }
        let expected = exact::mean_curvature_radius(0.3, 4.0 * size, 3);
        let found = radius(&flow.field().unwrap());
        assert!(
            (found - expected).abs() < 0.2 * grid.spacing(),
            "{found} {expected}"
        );
    }
}

#[test]
fn a_failing_inner_solver_stops_the_flow_with_its_numbers() {
    let grid = Grid::<2>::centred(24, 1.0).unwrap();
    let (eps, size) = (2.0 * grid.spacing(), grid.spacing().powi(2));
    let step = FiniteElementStep::implicit(&grid, eps, size).unwrap();
    // The cubes of these values overflow.
    let start = ball(grid, 0.3, eps).map(|u| 1e150 * u);
    let params = FlowParams::paper(eps, size);
    let Stepper { problem, state, .. } = flow_of(step.clone(), &start, params);
    let error = MeanCurvatureFlow.step(&problem, &state, StepSize::whole(size));
    let error = error.unwrap_err();
    assert!(matches!(error, Error::Step(_)), "{error}");
    assert!(error.to_string().contains("Newton's method"), "{error}");
    let mut flow = flow_of(step, &start, params);
    let error = flow.step(size).unwrap_err();
    assert!(matches!(error, Error::NonFinite { step: 1, .. }), "{error}");
}

/// Without calibration `R^4` grows at the rate `2 c/m`, as the flat interface predicts.
#[test]
fn discs_grow_at_the_predicted_rate() {
    let grid = Grid::<2>::centred(96, 1.5).unwrap();
    let (eps, tau) = (2.0 * grid.spacing(), grid.spacing().powi(2));
    let params = FlowParams::paper(eps, tau);
    for (step, tolerance) in [
        (FiniteElementStep::implicit(&grid, eps, tau).unwrap(), 0.01),
        (
            FiniteElementStep::semi_implicit(&grid, eps, tau).unwrap(),
            0.02,
        ),
    ] {
        let predicted = step.calibrate().unwrap().factors.speed();
        let mut flow = flow_of(step, &ball(grid, 0.5, eps), params);
        // The first step also relaxes the profile.
        let power = |flow: &Stepper<2>| {
            let area = zero_set_volume(&flow.field().unwrap());
            (area / std::f64::consts::PI).powi(2)
        };
        flow.step(tau).unwrap();
        let before = power(&flow);
        for _ in 0..4 {
            flow.step(tau).unwrap();
        }
        let measured = (power(&flow) - before) / (8.0 * tau);
        assert!(
            (measured / predicted - 1.0).abs() < tolerance,
            "{measured} {predicted}"
        );
    }
}
