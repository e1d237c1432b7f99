//! Where in its time steps a flow is.

use geometry::measure::has_interface;
use geometry::positive;
use solver::{Candidate, Error as StepError, State, StepRecord, StepSize, widths_between};

use crate::error_control::ControlledSteps;
use crate::substeps::{EASY, HARD, Substeps};
use crate::time_steps::{largest_step, least_energy};
use crate::{
    Attempts, Case, Controller, Error, ErrorControl, Order, Record, StepRule, Stop, TimeSteps,
    Verdict,
};

/// Steps by the energy grow while they take away less than this fraction of it,
const LITTLE: f64 = 0.1;
/// and shrink when they take away more than this.
const MUCH: f64 = 0.3;
/// How often a step by the energy is halved before the run gives up.
const HALVINGS: u32 = 24;
/// How often a step is halved that moves the interface too far, or cannot hold what it is to hold.
const HALVINGS_OF_MOTION: u32 = 12;
/// A step that moves the interface this part of what it may is not followed by one of twice its size, which would be refused.
const FAR: f64 = 0.6;

/// Steps by a [rule](StepRule) or by their [error](ErrorControl), as long as the interface [may move](TimeSteps::longest_move).
#[derive(Clone, Debug)]
pub struct StepControl {
    steps: TimeSteps,
    /// The time at which the flow ends, if any.
    end: f64,
    /// The largest size of steps by the energy, in which changes of energies below the least one are measured by that.
    largest: f64,
    least_energy: f64,
    /// Steps completed, and the time reached.
    completed: usize,
    time: f64,
    /// Size of the present step by the rule, and as far as it does not go beyond the end.
    wanted: f64,
    size: f64,
    /// Substeps of the present step.
    substeps: Option<Substeps>,
    /// The size of controlled steps, and the time at which the present step is complete.
    controlled: Option<ControlledSteps>,
    due: f64,
    /// Whether perimeter or volume are held.
    holds: bool,
    /// The attempts of the present step, after the first.
    attempt: Option<Attempt>,
    /// The last step.
    last: Option<Last>,
}

/// An attempt that is shorter than those before it.
#[derive(Clone, Copy, Debug)]
struct Attempt {
    size: f64,
    halvings: u32,
    /// Of these attempts, those whose minimization failed in a step that holds sizes.
    failures: u32,
    refused_hvp: f64,
}

/// What the last step says about the size of the next one.
#[derive(Clone, Copy, Debug)]
struct Last {
    tau: f64,
    halvings: u32,
    far: bool,
}

impl StepControl {
    /// The steps of a case.
    ///
    /// # Errors
    /// [`Error::Geometry`] for sizes and limits that are not positive, or do not fit together.
    pub fn new<const D: usize>(case: &Case<D>) -> Result<Self, Error> {
        let (steps, largest) = (case.steps, largest_step(case.grid()));
        let rule = steps.rule.resolved(case.scales.mcf_step);
        let control = match steps.order {
            Order::Controlled(control) => Some(control),
            _ => (rule == StepRule::Controlled).then(ErrorControl::default),
        };
        let eps = case.scales.eps;
        let controlled = control.map(|control| ControlledSteps::new(control, eps, largest));
        let mut control = Self {
            steps: TimeSteps { rule, ..steps },
            end: Stop::end(&case.stops).unwrap_or(f64::INFINITY),
            largest,
            least_energy: least_energy(case.grid()),
            completed: 0,
            time: 0.0,
            wanted: rule.size(1),
            size: f64::NAN,
            substeps: None,
            controlled: controlled.transpose()?,
            due: f64::INFINITY,
            holds: !case.held.is_empty(),
            attempt: None,
            last: None,
        };
        control.begin(steps.first_substep.unwrap_or(f64::INFINITY))?;
        Ok(control)
    }

