//! Flows with what is measured of a step in place of what is known.

use std::sync::Arc;

use burn::tensor::Tensor;
use fem::FiniteElementStep;
use geometry::{Field, Grid, Nodes};
use mean_curvature::{Accuracy, Identity, MeanCurvatureStep, PhaseInverses, StepFailure, measured};
use model::MeanCurvatureOperator;
use operators::ComputeDevice;
use solver::FlowParams;

use crate::common::flow::Flow;
use crate::common::{accurate, ball, device, network, params};

/// A step of which nobody knows the inverse in the pure phases.
struct Unknown<S>(S);

impl<const D: usize, S: MeanCurvatureStep<D>> MeanCurvatureStep<D> for Unknown<S> {
    fn apply(&self, u: Tensor<D>) -> Tensor<D> {
        self.0.apply(u)
    }

    fn identity(&self) -> Identity {
        self.0.identity()
    }

    fn mass(&self, x: Tensor<D>) -> Tensor<D> {
        self.0.mass(x)
    }

    fn extensions(&self) -> linearize::Extensions {
        self.0.extensions()
    }

    fn allows_single_precision(&self) -> bool {
        self.0.allows_single_precision()
    }

    fn set_accuracy(&self, accuracy: &Accuracy) {
        self.0.set_accuracy(accuracy);
    }

    fn failure(&self) -> Option<StepFailure> {
        self.0.failure()
    }

    fn phase_values(&self) -> [f64; 2] {
        self.0.phase_values()
    }

    fn phase_inverses(
        &self,
        nodes: &Nodes<D>,
        device: &ComputeDevice,
    ) -> Result<PhaseInverses<D>, StepFailure> {
        Ok(measured::phase_inverses(&self.0, nodes, device)?)
    }
}

/// Hessian-vector products of three steps.
fn products<const D: usize>(
    step: impl MeanCurvatureStep<D> + 'static,
    start: &Field<D>,
    params: FlowParams,
) -> usize {
    let mut flow = Flow::new(step, start, params, &device()).unwrap();
    let tau = params.mcf_step;
    (0..3).map(|_| flow.advance(tau).unwrap().newton.hvp).sum()
}

#[test]
fn measured_inverses_cost_no_more_products() {
    fn check<const D: usize, S: MeanCurvatureStep<D> + Clone + 'static>(
        name: &str,
        step: S,
        grid: Grid<D>,
        radius: f64,
    ) {
        let (start, params) = (ball(grid, radius), params(&grid));
        let known = products(step.clone(), &start, params);
        let found = products(Unknown(step), &start, params);
        println!("{name}: {found} products, {known} with the known inverse");
        assert!(
            found as f64 <= 1.05 * known as f64,
            "{name}: {found} {known}"
        );
    }
    let plane = Grid::<2>::per_unit(128, 0.75).unwrap();
    for (name, network) in [("paper", network()), ("accurate", accurate(2))] {
        let operator = MeanCurvatureOperator::<2>::new(&network, &device()).unwrap();
        check(name, operator, plane, 0.19635);
    }
    let space = Grid::<3>::per_unit(32, 1.0).unwrap();
    let operator = MeanCurvatureOperator::<3>::new(&accurate(3), &device()).unwrap();
    check("accurate, 3D", operator, space, 0.3);
    let plane = Grid::<2>::per_unit(64, 0.75).unwrap();
    let (eps, step) = (2.0 * plane.spacing(), plane.spacing().powi(2));
    let implicit = FiniteElementStep::implicit(&plane, eps, step).unwrap();
    check("implicit elements", implicit, plane, 0.2);
    let semi = FiniteElementStep::semi_implicit(&plane, eps, step).unwrap();
    check("semi-implicit elements", semi, plane, 0.2);
}

/// The step of a flow that is asked for what coarser grids take answers as one that was never asked.
#[test]
fn coarser_steps_have_their_own_factors() {
    use model::{Ratios, Shipped};
    use solver::Factors;
    let fine = Ratios::of_run(2, 33, 1.0, 4.0, 4.0);
    for shipped in [Shipped::Paper, Shipped::Accurate] {
        let network = shipped.find(fine).unwrap();
        let factors = network.calibration().unwrap().factors;
        let operator = MeanCurvatureOperator::<2>::new(&network, &device()).unwrap();
        let coarse = shipped.find(Ratios::of_run(2, 17, 1.0, 2.0, 1.0)).unwrap();
        let coarser = operator.coarser(factors).unwrap().unwrap();
        assert_eq!(coarser.factors, coarse.calibration().unwrap().factors);
        // In the calibrated scheme networks of the paper's recipe are odd.
        let coarse = if shipped == Shipped::Paper {
            coarse.odd_part()
        } else {
            coarse
        };
        let expected: Arc<dyn MeanCurvatureStep<2>> =
            Arc::new(MeanCurvatureOperator::<2>::new(&coarse, &device()).unwrap());
        assert_eq!(coarser.step.identity(), expected.identity());
        assert!(coarser.step.coarser(factors).unwrap().is_none());
    }
    // The paper's energy takes the paper's networks, without factors.
    let network = Shipped::Accurate.find(fine).unwrap();
    let operator = MeanCurvatureOperator::<2>::new(&network, &device()).unwrap();
    let coarser = operator.coarser(Factors::PAPER).unwrap().unwrap();
    assert_eq!(coarser.factors, Factors::PAPER);
    let paper = Shipped::Paper
        .find(Ratios::of_run(2, 17, 1.0, 2.0, 1.0))
        .unwrap();
    let paper = MeanCurvatureOperator::<2>::new(&paper, &device()).unwrap();
    assert_eq!(
        coarser.step.identity(),
        MeanCurvatureStep::<2>::identity(&paper)
    );
}
