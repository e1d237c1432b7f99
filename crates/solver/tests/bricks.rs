//! Flows on active bricks against those on the whole grid.

use std::sync::Arc;

use crate::common::flow::Flow;
use crate::common::{
    accurate, device, distance, dot, network, noise, params, passes_taylor_tests, scales,
};
use geometry::distance::SignedDistanceExt;
use geometry::measure::l2_distance;
use geometry::shapes::{Ball, Cross};
use geometry::{Bricks, Field, Grid, NodeSet, Nodes, SignedDistance, phase_field};
use linearize::taylor::halvings;
use model::{Network, SeparableOperator};
use solver::{
    Constraints, Domain, Error, FlowParams, Helfrich, MinimizingMovement, MovementGraph,
    NewtonParams, Objective, Precision, StartKind,
};

/// Scales with a solver so accurate that only the storage makes a difference.
pub fn exact<const D: usize>(grid: &Grid<D>) -> FlowParams {
    FlowParams {
        calibration: accurate(D).calibration().unwrap().factors,
        newton: NewtonParams {
            tolerance: 1e-7,
            cg_tolerance: 1e-2,
            precision: Precision::Device,
            ..NewtonParams::default()
        },
        ..params(grid)
    }
}

/// As accurate as steps are in which sizes are held.
pub fn holding<const D: usize>(grid: &Grid<D>) -> FlowParams {
    let exact = exact(grid);
    let newton = NewtonParams {
        tolerance: 1e-5,
        ..exact.newton
    };
    FlowParams { newton, ..exact }
}

pub fn usual<const D: usize>(grid: &Grid<D>) -> FlowParams {
    FlowParams {
        newton: NewtonParams::default(),
        ..exact(grid)
    }
}

pub fn dense<const D: usize>(start: &Field<D>, params: FlowParams) -> Flow<D> {
    Flow::with_network(&accurate(D), start, params, &device()).unwrap()
}

pub fn bricks<const D: usize>(start: &Field<D>, params: FlowParams) -> Flow<D> {
    Flow::on_bricks(&accurate(D), start, params, &device()).unwrap()
}

/// The L2 difference of both flows after these steps, over how far they went, and the largest relative difference of their energies.
fn difference<const D: usize>(start: &Field<D>, params: FlowParams, steps: &[f64]) -> (f64, f64) {
    difference_of(
        (&mut dense(start, params), &mut bricks(start, params)),
        steps,
    )
}

pub fn difference_of<const D: usize>(
    (whole, few): (&mut Flow<D>, &mut Flow<D>),
    steps: &[f64],
) -> (f64, f64) {
    let start = whole.field().unwrap();
    let mut energies: f64 = 0.0;
    for &tau in steps {
        let [a, b] = [&mut *whole, &mut *few].map(|flow| flow.advance(tau).unwrap());
        energies = energies.max((b.willmore_energy / a.willmore_energy - 1.0).abs());
    }
    let (whole, few) = (whole.field().unwrap(), few.field().unwrap());
    let apart = l2_distance(&whole, &few).unwrap() / l2_distance(&whole, &start).unwrap();
    println!("difference over motion {apart:.1e}, of the energies {energies:.1e}");
    (apart, energies)
}

fn field<const D: usize>(grid: Grid<D>, shape: &impl SignedDistance<D>) -> Field<D> {
    phase_field(grid, shape, 2.0 * grid.spacing()).unwrap()
}

pub fn cross() -> Field<2> {
    cross_of(128)
}

/// With so many cells per unit.
pub fn cross_of(cells: usize) -> Field<2> {
    let grid = Grid::per_unit(cells, 2.0).unwrap();
    field(grid, &Cross::new(0.8, 0.27).unwrap())
}

fn dented() -> Field<3> {
    dented_of(64, 0.17)
}

/// With so many cells per side of a box of 1/2.
pub fn dented_of(cells: usize, radius: f64) -> Field<3> {
    let dented = move |x: [f64; 3]| {
        let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [a, b, c] = x.map(|x| x / r.max(1e-9));
        r - radius * (1.0 + 0.2 * (4.0 * a * b * c + 0.5 * c.powi(3) - 0.4 * a * a))
    };
    field(Grid::centred(cells, 0.5).unwrap(), &dented)
}