    /// Begins a step whose substeps, if there are any, are at first at most of this size.
    fn begin(&mut self, substep: f64) -> Result<(), Error> {
        self.size = self.wanted.min(self.end - self.time);
        self.due = self.time + self.size;
        // At the end nothing is left to make.
        let substeps = self.controlled.is_none() && self.size > 0.0;
        if let Some(very_first) = self.steps.first_substep.filter(|_| substeps) {
            let first = substep.min(self.size);
            let least = first.min(positive("first substep", very_first)?);
            self.substeps = Some(Substeps::new(self.size, first, least)?);
        }
        Ok(())
    }

    /// The size of the present step by the rule.
    fn step_size(&self) -> f64 {
        if self.wanted.is_finite() {
            self.wanted
        } else {
            self.next_size()
        }
    }

    fn next_size(&self) -> f64 {
        match (self.controlled, self.substeps) {
            (Some(controlled), _) => controlled.size(self.due - self.time),
            (None, Some(substeps)) => substeps.size(),
            (None, None) => self.size,
        }
    }

    /// The size with which a controlled step is made again, if it was too long.
    fn shorter(&self, record: &StepRecord) -> Option<f64> {
        self.controlled?.shorter(record)
    }

    /// How often that size may be halved where a minimization fails.
    fn halvings(&self) -> u32 {
        let adapts = matches!(self.steps.rule, StepRule::ByEnergy(_)) || self.controlled.is_some();
        let of_steps = if adapts { HALVINGS } else { 0 };
        (self.substeps).map_or(of_steps, |substeps| substeps.halvings())
    }

    /// How often a step may be halved that moves the interface too far, or cannot hold what it is to hold. Substeps have a smallest size, of which
    /// places in the step are multiples.
    fn halvings_of_motion(&self) -> u32 {
        self.substeps
            .map_or(HALVINGS_OF_MOTION, |substeps| substeps.halvings())
    }

    /// The attempt that is made next: what was too long for the last step is not tried again at once.
    fn attempt(&self) -> Attempt {
        if let Some(attempt) = self.attempt {
            return attempt;
        }
        let (mut size, mut halvings) = (self.next_size(), 0);
        let is_limited = self.steps.longest_move.is_some();
        if let Some(last) = self.last.filter(|last| is_limited && last.halvings > 0) {
            let longer = if last.far { 1.5 } else { 2.0 };
            while size > longer * last.tau && halvings < self.halvings_of_motion() {
                size *= 0.5;
                halvings += 1;
            }
        }
        Attempt {
            size,
            halvings,
            failures: 0,
            refused_hvp: 0.0,
        }
    }

    /// How often a step may be made shorter, whatever is wrong with it.
    fn most_halvings(&self) -> u32 {
        if self.holds {
            self.halvings().max(self.halvings_of_motion())
        } else {
            self.halvings()
        }
    }

    /// A candidate is taken unless a shorter step would help: its error is too large, or the interface has gone too far.
    fn judge_candidate<const D: usize>(
        &mut self,
        attempt: Attempt,
        from: &State<D>,
        candidate: &Candidate<D>,
    ) -> Result<Verdict, StepError> {
        let record = candidate.record.as_ref();
        let refused = record.map_or(0.0, StepRecord::hvp);
        let shorter = record.and_then(|record| self.shorter(record));
        if let Some(size) = shorter.filter(|_| attempt.halvings < self.most_halvings()) {
            return Ok(self.try_again(attempt, size, refused));
        }
        // How far it has gone over how far it may go.
        let part = match self.steps.longest_move {
            Some(longest) => has_gone(from, &candidate.state)? / longest,
            None => 0.0,
        };
        if part > 1.0 && attempt.halvings < self.halvings_of_motion() {
            return Ok(self.try_again(attempt, 0.5 * attempt.size, refused));
        }
        Ok(Verdict::Accept(Attempts {
            halvings: attempt.halvings,
            far: part > FAR,
            refused_hvp: attempt.refused_hvp,
        }))
    }

