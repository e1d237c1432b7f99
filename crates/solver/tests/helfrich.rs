//! Spontaneous curvature, tension and pressure.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::flow::Flow;
use crate::common::{
    accurate, ball, device, dot, network, network_3d, noise, params, passes_taylor_tests, ratios,
    scales, values,
};
use crate::domain::Both;
use burn::tensor::Tensor;
use geometry::zero_set::ball_perimeter;
use geometry::{Field, Grid, ZeroSet};
use linearize::taylor::halvings;
use model::{MeanCurvatureOperator, Network, SeparableOperator, Shipped};
use solver::{
    Domain, Error, Helfrich, MeanCurvatureStep, MinimizingMovement, MovementGraph, Objective,
    Precision,
};

const ALL: Helfrich = Helfrich {
    spontaneous_curvature: 3.0,
    tension: 7.0,
    pressure: -11.0,
};

fn energy_with<const D: usize>(
    helfrich: Helfrich,
    network: &Network,
    grid: &Grid<D>,
) -> MinimizingMovement<D> {
    let device = device();
    let operator = MeanCurvatureOperator::new(network, &device).unwrap();
    let domain = Domain::new((*grid).into(), [-1.0, 1.0], scales(grid), &device);
    MinimizingMovement::traced(MovementGraph {
        step: Arc::new(operator),
        domain: &domain,
        terms: &helfrich.terms().unwrap(),
        unit: params(grid).energy_unit(),
        products: Precision::Device,
        weighted: false,
    })
    .unwrap()
}

fn derivatives<const D: usize>(network: &Network, cells: usize) {
    let grid = Grid::<D>::centred(cells, 1.0).unwrap();
    let device = device();
    let tensor = |x: &[f64]| -> Tensor<D> { device.tensor(x, grid.shape()) };
    let rough = |radius: f64, seed: u64| -> Vec<f64> {
        let field = ball(grid, radius);
        let noise = noise(grid.len(), seed);
        (field.values().iter().zip(noise))
            .map(|(u, x)| u + 0.05 * x)
            .collect()
    };
    let (u, previous) = (rough(0.3, 1), rough(0.28, 2));
    let (p, q) = (noise(grid.len(), 3), noise(grid.len(), 4));
    let mut energy = energy_with(ALL, network, &grid);
    energy.set(&tensor(&previous), 300.0).unwrap();

    let (_, gradient) = energy.evaluate(&tensor(&u)).unwrap();
    let gradient = device.values(gradient).unwrap();
    let mut apply = |p: &[f64]| {
        let product = energy.hessian_vector_product(&tensor(p)).unwrap();
        device.values(product).unwrap()
    };
    let (hp, hq) = (apply(&p), apply(&q));
    let scale = (dot(&hp, &hp) * dot(&q, &q)).sqrt();
    assert!((dot(&hp, &q) - dot(&p, &hq)).abs() < 1e-12 * scale);

    let at = |t: f64| {
        let moved: Vec<f64> = u.iter().zip(&p).map(|(u, p)| u + t * p).collect();
        energy.value(&tensor(&moved)).unwrap()
    };
    let derivatives = [dot(&gradient, &p), dot(&hp, &p)];
    passes_taylor_tests(at, derivatives, &halvings(0.5, 12));
}

#[test]
fn derivatives_pass_taylor_tests() {
    derivatives::<2>(&network(), 32);
    derivatives::<3>(&network_3d(), 20);
}