/// Gradient and Hessian-vector products of the energy on bricks with holes, about a field that is rough there.
fn derivatives<const D: usize>(cells: usize) {
    let device = device();
    let operator = SeparableOperator::<D>::new(&accurate(D), &device).unwrap();
    let hole = |place: [usize; D]| place.iter().sum::<usize>() % 4 == 2;
    let side = operator.brick_side();
    let bricks = Bricks::new(cells, side, |place| !hole(place), |place| place[0] == 0).unwrap();
    let shape = bricks.shape();
    let step = Arc::new(operator.on(&bricks, &device));
    let grid = Grid::new(cells, 1.0).unwrap();
    let nodes = Nodes::on_bricks(grid, Arc::new(bricks.clone()));
    let domain = Domain::new(nodes, operator.phase_values(), scales(&grid), &device);
    let mut energy = MinimizingMovement::traced(MovementGraph {
        step,
        domain: &domain,
        terms: &[],
        unit: 1.0,
        products: Precision::Device,
        weighted: false,
    })
    .unwrap();
    let [u, anchor, p] = [1, 2, 3].map(|seed| noise(bricks.len(), seed));
    energy.set(&device.tensor(&anchor, shape), 40.0).unwrap();
    let at = |t: f64| -> Vec<f64> { u.iter().zip(&p).map(|(u, p)| u + t * p).collect() };
    let direction = device.tensor::<D>(&p, shape);
    let (_, gradient) = energy.evaluate(&device.tensor(&u, shape)).unwrap();
    let product = energy.hessian_vector_product(&direction).unwrap();
    let derivatives = [gradient, product].map(|a| dot(&device.values(a).unwrap(), &p));
    let value = |t: f64| energy.value(&device.tensor(&at(t), shape)).unwrap();
    passes_taylor_tests(value, derivatives, &halvings(0.1, 8));
}

#[test]
fn derivatives_pass_taylor_tests() {
    derivatives::<2>(64);
    derivatives::<3>(32);
}

#[test]
fn pure_phases_cost_nothing() {
    let (device, grid) = (device(), Grid::<3>::centred(32, 0.5).unwrap());
    let operator = SeparableOperator::<3>::new(&accurate(3), &device).unwrap();
    for (phase, rest) in [false, true].into_iter().zip(operator.phase_values()) {
        let some = |place: [usize; 3]| place[0] != place[1];
        let bricks = Bricks::new(grid.cells(), 8, some, |_| phase).unwrap();
        let u = vec![rest; bricks.len()];
        let u = device.tensor::<3>(&u, bricks.shape());
        let image = device
            .values(operator.on(&bricks, &device).apply(u))
            .unwrap();
        let errors = image.iter().map(|v| (v - rest).abs());
        let worst = errors.max_by(f64::total_cmp).unwrap();
        assert!(
            (rest.abs() - 1.0).abs() < 1e-3 && worst < 1e-13,
            "{rest} {worst:e}"
        );
    }
}

#[test]
fn a_cross_flows_as_on_the_whole_grid() {
    let start = cross();
    let tau = exact(start.grid()).mcf_step;
    let (apart, energies) = difference(&start, exact(start.grid()), &[tau; 8]);
    assert!(apart < 2e-6 && energies < 1e-6, "{apart:e} {energies:e}");
}

#[test]
fn a_surface_flows_as_on_the_whole_grid() {
    let (start, params) = (dented(), exact(dented().grid()));
    let (apart, energies) = difference(&start, params, &[params.mcf_step / 4.0; 8]);
    assert!(apart < 2e-6 && energies < 1e-6, "{apart:e} {energies:e}");
}

