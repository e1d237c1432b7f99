//! Timing: contenders take turns, so that whatever else the machine does burdens them alike.

use engine::{Case, Error as EngineError, Flow, Operator, Run};
use geometry::shapes::Ball;
use geometry::{Grid, phase_field};
use indicatif::ProgressBar;
use operators::ComputeDevice;
use solver::{Error as SolverError, StepRecord};

use crate::comparison::cross;
use crate::networks::{EPS, STEP};
use crate::{Error, study};

/// Round after round, everyone who goes on has a turn.
///
/// # Errors
/// That of a turn.
pub fn take_turns<C>(
    contenders: &mut [C],
    goes_on: impl Fn(&C) -> bool,
    mut turn: impl FnMut(&mut C) -> Result<(), Error>,
) -> Result<(), Error> {
    loop {
        let round: Vec<&mut C> = contenders.iter_mut().filter(|c| goes_on(c)).collect();
        if round.is_empty() {
            return Ok(());
        }
        round.into_iter().try_for_each(&mut turn)?;
    }
}

/// The middle value; 0 for none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// What is timed in the plane: the cross in steps of `2^-14`, or for a smoke test a disc on a small box.
///
/// # Errors
/// [`Error::Geometry`] for a resolution that cannot be.
pub fn plane(operator: &Operator, n: usize, steps: usize, quick: bool) -> Result<Case<2>, Error> {
    let (shape, initial) = if quick {
        let disc = Ball::new([0.0, 0.0], 0.2)?;
        ("disc", phase_field(Grid::per_unit(n, 0.75)?, &disc, EPS)?)
    } else {
        ("cross", cross(Grid::per_unit(n, 2.0)?)?)
    };
    let flow = (Flow::Willmore, operator);
    Ok(study::case(flow, shape, initial, (STEP, steps)))
}

/// Willmore flow that is timed step by step.
pub struct Timed<const D: usize> {
    /// The flow.
    pub run: Run<D>,
    /// Why it ended early, if a minimization did not converge.
    pub failure: Option<String>,
    bar: ProgressBar,
}

impl<const D: usize> Timed<D> {
    /// A case at its start, and the bar that shows its steps.
    ///
    /// # Errors
    /// [`Error::Engine`] for a case that cannot be.
    pub fn new(case: Case<D>, device: &ComputeDevice, bar: ProgressBar) -> Result<Self, Error> {
        Ok(Self {
            run: Run::new(case, device)?,
            failure: None,
            bar,
        })
    }

    /// One step.
    ///
    /// # Errors
    /// [`Error::Engine`], but for a minimization that does not converge.
    pub fn step(&mut self) -> Result<(), Error> {
        self.bar.inc(1);
        match self.run.step() {
            Ok(_) => Ok(()),
            Err(EngineError::Step { source, .. })
                if matches!(*source, SolverError::NotConverged { .. }) =>
            {
                self.failure = Some(source.to_string());
                Ok(())
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Whether there is a next step.
    pub fn goes_on(&self) -> bool {
        self.failure.is_none() && self.run.ended().is_none()
    }

    /// What the steps did.
    pub fn minimizations(&self) -> impl Iterator<Item = &StepRecord> {
        let records = self.run.records().iter();
        records.filter_map(|record| record.minimization.as_ref())
    }

    /// Wall times of the steps in seconds.
    pub fn seconds(&self) -> Vec<f64> {
        self.minimizations().map(|made| made.seconds).collect()
    }

    /// Mean over the steps; 0 without any.
    pub fn mean(&self, of: impl Fn(&StepRecord) -> f64) -> f64 {
        study::mean(self.minimizations(), of).unwrap_or(0.0)
    }
}
