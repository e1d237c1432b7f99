//! The cases of the experiments.

use engine::Helfrich;
use model::Networks;

use crate::networks::scales;
use crate::prelude::*;

/// The learned operator in the paper's scheme,
pub const PAPERS: (Method, Scheme) = (Method::Hybrid, Scheme::Paper);
/// and in that of the least errors.
pub const ACCURATE: (Method, Scheme) = (Method::Hybrid, Scheme::Accurate);

/// Willmore flow everywhere; in the paper the steps are those of a rule, each made as a whole.
pub fn willmore_flow<const D: usize>(
    shape: &str,
    initial: Field<D>,
    operator: Operator,
    scales: Scales,
    (time_steps, count): (impl Into<TimeSteps>, usize),
) -> Case<D> {
    Case {
        shape: shape.to_owned(),
        initial,
        region: None,
        energy: Helfrich::default(),
        held: Held::default(),
        flow: Flow::Willmore,
        operator,
        scales,
        steps: time_steps.into(),
        stops: vec![Stop::Steps(count)],
        measures: Measure::size(scales.eps),
    }
}

/// A flow at the scales of the convergence tests in equal steps, with nothing measured; the inner step of mean curvature flow is its step.
pub fn planar_flow(
    (flow, operator): (Flow, &Operator),
    shape: &str,
    initial: Field<2>,
    (tau, steps): (f64, usize),
) -> Case<2> {
    let mut scales = scales();
    if flow == Flow::MeanCurvature {
        scales.mcf_step = tau;
    }
    let time = (StepRule::Constant(tau), steps);
    Case {
        flow,
        measures: Vec::new(),
        ..willmore_flow(shape, initial, operator.clone(), scales, time)
    }
}

/// The operator of a method in a scheme with the shipped network for the scales of a grid.
pub fn operator<const D: usize>(
    variant: (Method, Scheme),
    grid: &Grid<D>,
    scales: &Scales,
) -> Result<Operator, Error> {
    let (needed, networks) = (scales.needs(D, grid.spacing()), Networks::default());
    Ok(Operator::new(variant, &networks, &needed, grid, scales)?)
}
