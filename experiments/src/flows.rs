//! The cases of the experiments.

use model::Networks;

use crate::networks::scales;
use crate::prelude::*;

/// The learned operator in the paper's scheme,
pub const PAPERS: (Method, Scheme) = (Method::Hybrid, Scheme::Paper);
/// and in that of the least errors.
pub const ACCURATE: (Method, Scheme) = (Method::Hybrid, Scheme::Accurate);
/// The finite elements of the paper's references.
pub const ELEMENTS: (Method, Scheme) = (Method::FeImplicit, Scheme::Paper);

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
        ..Case::willmore(shape, initial, operator.clone(), scales, time)
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
