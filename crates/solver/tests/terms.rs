//! Own terms of the energy, as somebody writes them who uses this crate.

use std::sync::Arc;

use burn::tensor::{Int, Tensor};
use geometry::{Field, Grid, NodeSet, measure::l2_distance};
use linearize::taylor::halvings;
use model::{MeanCurvatureOperator, SeparableOperator};
use serde_json::json;
use solver::{
    Constraints, Domain, EnergyTerm, EnergyTerms, Error, FlowParams, Identity, MinimizingMovement,
    MovementGraph, Objective, Precision, Pressure, StartKind, Tension,
};

use crate::bricks::{bricks, cross_of, dense, dented_of, difference_of, exact, holding, usual};
use crate::common::flow::Flow;
use crate::common::{accurate, device, dot, noise, params, passes_taylor_tests, values};
use crate::domain::Both;
use crate::start;

/// Coarser than that of other tests, since the preconditioner does not know own terms.
fn cross() -> Field<2> {
    cross_of(64)
}

/// `int g (x_D + 1)` over the inside.
struct Gravity {
    g: f64,
}

impl<const D: usize> EnergyTerm<D> for Gravity {
    fn density(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<D>>, Error> {
        Ok(Some(on.inside(u) * (on.coordinate(D - 1) + 1.0) * self.g))
    }

    fn identity(&self) -> Identity {
        Identity::new("gravity", json!({ "g": self.g }))
    }
}

/// A tension that is `1 + strength` times as large where the normal is along the first axis.
struct Anisotropic {
    sigma: f64,
    strength: f64,
}

impl<const D: usize> EnergyTerm<D> for Anisotropic {
    fn density(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<D>>, Error> {
        let squares = on.gradient(u).map(|slope| slope.clone() * slope);
        let first = squares[0].clone() * self.strength;
        let square = squares.into_iter().fold(first, |sum, square| sum + square);
        let slope = on.slope(u);
        let well = slope.clone() * slope;
        Ok(Some((square + well) * (0.5 * self.sigma * on.eps())))
    }

    fn identity(&self) -> Identity {
        let Self { sigma, strength } = self;
        let parameters = json!({ "sigma": sigma, "strength": strength });
        Identity::new("anisotropic tension", parameters)
    }
}

/// Uses every other operation: a smoothed curvature with a place of its own.
struct Everything;

impl<const D: usize> EnergyTerm<D> for Everything {
    fn energy(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<1>>, Error> {
        let smooth = on.convolve(u, &[0.25, 0.5, 0.25])?;
        let curved = on.laplacian(u) * on.spacing().powi(2);
        let cubes = smooth.clone() * smooth * curved.clone() * curved;
        Ok(Some((cubes.sum() + on.dirichlet(u)) * 3.0))
    }

    fn shift(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<D>>, Error> {
        let displacement = on.mcf_step() * on.response() * 30.0;
        Ok(Some(on.slope(u) * on.coordinate(0).sin() * displacement))
    }

    fn identity(&self) -> Identity {
        Identity::new("everything", json!(null))
    }
}

fn loads<const D: usize>() -> EnergyTerms<D> {
    let (sigma, strength) = (40.0, 0.5);
    vec![
        Arc::new(Gravity { g: -300.0 }),
        Arc::new(Anisotropic { sigma, strength }),
    ]
}

fn everything<const D: usize>() -> EnergyTerms<D> {
    let mut terms = loads();
    terms.push(Arc::new(Everything));
    terms.push(Arc::new(Tension { sigma: 5.0 }));
    terms
}

/// Of the energy with these terms on a domain, about the field there.
fn derivatives<const D: usize>(graph: MovementGraph<'_, D>, u: &Tensor<D>) {
    let (device, count) = (device(), u.shape().num_elements());
    let tensor = |x: &[f64]| device.tensor::<D>(x, u.dims());
    let mut energy = MinimizingMovement::traced(graph).unwrap();
    let [anchor, p, q] = [1, 2, 3].map(|seed| noise(count, seed));
    energy.set(&tensor(&anchor), 40.0).unwrap();
    let (_, gradient) = energy.evaluate(u).unwrap();
    let [hp, hq] = [&p, &q].map(|x| values(&energy.hessian_vector_product(&tensor(x)).unwrap()));
    let scale = (dot(&hp, &hp) * dot(&q, &q)).sqrt();
    assert!((dot(&hp, &q) - dot(&p, &hq)).abs() < 1e-12 * scale);
    let derivatives = [dot(&values(&gradient), &p), dot(&hp, &p)];
    let at = |t: f64| energy.value(&(u.clone() + tensor(&p) * t)).unwrap();
    passes_taylor_tests(at, derivatives, &halvings(0.1, 8));
}

fn derivatives_of_both<const D: usize>(cells: usize) {
    let (device, both, terms) = (device(), Both::<D>::narrow(cells), everything());
    let network = accurate(D);
    let unit = params(both.whole.grid()).energy_unit();
    let graph = |step, domain| MovementGraph {
        step,
        domain,
        terms: &terms,
        unit,
        products: Precision::Device,
        weighted: false,
    };
    let step = Arc::new(MeanCurvatureOperator::new(&network, &device).unwrap());
    derivatives(graph(step, &both.whole), &both.on_grid);
    let operator = SeparableOperator::new(&network, &device).unwrap();
    let step = Arc::new(operator.on(&both.bricks, &device));
    derivatives(graph(step, &both.few), &both.on_bricks);
}

#[test]
fn derivatives_pass_taylor_tests() {
    derivatives_of_both::<2>(128);
    derivatives_of_both::<3>(64);
}

/// Whatever is stored, the field and so its energy are the same.
#[test]
fn energies_do_not_depend_on_what_is_stored() {
    let energy = |term: &dyn EnergyTerm<2>, u: &Tensor<2>, on: &Domain<2>| {
        device()
            .scalar(term.energy(u, on).unwrap().unwrap())
            .unwrap()
    };
    let (less, more) = (Both::<2>::narrow(128), Both::<2>::wide(128));
    assert!(less.bricks.len() < more.bricks.len());
    let gravity = Gravity { g: -300.0 };
    let (sigma, strength) = (40.0, 0.5);
    let anisotropic = Anisotropic { sigma, strength };
    // Beside the smaller set of bricks differences of the rough field do not vanish.
    let cases: [(&dyn EnergyTerm<2>, &Both<2>); 3] =
        [(&gravity, &less), (&gravity, &more), (&anisotropic, &more)];
    for (term, part) in cases {
        let exact = energy(term, &part.on_grid, &part.whole);
        let found = energy(term, &part.on_bricks, &part.few);
        assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
    }
}

#[test]
fn gravity_at_a_constant_height_is_pressure() {
    struct Level;
    impl EnergyTerm<2> for Level {
        fn density(&self, u: &Tensor<2>, on: &Domain<2>) -> Result<Option<Tensor<2>>, Error> {
            let height = Field::constant(*on.grid(), 2.0);
            Ok(Some(on.inside(u) * on.field(&height)? * 50.0))
        }
        fn identity(&self) -> Identity {
            Identity::new("level", json!(null))
        }
    }
    let start = cross();
    for make in [dense, bricks] {
        let terms: [Arc<dyn EnergyTerm<2>>; 2] = [Arc::new(Level), Arc::new(Pressure { p: 100.0 })];
        let [(own, w), (built_in, v)] = terms.map(|term| {
            let mut flow = make(&start, usual(start.grid()));
            flow.set_energy(vec![term], 1.0).unwrap();
            let record = flow.advance(params(start.grid()).mcf_step).unwrap();
            (flow.field().unwrap(), record.willmore_energy)
        });
        let motion = l2_distance(&built_in, &start).unwrap();
        let apart = l2_distance(&own, &built_in).unwrap() / motion;
        println!("difference over motion {apart:.1e}");
        // What is constant here is 1.00002 there, where nothing is stored.
        assert!(
            apart < 1e-9 && (w / v - 1.0).abs() < 1e-4,
            "{apart:e} {w} {v}"
        );
    }
}

/// The difference of a flow on bricks to that on the whole grid, over the motion, after what `change` does to both.
fn apart<const D: usize>(
    start: &Field<D>,
    params: FlowParams,
    steps: &[f64],
    change: impl Fn(&mut Flow<D>),
) -> (f64, f64) {
    let mut flows = (dense(start, params), bricks(start, params));
    for flow in [&mut flows.0, &mut flows.1] {
        flow.set_energy(loads(), 1.0).unwrap();
        change(flow);
    }
    assert!(flows.1.state.field.nodes().len() < start.grid().len());
    difference_of((&mut flows.0, &mut flows.1), steps)
}

#[test]
fn own_terms_on_bricks_are_those_of_the_whole_grid() {
    let (plane, space) = (cross(), dented_of(48, 0.1));
    let [tau, quarter] = [plane.grid().spacing(), space.grid().spacing()].map(|h| h * h / 4.0);
    for (apart, energies) in [
        apart(&plane, exact(plane.grid()), &[tau; 2], |_| ()),
        apart(&space, holding(space.grid()), &[quarter], |_| ()),
    ] {
        assert!(apart < 1e-5 && energies < 1e-6, "{apart:e} {energies:e}");
    }
}

/// The inside that is not stored is most of the energy.
#[test]
fn energies_do_not_jump_where_bricks_change() {
    let start = cross_of(128);
    let tau = params(start.grid()).mcf_step / 2.0;
    let terms = || -> EnergyTerms<2> { vec![Arc::new(Gravity { g: -400.0 })] };
    let [whole, few] = [dense, bricks].map(|make| {
        let mut flow = make(&start, holding(start.grid()));
        flow.set_energy(terms(), 1.0).unwrap();
        let mut seen = Vec::new();
        for _ in 0..4 {
            let energy = flow.advance(tau).unwrap().willmore_energy;
            seen.push((energy, flow.state.field.nodes().len()));
        }
        seen
    });
    let sizes: Vec<usize> = few.iter().map(|(_, cells)| *cells).collect();
    println!("{whole:?} {few:?}");
    assert!(sizes.iter().any(|cells| *cells != sizes[0]), "{sizes:?}");
    for ((whole, _), (few, _)) in whole.iter().zip(few) {
        assert!((few / whole - 1.0).abs() < 1e-6, "{whole} {few}");
    }
}

#[test]
fn own_terms_go_with_held_volumes_and_regions() {
    let start = cross();
    let tau = params(start.grid()).mcf_step;
    let held = holding(start.grid());
    let (found, energies) = apart(&start, held, &[tau; 2], |flow| {
        let keeping = Constraints::keeping(&start, held.eps).unwrap();
        let volume = keeping.volume;
        let constraints = Constraints {
            volume,
            ..Constraints::default()
        };
        flow.constrain(constraints).unwrap();
    });
    assert!(found < 1e-5 && energies < 1e-5, "{found:e} {energies:e}");

    let grid = *start.grid();
    let inside: NodeSet = (0..grid.len()).map(|i| grid.node(i)[0] > 0.1).collect();
    let mut flow = bricks(&start, exact(&grid));
    flow.advance(tau).unwrap();
    let start = flow.field().unwrap();
    let (found, energies) = apart(&start, exact(&grid), &[tau / 4.0; 2], |flow| {
        flow.restrict_to(&inside).unwrap();
    });
    assert!(found < 1e-5 && energies < 1e-5, "{found:e} {energies:e}");
}

#[test]
fn own_terms_go_with_steps_of_second_order() {
    let start = cross();
    let tau = params(start.grid()).mcf_step;
    let [whole, few] = [dense, bricks].map(|make| {
        let mut flow = make(&start, exact(start.grid()));
        flow.set_energy(loads(), 1.0).unwrap();
        for _ in 0..3 {
            flow.advance_second_order(tau / 4.0).unwrap();
        }
        flow.field().unwrap()
    });
    let found = l2_distance(&whole, &few).unwrap() / l2_distance(&whole, &start).unwrap();
    println!("difference over motion {found:.1e}");
    assert!(found < 1e-5, "{found:e}");
}

#[test]
fn own_terms_with_products_in_single_precision_end_where_others_do() {
    let start = cross();
    let exact = exact(start.grid());
    let single = FlowParams {
        newton: solver::NewtonParams {
            precision: Precision::Single,
            tolerance: 1e-4,
            ..exact.newton
        },
        ..exact
    };
    for make in [dense, bricks] {
        let [double, single] = [exact, single].map(|params| {
            let mut flow = make(&start, params);
            flow.set_energy(loads(), 1.0).unwrap();
            flow.advance(params.mcf_step / 4.0).unwrap();
            flow.field().unwrap()
        });
        let motion = l2_distance(&double, &start).unwrap();
        let found = l2_distance(&double, &single).unwrap() / motion;
        assert!(found < 1e-3, "{found:e}");
    }
}

/// `int g height` over the inside, with a field of somebody's own.
struct Weight {
    height: Field<2>,
    g: f64,
}

impl EnergyTerm<2> for Weight {
    fn density(&self, u: &Tensor<2>, on: &Domain<2>) -> Result<Option<Tensor<2>>, Error> {
        Ok(Some(on.inside(u) * on.field(&self.height)? * self.g))
    }

    fn identity(&self) -> Identity {
        Identity::new("weight", json!({ "g": self.g }))
    }
}

#[test]
fn own_fields_serve_the_half_grids_on_which_steps_begin() {
    let weight = || -> EnergyTerms<2> {
        let height = Field::from_fn(start::grid(), |[x, y]| 1.0 + x + y * y);
        vec![Arc::new(Weight { height, g: 400.0 })]
    };
    let [(plain, before), (begun, after)] = [false, true].map(|half| {
        let mut flow = start::flow(half);
        flow.set_energy(weight(), 1.0).unwrap();
        let mut hvp = 0.0;
        for _ in 0..4 {
            let record = flow.advance(start::TAU).unwrap();
            assert_eq!(record.start.kind == StartKind::HalfGrid, half);
            hvp += record.hvp();
        }
        (flow.field().unwrap(), hvp)
    });
    let way = l2_distance(&plain, &start::cross()).unwrap();
    let difference = l2_distance(&plain, &begun).unwrap() / way;
    println!("{difference:.1e} of the way, {after} instead of {before} products");
    assert!(
        difference < 1e-2 && after < before,
        "{difference} {after} {before}"
    );
}

#[test]
fn what_does_not_fit_is_refused_at_once() {
    let mut flow = start::flow(false);
    let height = Field::constant(Grid::centred(100, 0.75).unwrap(), 1.0);
    let refused = flow.set_energy(vec![Arc::new(Weight { height, g: 1.0 })], 1.0);
    let mismatch = |e: &Error| matches!(e, Error::Geometry(geometry::Error::GridMismatch { .. }));
    assert!(refused.as_ref().is_err_and(mismatch), "{refused:?}");
    // The energy is the one before.
    flow.advance(start::TAU).unwrap();
}

/// A product of many numbers, for which there is no rule.
struct Product;

impl EnergyTerm<2> for Product {
    fn energy(&self, u: &Tensor<2>, _on: &Domain<2>) -> Result<Option<Tensor<1>>, Error> {
        let first: Tensor<1> = u.clone().slice([0..1, 0..4]).reshape([4]);
        let indices = Tensor::<1, Int>::arange(0..4, &u.device());
        let spread = first.clone().cumprod(0).gather(0, indices);
        Ok(Some(spread.sum()))
    }

    fn identity(&self) -> Identity {
        Identity::new("my product", json!(null))
    }
}

#[test]
fn a_term_without_a_rule_is_named() {
    let mut flow = start::flow(false);
    let terms: EnergyTerms<2> = vec![Arc::new(Gravity { g: 1.0 }), Arc::new(Product)];
    let error = flow.set_energy(terms, 1.0).unwrap_err();
    assert!(error.to_string().contains("`my product`"), "{error}");
    assert!(matches!(error, Error::Term { .. }), "{error}");
}

/// A density that is a function.
struct Of<const D: usize>(fn(&Tensor<D>, &Domain<D>) -> Tensor<D>);

impl<const D: usize> EnergyTerm<D> for Of<D> {
    fn density(&self, u: &Tensor<D>, on: &Domain<D>) -> Result<Option<Tensor<D>>, Error> {
        Ok(Some((self.0)(u, on)))
    }

    fn identity(&self) -> Identity {
        Identity::new("of a function", json!(null))
    }
}

fn refusal(density: fn(&Tensor<2>, &Domain<2>) -> Tensor<2>) -> Error {
    let mut flow = start::flow(false);
    let refused = flow.set_energy(vec![Arc::new(Of(density))], 1.0);
    let error = refused.unwrap_err();
    assert!(error.to_string().contains("`of a function`"), "{error}");
    error
}

#[test]
fn densities_of_another_shape_are_refused() {
    let error = refusal(|u, on| on.inside(u).sum().reshape([1, 1]));
    assert!(matches!(error, Error::TermShape { found, .. } if found == [1, 1]));
}

#[test]
fn densities_without_a_derivative_in_the_phases_are_refused() {
    let length = |u: &Tensor<2>, on: &Domain<2>| {
        let squares = on.gradient(u).map(|slope| slope.clone() * slope);
        squares.into_iter().reduce(|a, b| a + b).unwrap().sqrt()
    };
    let logarithm = |u: &Tensor<2>, _: &Domain<2>| (u.clone() + 1.0).log();
    let densities: [fn(&Tensor<2>, &Domain<2>) -> Tensor<2>; 2] = [length, logarithm];
    for density in densities {
        let error = refusal(density);
        assert!(matches!(error, Error::TermDerivative { .. }), "{error}");
    }
}

/// The factor of the density is constant across the interface.
#[test]
fn areas_with_a_factor_do_not_depend_on_what_is_stored_and_bend_no_profile() {
    let tilted: fn(&Tensor<2>, &Domain<2>) -> Tensor<2> =
        |u, on| on.area(u) * ((on.coordinate(1) * 2.0).sin() + 1.0) * 40.0;
    let start = cross();
    let (params, tau) = (exact(start.grid()), params(start.grid()).mcf_step / 4.0);
    let mut flows = (dense(&start, params), bricks(&start, params));
    for flow in [&mut flows.0, &mut flows.1] {
        flow.set_energy(vec![Arc::new(Of(tilted))], 1.0).unwrap();
    }
    let (apart, energies) = difference_of((&mut flows.0, &mut flows.1), &[tau; 2]);
    assert!(apart < 1e-5 && energies < 1e-5, "{apart:e} {energies:e}");
}

#[test]
fn terms_are_checked_by_taylor_tests() {
    let mut flow = bricks(&cross(), usual(cross().grid()));
    flow.set_energy(everything(), 1.0).unwrap();
    let checks = flow.problem.check_derivatives(&flow.state.field).unwrap();
    let names: Vec<&str> = checks.iter().map(|check| &*check.name).collect();
    assert_eq!(
        names,
        ["gravity", "anisotropic tension", "everything", "tension"]
    );
    for check in &checks {
        assert!(check.is_consistent(), "{check:?}");
        assert!(check.energy.is_some());
    }
    assert!((checks[0].gradient.rate().unwrap() - 2.0).abs() < 0.1);
    assert!((checks[0].hessian.rate().unwrap() - 3.0).abs() < 0.1);
}
