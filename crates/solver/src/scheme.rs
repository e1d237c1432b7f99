//! What makes a step of a flow.

use serde::{Deserialize, Serialize};

use crate::{Error, Problem, State, StepRecord};

/// The size of a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepSize {
    /// The time that it takes.
    pub tau: f64,
    /// The size of the time step of which it is a part: the same, but for substeps and for steps that are made again shorter.
    pub whole: f64,
}

impl StepSize {
    /// A whole time step.
    pub fn whole(tau: f64) -> Self {
        Self { tau, whole: tau }
    }

    /// The part of a time step that it is, by which the targets of [held sizes](crate::Held) move.
    pub fn part(&self) -> f64 {
        self.tau / self.whole
    }
}

/// What a scheme makes of a state: the flow is not there before somebody takes it.
#[derive(Clone, Debug)]
pub struct Candidate<const D: usize> {
    /// The state after the step.
    pub state: State<D>,
    /// The size of the step: that which was asked for, but in flows whose steps have one size.
    pub tau: f64,
    /// What the minimizations did; none for a scheme that minimizes nothing.
    pub record: Option<StepRecord>,
}

/// A time step as a function: of a problem, a state and a size. What is traced or uploaded for a problem may be kept from one step to the next; what
/// a result depends on is in the state.
pub trait Scheme<const D: usize>: Send {
    /// One step.
    ///
    /// # Errors
    /// Those of the minimization. If a [shorter step may succeed](Error::shorter_step_may_succeed), one is tried, where sizes are adapted.
    fn step(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        size: StepSize,
    ) -> Result<Candidate<D>, Error>;

    /// Its name, which resuming compares.
    fn name(&self) -> &str;

    /// Whether its records have [estimates](crate::StepEstimates), by which the size of steps can be controlled.
    fn estimates(&self) -> bool {
        false
    }
}