/// `1/2 |V[u] - u + g tautilde c0 q'|^2 + unit (sigma A + p V) / h^D` by loops, from the field on the grid and the residuals at
/// the nodes that are stored.
fn by_formula<const D: usize>(
    u: &[f64],
    residuals: &[f64],
    domain: &Domain<D>,
    helfrich: Helfrich,
) -> f64 {
    let (grid, h) = (domain.grid(), domain.spacing());
    let (eps, tautilde) = (domain.eps(), domain.mcf_step());
    let (nodes, mut sum) = (domain.nodes(), 0.0);
    let unit = params(grid).energy_unit();
    let mut double_well = 0.0;
    let mut volume = domain.unstored()[1] as f64;
    for (node, residual) in residuals.iter().enumerate() {
        let u = u[grid.index(nodes.multi_index(node))];
        let slope = 0.75 / eps * (1.0 - u * u);
        let shift = domain.response() * tautilde * helfrich.spontaneous_curvature * slope;
        sum += 0.5 * (residual + shift).powi(2);
        double_well += 9.0 / 16.0 * (1.0 - u * u).powi(2);
        volume += 0.25 * (2.0 + 3.0 * u - u.powi(3));
    }
    let weights = [8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];
    let mut dirichlet = 0.0;
    for node in 0..grid.len() {
        let beside = |axis: usize, steps: usize| {
            let mut place = grid.multi_index(node);
            place[axis] += steps;
            u[grid.index(place)]
        };
        for axis in 0..D {
            for (k, weight) in weights.iter().enumerate() {
                // -sum u d u = sum w_k (u_(i+k) - u_i)^2
                dirichlet += weight * (beside(axis, k + 1) - u[node]).powi(2) / (h * h);
            }
        }
    }
    let perimeter = 0.5 * (eps * dirichlet + double_well / eps);
    sum + unit * (helfrich.tension * perimeter + helfrich.pressure * volume)
}

fn is_the_formula<const D: usize>(cells: usize, bound: f64) {
    let (device, both, network) = (device(), Both::<D>::wide(cells), accurate(D));
    let on_grid = values(&both.on_grid);
    let check = |step: Arc<dyn MeanCurvatureStep<D>>, domain: &Domain<D>, u: &Tensor<D>| {
        let residuals = values(&(step.apply(u.clone()) - u.clone()));
        let graph = MovementGraph {
            step,
            domain,
            terms: &ALL.terms().unwrap(),
            unit: params(domain.grid()).energy_unit(),
            products: Precision::Device,
            weighted: false,
        };
        let mut energy = MinimizingMovement::traced(graph).unwrap();
        energy.set(u, 1.0).unwrap();
        let found = energy.value(u).unwrap();
        let expected = by_formula(&on_grid, &residuals, domain, ALL);
        let error = (found / expected - 1.0).abs();
        assert!(error < bound, "{D}: {found} {expected} {error:e}");
    };
    let step = MeanCurvatureOperator::new(&network, &device).unwrap();
    check(Arc::new(step), &both.whole, &both.on_grid);
    let operator = SeparableOperator::new(&network, &device).unwrap();
    let step = operator.on(&both.bricks, &device);
    check(Arc::new(step), &both.few, &both.on_bricks);
}

#[test]
fn energies_are_those_of_the_formulas() {
    is_the_formula::<2>(128, 1e-12);
    is_the_formula::<3>(64, 1e-4);
}

/// `A` and `V` of a ball, and their derivatives by its radius.
fn sizes<const D: usize>(network: &Network, cells: usize) {
    let grid = Grid::<D>::centred(cells, 1.0).unwrap();
    let eps = params(&grid).eps;
    let of = |helfrich: Helfrich, radius: f64| {
        let u = device().tensor(ball(grid, radius).values(), grid.shape());
        let value = |helfrich: Helfrich| {
            let mut energy = energy_with(helfrich, network, &grid);
            energy.set(&u, 1.0).unwrap();
            energy.value(&u).unwrap()
        };
        let scale = eps * grid.cell_volume() / params(&grid).mcf_step.powi(2);
        scale * (value(helfrich) - value(Helfrich::default()))
    };
    let (tension, pressure) = (stretched(1.0), pressed(1.0));
    let d = D as f64;
    let (radius, step) = (0.3, 1e-3);
    let slope =
        |helfrich| (of(helfrich, radius + step) - of(helfrich, radius - step)) / (2.0 * step);
    // The second moment of eps q'^2, in which shells beside the interface are larger and smaller.
    let moment = 4.0 / 27.0 * (PI * PI - 6.0) * (eps / radius).powi(2);
    let beside = 0.5 * (d - 1.0) * (d - 2.0) * moment;
    let volume = ball_volume(D) * radius.powi(D as i32);
    let area = d * volume / radius * (1.0 + beside);
    let inside = volume * (1.0 + 0.5 * d * (d - 1.0) * moment);
    let bent = d * (d - 1.0) * volume / radius.powi(2);
    for (name, found, exact) in [
        ("A", of(tension, radius), area),
        ("V", of(pressure, radius), inside),
        ("dA/dR", slope(tension), bent),
        ("dV/dR", slope(pressure), area),
    ] {
        assert!(
            (found / exact - 1.0).abs() < 1e-3,
            "{D} {name}: {found} {exact}"
        );
    }
}

