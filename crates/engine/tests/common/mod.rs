//! Small cases.

use engine::{
    Case, Discretization, Flow, Formulation, Measure, Method, Operator, Run, Scales, StepRule,
    TimeSteps,
};
use geometry::shapes::{Ball, Cuboid};
use geometry::{Field, Grid, phase_field};
use model::Networks;
use operators::ComputeDevice;
use runs::Interrupt;

/// Interface width of the paper's curves.
pub const EPS: f64 = 1.0 / 64.0;
/// Their time step.
pub const TAU: f64 = 1.0 / 16384.0;

pub fn device() -> ComputeDevice {
    ComputeDevice::default_compiled().unwrap()
}

pub fn scales() -> Scales {
    Scales {
        eps: EPS,
        mcf_step: TAU,
        newton: solver::NewtonParams::default(),
    }
}

pub fn grid(n: usize) -> Grid<2> {
    Grid::per_unit(n, 0.75).unwrap()
}

pub fn disc(n: usize, radius: f64) -> Field<2> {
    phase_field(grid(n), &Ball::new([0.0; 2], radius).unwrap(), EPS).unwrap()
}

pub fn square(n: usize) -> Field<2> {
    phase_field(grid(n), &Cuboid::new([0.2; 2]).unwrap(), EPS).unwrap()
}

/// A flow of this phase field by a method in the paper's formulation.
pub fn case(flow: Flow, method: Method, initial: Field<2>) -> Case<2> {
    let grid = *initial.grid();
    let needed = scales().needs(2, grid.spacing());
    let operator = Operator::new(
        Discretization::new(method, Formulation::Paper),
        &Networks::default(),
        &needed,
        &grid,
        &scales(),
    );
    let mut measures = Measure::size(EPS);
    measures.extend(Measure::crossings(0.0));
    let steps = StepRule::Constant(TAU);
    Case {
        flow,
        measures,
        ..Case::willmore("shape", initial, operator.unwrap(), scales(), steps, 4)
    }
}

/// Steps made in substeps, the first one at most of this size.
pub fn divided(tau: f64, first: f64) -> TimeSteps {
    TimeSteps {
        first_substep: Some(first),
        ..StepRule::Constant(tau).into()
    }
}

/// A case at its end.
pub fn finished(case: Case<2>) -> Run<2> {
    let mut run = Run::new(case, &device()).unwrap();
    run.advance(None, &mut [], &Interrupt::never()).unwrap();
    run
}