#[test]
fn fronts_that_meet_flow_as_on_the_whole_grid() {
    let grid = Grid::<2>::per_unit(128, 1.0).unwrap();
    let (eps, tau) = (params(&grid).eps, params(&grid).mcf_step);
    let disc = |x: f64| Ball::new([x, 0.0], 0.12).unwrap();
    let pair = disc(-0.12 - 0.2 * eps).union(disc(0.12 + 0.2 * eps));
    // Discs that merge, and holes that do.
    for phase in [1.0, -1.0] {
        let start = field(grid, &pair).map(|u| phase * u);
        let mut whole = dense(&start, exact(&grid));
        (0..4).for_each(|_| assert!(whole.advance(tau).is_ok()));
        let between = |u: &Field<2>| u.interpolate([0.0, 0.0]) * phase;
        assert!(between(&start) < 0.0 && between(&whole.field().unwrap()) > 0.0);
        let (apart, energies) = difference(&start, exact(&grid), &[tau; 4]);
        assert!(apart < 2e-6 && energies < 1e-6, "{apart:e} {energies:e}");
    }
}

#[test]
fn held_sizes_flow_as_on_the_whole_grid() {
    fn check<const D: usize>(start: &Field<D>, tau: f64, perimeter_too: bool) {
        let params = holding(start.grid());
        let mut held = Constraints::keeping(start, params.eps).unwrap();
        held.perimeter = held.perimeter.filter(|_| perimeter_too);
        let mut flows = (dense(start, params), bricks(start, params));
        for flow in [&mut flows.0, &mut flows.1] {
            flow.constrain(held).unwrap();
        }
        let (apart, energies) = difference_of((&mut flows.0, &mut flows.1), &[tau; 2]);
        assert!(apart < 2e-6 && energies < 1e-6, "{apart:e} {energies:e}");
    }
    let start = cross();
    check(&start, params(start.grid()).mcf_step, true);
    let grid = Grid::<3>::centred(48, 0.375).unwrap();
    let egg = |x: [f64; 3]| {
        let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        r - 0.1 * (1.0 + 0.3 * (x[0] / r.max(1e-9)).powi(2))
    };
    check(&field(grid, &egg), params(&grid).mcf_step / 4.0, false);
}

#[test]
fn a_step_beyond_the_first_bricks_makes_them_more() {
    let start = cross();
    let params = exact(start.grid());
    let (mut whole, mut few) = (dense(&start, params), bricks(&start, params));
    let before = few.state.field.nodes().len();
    let (apart, energies) = difference_of((&mut whole, &mut few), &[8.0 * params.mcf_step]);
    assert!(few.state.field.nodes().len() > before, "{before:?}");
    // The first phase field had no more than the first bricks.
    assert!(apart < 2e-6 && energies < 1e-5, "{apart:e} {energies:e}");
}

#[test]
fn the_same_flow_again_and_from_the_middle_has_the_same_bytes() {
    let start = cross();
    let tau = usual(start.grid()).mcf_step;
    let run = |flow: &mut Flow<2>, steps: usize| -> Vec<usize> {
        (0..steps)
            .map(|_| flow.advance(tau).unwrap().newton.hvp)
            .collect()
    };
    let mut flow = bricks(&start, usual(start.grid()));
    let first = run(&mut flow, 3);
    let state = flow.state();
    let rest = run(&mut flow, 2);
    let end = flow.field().unwrap();
    println!("{first:?} {rest:?}");

    let mut again = bricks(&start, usual(start.grid()));
    assert_eq!(run(&mut again, 5), [first, rest.clone()].concat());
    assert_eq!(again.field().unwrap(), end);

    let mut resumed = bricks(&start, usual(start.grid()));
    resumed.restore(&state);
    assert_eq!(run(&mut resumed, 2), rest);
    assert_eq!(resumed.field().unwrap(), end);
}

#[test]
fn second_order_steps_go_on_bricks_too() {
    let start = cross();
    let grid = *start.grid();
    let tau = params(&grid).mcf_step;
    let (mut whole, mut few) = (dense(&start, exact(&grid)), bricks(&start, exact(&grid)));
    for _ in 0..3 {
        for flow in [&mut whole, &mut few] {
            assert!(flow.advance_second_order(tau).is_ok());
        }
    }
    let (whole, few) = (whole.field().unwrap(), few.field().unwrap());
    let found = l2_distance(&whole, &few).unwrap() / l2_distance(&whole, &start).unwrap();
    println!("difference over motion {found:.1e}");
    assert!(found < 4e-6, "{found:e}");
}

