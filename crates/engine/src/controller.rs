//! What chooses the size of steps, and takes them or not.

use geometry::positive;
use solver::{Candidate, Error as StepError, State, StepSize};

use crate::{Error, Record};

/// What becomes of an attempt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The flow goes to the candidate.
    Accept(Attempts),
    /// The step is made again, with the [next](Controller::next) size.
    Retry,
    /// The run stops at the error of the attempt, after so many shorter ones.
    GiveUp {
        /// How often the step was made shorter.
        halvings: u32,
    },
}

/// The attempts of a step, as its [record](Record) tells them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attempts {
    /// How often the step was made shorter.
    pub halvings: u32,
    /// Whether the interface moved so far that twice the size would have been too long.
    pub far: bool,
    /// Hessian-vector products of the steps that were too long.
    pub refused_hvp: f64,
}

/// Chooses the size of every step, looks at what a [scheme](solver::Scheme) makes of it, and takes it or not.
///
/// A run that is resumed shows a new controller its records: what follows must depend on nothing else.
pub trait Controller<const D: usize>: Send {
    /// The size of the next attempt.
    fn next(&self) -> StepSize;

    /// Looks at an attempt from a state: a candidate, or the error in its place.
    ///
    /// # Errors
    /// If the candidate cannot be looked at, since the device fails.
    fn judge(
        &mut self,
        from: &State<D>,
        attempted: Result<&Candidate<D>, &StepError>,
    ) -> Result<Verdict, StepError>;

    /// Moves on by a step that was taken; true if it completes a time step.
    ///
    /// # Errors
    /// If there is no next size.
    fn accept(&mut self, record: &Record) -> Result<bool, Error>;

    /// Its name and parameters, which resuming compares.
    fn identity(&self) -> serde_json::Value;

    /// Whether it takes only steps of schemes with [estimates](solver::Scheme::estimates).
    fn needs_estimates(&self) -> bool {
        false
    }
}

/// Steps of one size, each of which is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EqualSteps {
    tau: f64,
}

impl EqualSteps {
    /// Steps of this size.
    ///
    /// # Errors
    /// [`Error::Geometry`] unless it is positive.
    pub fn of(tau: f64) -> Result<Self, Error> {
        let tau = positive("tau", tau)?;
        Ok(Self { tau })
    }
}

impl<const D: usize> Controller<D> for EqualSteps {
    fn next(&self) -> StepSize {
        StepSize::whole(self.tau)
    }

    fn judge(
        &mut self,
        _from: &State<D>,
        attempted: Result<&Candidate<D>, &StepError>,
    ) -> Result<Verdict, StepError> {
        Ok(match attempted {
            Ok(_) => Verdict::Accept(Attempts::default()),
            Err(_) => Verdict::GiveUp { halvings: 0 },
        })
    }

    fn accept(&mut self, _record: &Record) -> Result<bool, Error> {
        Ok(true)
    }

    fn identity(&self) -> serde_json::Value {
        serde_json::json!({ "equal_steps": self.tau })
    }
}
