//! Where in its time steps a flow is.

use geometry::positive;
use solver::StepRecord;

use crate::control::Controller;
use crate::steps::{largest_step, least_energy};
use crate::substeps::{EASY, HARD, Substeps};
use crate::{Case, Error, ErrorControl, Order, Record, StepRule, Stop, TimeSteps};

/// Steps by the energy grow while they take away less than this fraction of it,
const LITTLE: f64 = 0.1;
/// and shrink when they take away more than this.
const MUCH: f64 = 0.3;
/// How often a step by the energy is halved before the run gives up.
const HALVINGS: u32 = 24;
/// How often a step is halved that moves the interface too far, or cannot hold what it is to hold.
const HALVINGS_OF_MOTION: u32 = 12;

/// Where in its time steps a flow is, and what size comes next. It depends on nothing but the records so far, so that
/// [accepting](Self::accept) them again restores it.
#[derive(Clone, Debug)]
pub(crate) struct StepControl {
    steps: TimeSteps,
    /// The time at which the flow ends, if any.
    end: f64,
    /// The largest size of steps by the energy, in which changes of energies below the least one are measured by that.
    largest: f64,
    least_energy: f64,
    /// Steps completed, and the time reached.
    completed: usize,
    time: f64,
    /// Steps made, parts of them included, with which the targets of what is held move.
    pub(crate) steps_gone: f64,
    /// Size by the rule of the step to which the last record belongs; not a number before that.
    pub(crate) last_size: f64,
    /// Size of the present step by the rule, and as far as it does not go beyond the end.
    wanted: f64,
    size: f64,
    /// Substeps of the present step.
    substeps: Option<Substeps>,
    /// The size of controlled steps, and the time at which the present step is complete.
    controller: Option<Controller>,
    due: f64,
}

impl StepControl {
    pub(crate) fn new<const D: usize>(case: &Case<D>) -> Result<Self, Error> {
        let (steps, largest) = (case.steps, largest_step(case.grid()));
        let rule = steps.rule.resolved(case.scales.mcf_step);
        let control = match steps.order {
            Order::Controlled(control) => Some(control),
            _ => (rule == StepRule::Controlled).then(ErrorControl::default),
        };
        let controller = control.map(|control| Controller::new(control, case.scales.eps, largest));
        let mut control = Self {
            steps: TimeSteps { rule, ..steps },
            end: Stop::end(&case.stops).unwrap_or(f64::INFINITY),
            largest,
            least_energy: least_energy(case.grid()),
            completed: 0,
            time: 0.0,
            steps_gone: 0.0,
            last_size: f64::NAN,
            wanted: rule.size(1),
            size: f64::NAN,
            substeps: None,
            controller: controller.transpose()?,
            due: f64::INFINITY,
        };
        control.begin(steps.first_substep.unwrap_or(f64::INFINITY))?;
        Ok(control)
    }

    /// Begins a step whose substeps, if there are any, are at first at most of this size.
    fn begin(&mut self, substep: f64) -> Result<(), Error> {
        self.size = self.wanted.min(self.end - self.time);
        self.due = self.time + self.size;
        // At the end nothing is left to make.
        let substeps = self.controller.is_none() && self.size > 0.0;
        if let Some(very_first) = self.steps.first_substep.filter(|_| substeps) {
            let first = substep.min(self.size);
            let least = first.min(positive("first substep", very_first)?);
            self.substeps = Some(Substeps::new(self.size, first, least)?);
        }
        Ok(())
    }

    /// The size of the present step by the rule.
    pub(crate) fn step_size(&self) -> f64 {
        if self.wanted.is_finite() {
            self.wanted
        } else {
            self.next_size()
        }
    }

    pub(crate) fn next_size(&self) -> f64 {
        match (self.controller, self.substeps) {
            (Some(controller), _) => controller.size(self.due - self.time),
            (None, Some(substeps)) => substeps.size(),
            (None, None) => self.size,
        }
    }

    /// The size with which a controlled step is made again, if it was too long.
    pub(crate) fn shorter(&self, made: &StepRecord) -> Option<f64> {
        self.controller?.shorter(made)
    }

    /// How often that size may be halved where a minimization fails.
    pub(crate) fn halvings(&self) -> u32 {
        let adapts = matches!(self.steps.rule, StepRule::ByEnergy(_)) || self.controller.is_some();
        let of_steps = if adapts { HALVINGS } else { 0 };
        (self.substeps).map_or(of_steps, |substeps| substeps.halvings())
    }

    /// How often a step may be halved that moves the interface too far, or cannot hold what it is to hold. Substeps have a smallest size, of which
    /// places in the step are multiples.
    pub(crate) fn halvings_of_motion(&self) -> u32 {
        self.substeps
            .map_or(HALVINGS_OF_MOTION, |substeps| substeps.halvings())
    }

    pub(crate) fn step(&self) -> usize {
        self.completed + 1
    }

    /// Moves on by a minimization; true if it completes the present step.
    pub(crate) fn accept(&mut self, record: &Record) -> Result<bool, Error> {
        self.last_size = self.step_size();
        self.steps_gone += record.tau / self.last_size;
        self.time = record.time;
        let mut substep = f64::INFINITY;
        if let Some(controller) = &mut self.controller {
            controller.accept(record);
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
            rule => rule.size(self.step()),
        };
        // Steps that double begin with twice the size, too.
        self.begin(self.wanted / before * substep)?;
        Ok(true)
    }
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