/// Outside of the region nothing moves, not even where bricks have constants. The start has flowed a little: of another one the tails, some 1e-5,
/// would stay on the grid for ever.
#[test]
fn a_region_moves_on_bricks_as_on_the_grid() {
    let grid = *cross().grid();
    let mut flow = bricks(&cross(), exact(&grid));
    flow.advance(exact(&grid).mcf_step).unwrap();
    let start = flow.field().unwrap();
    let inside: NodeSet = (0..grid.len()).map(|i| grid.node(i)[0] > 0.1).collect();
    let params = exact(&grid);
    let ends = [dense, bricks].map(|flow| {
        let mut flow = flow(&start, params);
        flow.restrict_to(&inside).unwrap();
        for _ in 0..8 {
            flow.advance(params.mcf_step / 4.0).unwrap();
        }
        let end = flow.field().unwrap();
        assert!(l2_distance(&end, &start).unwrap() > 1e-3);
        for (node, _) in inside.iter().enumerate().filter(|(_, moves)| !moves) {
            // Up to the values that are not stored.
            let change = end.values()[node] - start.values()[node];
            assert!(change.abs() < 2e-5, "node {node}: {change:e}");
        }
        end
    });
    let apart = l2_distance(&ends[0], &ends[1]).unwrap() / l2_distance(&ends[0], &start).unwrap();
    println!("difference over motion {apart:.1e}");
    assert!(apart < 2e-6, "{apart:e}");
}

/// As [`difference`], with these terms in the energy.
fn difference_with<const D: usize>(start: &Field<D>, helfrich: Helfrich) -> (f64, f64) {
    let params = exact(start.grid());
    let response = accurate(D).calibration().unwrap().response();
    let mut flows = (dense(start, params), bricks(start, params));
    let terms = || helfrich.terms().unwrap();
    flows.0.set_energy(terms(), response).unwrap();
    flows.1.set_energy(terms(), response).unwrap();
    difference_of((&mut flows.0, &mut flows.1), &[params.mcf_step / 4.0; 2])
}

#[test]
fn spontaneous_curvature_tension_and_pressure_are_those_of_the_whole_grid() {
    let bent = Helfrich {
        spontaneous_curvature: 4.0,
        ..Helfrich::default()
    };
    let loaded = Helfrich {
        tension: 60.0,
        pressure: -300.0,
        ..Helfrich::default()
    };
    // The term of the spontaneous curvature is in proportion to the slope of the profile, whose tails end at the edge.
    for ((apart, energies), most) in [
        (difference_with(&cross(), bent), 2e-5),
        (difference_with(&cross(), loaded), 3e-6),
        (difference_with(&dented(), loaded), 3e-6),
    ] {
        assert!(apart < most && energies < 1e-6, "{apart:e} {energies:e}");
    }
}

#[test]
fn what_bricks_cannot_do_is_refused_in_one_line() {
    let grid = Grid::<2>::per_unit(128, 0.75).unwrap();
    let start = field(grid, &Ball::new([0.0, 0.0], 0.2).unwrap());
    let on = |network: &Network, start: &Field<2>| {
        Flow::on_bricks(network, start, usual(start.grid()), &device())
    };
    let error = on(&network(), &start).err().unwrap();
    assert!(error.to_string().contains("accurate recipe"), "{error}");
    let flat = on(&accurate(2), &Field::constant(grid, 1.0));
    assert!(matches!(flat, Err(Error::NoInterface)));
    let odd = Grid::<2>::centred(72, 72.0 / 128.0).unwrap();
    let odd = on(
        &accurate(2),
        &field(odd, &Ball::new([0.0, 0.0], 0.2).unwrap()),
    );
    assert!(odd.err().unwrap().to_string().contains("bricks of 16"));

    let mut flow = bricks(&start, usual(&grid));
    assert_eq!(flow.begin_on_half_grids().unwrap(), 0);
    assert_ne!(flow.advance(1e-5).unwrap().start.kind, StartKind::HalfGrid);
    let whole = distance(flow.field().unwrap().values(), start.values());
    assert!(whole > 0.0);
}