/// The volume of the unit ball.
fn ball_volume(dimension: usize) -> f64 {
    let d = dimension as i32;
    (ball_perimeter(dimension, 1.0) / f64::from(d)).powi(d)
}

#[test]
fn sizes_of_balls_are_those_of_the_profile() {
    sizes::<2>(&network(), 64);
    sizes::<3>(&network_3d(), 32);
}

fn flow<const D: usize>(u: &Field<D>, helfrich: Helfrich) -> Flow<D> {
    flow_by(Shipped::Accurate, u, helfrich)
}

/// A calibrated flow by a network of either recipe.
fn flow_by<const D: usize>(recipe: Shipped, u: &Field<D>, helfrich: Helfrich) -> Flow<D> {
    let network = recipe.find(ratios(D)).unwrap();
    let calibration = network.calibration().unwrap();
    let mut params = params(u.grid());
    params.calibration = calibration.factors;
    let network = network.odd_part();
    let mut flow = Flow::with_network(&network, u, params, &device()).unwrap();
    let terms = helfrich.terms().unwrap();
    flow.set_energy(terms, calibration.response()).unwrap();
    flow
}

fn radius<const D: usize>(flow: &Flow<D>) -> f64 {
    let u = flow.field().unwrap();
    let volume = ZeroSet::of(&u, params(u.grid()).eps).unwrap().volume;
    (volume / ball_volume(D)).powf(1.0 / D as f64)
}

/// The speed of a ball of radius `R`: minus the derivative of its energy by `R`, over its perimeter.
fn speed(dimension: usize, helfrich: Helfrich, radius: f64) -> f64 {
    let Helfrich {
        spontaneous_curvature: c0,
        tension,
        pressure,
    } = helfrich;
    let k = (dimension - 1) as f64;
    // w = |S| (1/2 (k/R - c0)^2 R^k + sigma R^k + p R^(k+1) / (k+1))
    let excess = k / radius - c0;
    excess * k / radius.powi(2)
        - 0.5 * k * excess.powi(2) / radius
        - k * tension / radius
        - pressure
}

/// The radius after a time, by small Runge-Kutta steps.
fn exact(dimension: usize, helfrich: Helfrich, start: f64, time: f64) -> f64 {
    const STEPS: usize = 1000;
    let dt = time / STEPS as f64;
    (0..STEPS).fold(start, |r, _| {
        let middle = r + 0.5 * dt * speed(dimension, helfrich, r);
        r + dt * speed(dimension, helfrich, middle)
    })
}

const fn bent(c0: f64) -> Helfrich {
    Helfrich {
        spontaneous_curvature: c0,
        tension: 0.0,
        pressure: 0.0,
    }
}

const fn stretched(tension: f64) -> Helfrich {
    Helfrich {
        spontaneous_curvature: 0.0,
        tension,
        pressure: 0.0,
    }
}

const fn pressed(pressure: f64) -> Helfrich {
    Helfrich {
        spontaneous_curvature: 0.0,
        tension: 0.0,
        pressure,
    }
}