    fn judge_failure(&mut self, attempt: Attempt, error: &StepError) -> Verdict {
        let most = self.most_halvings();
        if most == 0 || !error.shorter_step_may_succeed() {
            return Verdict::GiveUp { halvings: 0 };
        }
        if attempt.halvings >= most {
            let halvings = attempt.halvings;
            return Verdict::GiveUp { halvings };
        }
        // What fails again and again is far too long.
        let more = if self.holds && self.substeps.is_none() {
            (attempt.failures).min(most - attempt.halvings - 1)
        } else {
            0
        };
        let size = attempt.size * 0.5_f64.powi(1 + more as i32);
        let failures = attempt.failures + 1;
        let verdict = self.try_again(attempt, size, 0.0);
        if let Some(next) = &mut self.attempt {
            (next.halvings, next.failures) = (next.halvings + more, failures);
        }
        verdict
    }

    /// Another attempt of this size, after one that took so many Hessian-vector products.
    fn try_again(&mut self, attempt: Attempt, size: f64, hvp: f64) -> Verdict {
        self.attempt = Some(Attempt {
            size,
            halvings: attempt.halvings + 1,
            failures: attempt.failures,
            refused_hvp: attempt.refused_hvp + hvp,
        });
        Verdict::Retry
    }

    /// Moves on by a step; true if it completes the present time step.
    fn move_on(&mut self, record: &Record) -> Result<bool, Error> {
        self.attempt = None;
        self.last = Some(Last {
            tau: record.tau,
            halvings: record.halvings,
            far: record.far,
        });
        self.time = record.time;
        let mut substep = f64::INFINITY;
        if let Some(controlled) = &mut self.controlled {
            controlled.accept(record);
            if self.wanted.is_finite() && self.due - self.time > 1e-12 * self.due {
                return Ok(false);
            }
        }
        if let Some(substeps) = &mut self.substeps {
            substeps.made(record);
            if !substeps.is_complete() {
                return Ok(false);
            }
            substep = substeps.size();
        }
        let before = self.wanted;
        self.completed += 1;
        self.wanted = match self.steps.rule {
            // A step that was cut short by the end says nothing about the next one.
            StepRule::ByEnergy(_) if self.size < before && record.halvings == 0 => before,
            StepRule::ByEnergy(_) => after(record, self.least_energy).min(self.largest),
            StepRule::Graded { first, part } => first.max(part * self.time),
            rule => rule.size(self.completed + 1),
        };
        // Steps that double begin with twice the size, too.
        self.begin(self.wanted / before * substep)?;
        Ok(true)
    }
}

impl<const D: usize> Controller<D> for StepControl {
    fn next(&self) -> StepSize {
        StepSize {
            tau: self.attempt().size,
            whole: self.step_size(),
        }
    }

    fn judge(
        &mut self,
        from: &State<D>,
        attempted: Result<&Candidate<D>, &StepError>,
    ) -> Result<Verdict, StepError> {
        let attempt = self.attempt();
        match attempted {
            Ok(candidate) => self.judge_candidate(attempt, from, candidate),
            Err(error) => Ok(self.judge_failure(attempt, error)),
        }
    }

    fn accept(&mut self, record: &Record) -> Result<bool, Error> {
        self.move_on(record)
    }

    fn identity(&self) -> serde_json::Value {
        serde_json::json!(self.steps)
    }

    fn needs_estimates(&self) -> bool {
        self.controlled.is_some()
    }
}

/// How many of its widths the interface has moved in a step, also to where there was none ([`widths_between`]); infinitely many if it is away
/// altogether.
fn has_gone<const D: usize>(from: &State<D>, to: &State<D>) -> Result<f64, StepError> {
    let now = to.stored()?;
    if !has_interface(&now) {
        return Ok(f64::INFINITY);
    }
    let before = from.field.stored()?;
    Ok(widths_between(&before, &now).max(widths_between(&now, &before)))
}

/// The size by the energy after a step.
fn after(record: &Record, least_energy: f64) -> f64 {
    let Some(made) = &record.minimization else {
        return record.tau;
    };
    let drop = made.relative_drop(least_energy);
    let newton = made.newton.newton;
    let factor = if drop > MUCH || newton > HARD {
        0.5
    } else if drop < LITTLE && newton <= EASY {
        2.0
    } else {
        1.0
    };
    factor * record.tau
}
