//! When a flow ends.

use std::f64::consts::PI;

use derive_more::Display;
use geometry::measure::{has_interface, touches_side};
use geometry::{PhaseField, Stored};
use serde::{Deserialize, Serialize};
use solver::StepRecord;

use crate::time_steps::{largest_step, least_energy};
use crate::{Current, DISPLACEMENT, Record};

/// A reason to end; a flow ends with the first that holds.
#[derive(Clone, Debug, PartialEq, Display, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// This many time steps are made.
    #[display("{}", made(*_0))]
    Steps(usize),
    /// This time is reached; the last step is cut short to end there, but for mean curvature flow, whose steps have one size.
    #[display("the time {:e} is reached", solver::rounded(*_0))]
    Time(f64),
    /// The Willmore energy, as the scheme measures it, is no more than this.
    #[display("the Willmore energy is at most {_0}")]
    Energy(f64),
    /// The Willmore energy, as the scheme measures it, is no more than this fraction of its initial value.
    #[display("the Willmore energy is at most {_0} times that of the start")]
    EnergyRatio(f64),
    /// The measure [`DISPLACEMENT`](crate::DISPLACEMENT) has this value or more.
    #[display("the surface has gone as far as it was to go")]
    Displacement(f64),
    /// The phase field moves by less than this fraction of the way that it has come (`L2`) per time step; a substep counts as much as
    /// it would if the whole step were like it.
    #[display("the shape is stationary")]
    Motion(f64),
    /// Three steps in a row, nearly as long as steps by the energy can be, lowered the energy by almost nothing. Longer ones would
    /// jump to other minimizers, such as an empty box.
    #[display("the energy is stationary")]
    EnergyAtRest,
    /// In space, the Willmore energy is less than half of that of a sphere, which no closed surface has: the phase field does not describe
    /// a surface any more. Says nothing with spontaneous curvature, tension or pressure, and of shapes that began at the side of the box, through
    /// which they may go on.
    #[display(
        "the Willmore energy is less than any closed surface has, 8 pi: the time steps were too long for the shape"
    )]
    NoSurface,
    /// One of the two phases has vanished.
    #[display("the shape has vanished")]
    Vanished,
    /// The shape has come within two interface widths of the side of the box, and so near to its own periodic image, and was not there
    /// in the beginning.
    #[display("the shape has come to the side of the box, near to its own periodic image")]
    AtTheSide,
    /// A [rule of one's own](StopRule), by its name.
    #[display("the rule {_0} holds")]
    Own(String),
}

/// A rule that ends a flow.
pub trait StopRule<const D: usize>: Send + Sync {
    /// Its name with its parameters: the run says it at its end, and resuming compares it.
    fn name(&self) -> String;

    /// Whether the flow ends here. It is asked at the start and after every step, and depends on nothing else, so that a run that is resumed ends where it
    /// would have ended.
    fn holds(&self, progress: &Progress<'_, D>) -> bool;

    /// Whether it says that nothing happens any more, which it cannot say while sizes are driven to their targets.
    fn is_rest(&self) -> bool {
        false
    }
}

/// A rule with a name that is a function: `StopWhen::new("late", |flow: &Progress<2>| flow.steps > 9)`.
///
/// The function depends on what it is shown alone, so that a run that is resumed ends where it would have ended.
#[derive(Clone, Debug)]
pub struct StopWhen<F> {
    name: String,
    holds: F,
}

impl<F> StopWhen<F> {
    /// The rule with this name, which includes its parameters, and this condition.
    pub fn new(name: impl Into<String>, holds: F) -> Self {
        let name = name.into();
        Self { name, holds }
    }
}

impl<const D: usize, F: Fn(&Progress<'_, D>) -> bool + Send + Sync> StopRule<D> for StopWhen<F> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn holds(&self, progress: &Progress<'_, D>) -> bool {
        (self.holds)(progress)
    }
}

/// What the rules look at: a flow at its start or after a step.
pub struct Progress<'a, const D: usize> {
    /// The records so far.
    pub records: &'a [Record],
    /// The initial phase field.
    pub initial: &'a Stored<D>,
    /// The phase field now.
    pub current: Current<'a, D>,
    /// Number of completed time steps.
    pub steps: usize,
    /// Whether the energy is the bending energy alone.
    pub is_willmore: bool,
}

/// A step that lowers the energy by less than this fraction counts as almost nothing.
const LITTLE: f64 = 1e-4;
/// Number of such steps in a row that end a run.
const IN_A_ROW: usize = 3;

impl Stop {
    /// The first time at which one of these rules ends a flow.
    pub(crate) fn end(stops: &[Self]) -> Option<f64> {
        let ends = stops.iter().filter_map(|stop| match stop {
            Self::Time(end) => Some(*end),
            _ => None,
        });
        ends.reduce(f64::min)
    }
}

impl<const D: usize> StopRule<D> for Stop {
    fn name(&self) -> String {
        self.to_string()
    }

    fn is_rest(&self) -> bool {
        matches!(self, Self::Motion(_) | Self::EnergyAtRest)
    }

    fn holds(&self, flow: &Progress<'_, D>) -> bool {
        let last = flow.records.last();
        let energy = last.and_then(Record::willmore_energy);
        match *self {
            // The rule of this name is asked itself.
            Self::Own(_) => false,
            Self::Steps(steps) => flow.steps >= steps,
            // What is left of a sum of steps after the last one is rounding.
            Self::Time(end) => last.is_some_and(|r| end - r.time <= 1e-12 * end),
            Self::Energy(target) => energy.is_some_and(|energy| energy <= target),
            Self::EnergyRatio(ratio) => {
                let first = flow.records.first().and_then(Record::energy_at_rest);
                (first.zip(energy)).is_some_and(|(first, energy)| energy <= ratio * first)
            }
            Self::Displacement(length) => {
                let gone = last.and_then(|record| record.measure(DISPLACEMENT));
                gone.is_some_and(|gone| gone >= length)
            }
            Self::Motion(limit) => {
                last.is_some_and(|r| r.moved * r.step_size / r.tau <= limit * r.travelled)
            }
            Self::EnergyAtRest => {
                let last = flow.records.last_chunk::<IN_A_ROW>();
                last.is_some_and(|records| records.iter().all(|record| flow.is_at_rest(record)))
            }
            Self::NoSurface => {
                let is_low = energy.is_some_and(|energy| energy < 4.0 * PI);
                D == 3 && flow.is_willmore && is_low && !is_near_side(flow.initial)
            }
            Self::Vanished => !has_interface(&flow.current),
            Self::AtTheSide => is_near_side(&flow.current) && !is_near_side(flow.initial),
        }
    }
}

impl<const D: usize> Progress<'_, D> {
    /// Whether a step that is nearly as long as steps by the energy can be changed the energy by almost nothing.
    fn is_at_rest(&self, record: &Record) -> bool {
        let grid = self.initial.grid();
        let change = |made: StepRecord| made.relative_drop(least_energy(grid)).abs();
        let is_long = record.tau >= 0.25 * largest_step(grid);
        let made = record.minimization;
        is_long && made.is_some_and(|made| change(made) < LITTLE)
    }
}

/// Whether the shape is within two interface widths of the side of the box.
fn is_near_side<const D: usize>(u: &impl PhaseField<D>) -> bool {
    // `tanh(3/2) = 0.905`.
    touches_side(u, -0.9)
}

fn made(steps: usize) -> String {
    match steps {
        1 => "one step is made".to_owned(),
        steps => format!("{steps} steps are made"),
    }
}