/// Four steps of either order move the radius as the ordinary differential equation does, up to this part of the motion.
fn follows_the_equation<const D: usize>(
    u: &Field<D>,
    start: f64,
    helfrich: Helfrich,
    tau: f64,
    bounds: [f64; 2],
) {
    for (second, bound) in [false, true].into_iter().zip(bounds) {
        let mut flow = flow(u, helfrich);
        for _ in 0..4 {
            if second {
                flow.advance_second_order(tau).unwrap();
            } else {
                flow.advance(tau).unwrap();
            }
        }
        let found = radius(&flow) - start;
        let expected = exact(D, helfrich, start, flow.time()) - start;
        let error = found / expected - 1.0;
        assert!(
            error.abs() < bound,
            "{helfrich:?}, second order {second}: {found} {expected} {error}"
        );
    }
}

#[test]
fn discs_follow_the_ordinary_differential_equation() {
    let grid = Grid::<2>::per_unit(128, 1.0).unwrap();
    let (u, tau) = (ball(grid, 0.25), grid.spacing().powi(2));
    for helfrich in [bent(6.0), stretched(16.0), pressed(64.0)] {
        follows_the_equation(&u, 0.25, helfrich, tau, [0.02, 0.004]);
    }
}

/// What is left is of the second order in `eps / R = .18`.
#[test]
fn balls_follow_the_ordinary_differential_equation() {
    let grid = Grid::<3>::per_unit(40, 1.0).unwrap();
    let (u, tau) = (ball(grid, 0.28), 0.25 * grid.spacing().powi(2));
    for (helfrich, bound) in [(stretched(6.0), 0.01), (pressed(40.0), 0.03)] {
        follows_the_equation(&u, 0.28, helfrich, tau, [bound; 2]);
    }
}

/// The radius at rest, over the exact one.
fn at_rest<const D: usize>(
    recipe: Shipped,
    grid: Grid<D>,
    start: f64,
    helfrich: Helfrich,
    expected: f64,
) -> f64 {
    assert!(speed(D, helfrich, expected).abs() < 1e-9);
    let mut flow = flow_by(recipe, &ball(grid, start), helfrich);
    for tau in [1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3, 2e-3, 2e-3, 2e-3, 2e-3] {
        flow.advance(tau).unwrap();
    }
    radius(&flow) / expected
}

/// Up to the second order in `eps / R = .08`.
#[test]
fn discs_come_to_rest_at_their_exact_radius() {
    let grid = Grid::<2>::per_unit(128, 1.0).unwrap();
    let (accurate, papers) = (Shipped::Accurate, Shipped::Paper);
    for (recipe, helfrich) in [
        (accurate, bent(5.0)),
        (accurate, bent(-5.0)),
        (accurate, stretched(12.5)),
        (accurate, pressed(62.5)),
        // Its response to curvature is 3 % too small.
        (papers, bent(5.0)),
    ] {
        let ratio = at_rest(recipe, grid, 0.202, helfrich, 0.2);
        println!("{recipe:?} {helfrich:?}: {ratio:.5}");
        assert!((ratio - 1.0).abs() < 0.01, "{helfrich:?}: {ratio}");
    }
}

/// A sphere of the spontaneous curvature has no energy; its radius is right to the second order in the width of the interface.
#[test]
fn balls_come_to_rest_at_their_spontaneous_curvature() {
    let error = |cells| {
        let grid = Grid::<3>::per_unit(cells, 1.0).unwrap();
        1.0 - at_rest(Shipped::Accurate, grid, 0.24, bent(8.0), 0.25)
    };
    let [coarse, fine] = [error(32), error(44)];
    println!("{coarse:.5} {fine:.5}");
    let order = (coarse / fine).ln() / (44.0_f64 / 32.0).ln();
    assert!(
        fine.abs() < 0.03 && (order - 2.0).abs() < 0.5,
        "{coarse} {fine} {order}"
    );
}

#[test]
fn what_is_not_finite_is_refused() {
    let u = ball(Grid::<2>::per_unit(64, 1.0).unwrap(), 0.2);
    let mut flow = flow(&u, Helfrich::default());
    for value in [f64::NAN, f64::INFINITY] {
        let errors = [
            bent(value).terms::<2>().err().unwrap(),
            flow.set_energy(Vec::new(), value).unwrap_err(),
        ];
        for error in errors {
            assert!(matches!(error, Error::Geometry(_)), "{error}");
        }
    }
}
