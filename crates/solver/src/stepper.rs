//! Steps by hand.

use geometry::Field;

use crate::{Error, Euler, Problem, Scheme, State, StepRecord, StepSize};

/// A problem, a state and a scheme, stepped by hand: nothing controls the steps, and nothing measures or keeps what they make.
pub struct Stepper<const D: usize, S = Euler<D>> {
    /// What the flow is of.
    pub problem: Problem<D>,
    /// Where it is.
    pub state: State<D>,
    scheme: S,
}

impl<const D: usize> Stepper<D> {
    /// A flow by implicit Euler steps.
    pub fn new(problem: Problem<D>, start: State<D>) -> Self {
        Self::by(Euler::new(), problem, start)
    }
}

impl<const D: usize, S: Scheme<D>> Stepper<D, S> {
    /// A flow by the steps of a scheme.
    pub fn by(scheme: S, problem: Problem<D>, start: State<D>) -> Self {
        Self {
            problem,
            state: start,
            scheme,
        }
    }

    /// One step of size `tau`; its record is empty for a scheme that minimizes nothing.
    ///
    /// # Errors
    /// Those of the [scheme](Scheme::step); the flow stays where it was.
    pub fn step(&mut self, tau: f64) -> Result<StepRecord, Error> {
        let size = StepSize::whole(tau);
        let candidate = self.scheme.step(&self.problem, &self.state, size)?;
        self.state = candidate.state;
        Ok(candidate.record.unwrap_or_default())
    }

    /// The phase field now.
    ///
    /// # Errors
    /// As [`State::stored`].
    pub fn field(&self) -> Result<Field<D>, Error> {
        self.state.on_grid()
    }
}
