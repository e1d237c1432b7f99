//! Observers, which are called after every step of a run.

use geometry::npy;
use indicatif::ProgressBar;
use runs::RunDirectory;

use crate::{Error, Run};

/// A run at its start, or after an accepted step.
pub struct Event<'a, const D: usize> {
    /// The run.
    pub run: &'a Run<D>,
    /// Where the run is stored, if it is.
    pub directory: Option<&'a mut RunDirectory>,
}

impl<const D: usize> Event<'_, D> {
    /// The number of the time step that is complete: 0 at the start, none in the middle of a step. The step in whose middle a run
    /// ends counts.
    pub fn step(&self) -> Option<usize> {
        match self.run.records().last() {
            None => Some(0),
            Some(last) => (last.completes_step || self.run.ended().is_some()).then_some(last.step),
        }
    }

    /// Writes the phase field to a file of the run; nothing where the run is not stored.
    pub fn write_field(&mut self, name: &str) -> Result<(), Error> {
        if let Some(directory) = &mut self.directory {
            npy::write(directory.path().join(name), &self.run.current())?;
            directory.adopt_file(name)?;
        }
        Ok(())
    }
}

/// An observer of a run: it is called at the start and after every accepted step. When a run is resumed, it is called for the steps
/// after the checkpoint only.
pub trait Observer<const D: usize> {
    /// Looks at the run.
    fn observe(&mut self, event: &mut Event<'_, D>) -> Result<(), Error>;
}

/// Shows the time steps that are complete.
impl<const D: usize> Observer<D> for ProgressBar {
    fn observe(&mut self, event: &mut Event<'_, D>) -> Result<(), Error> {
        if let Some(step) = event.step() {
            self.set_position(step as u64);
        }
        Ok(())
    }
}

/// Keeps phase fields of time steps as `step_00008.npy`, that of the last one always.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Samples {
    /// The phase field of every so many steps is kept; with 0 only the initial one.
    pub every: usize,
    /// Further steps whose phase fields are kept.
    pub also: Vec<usize>,
    /// Of the first step, made in substeps, the phase field after `tau / 2^k` is kept as `part_04.npy` for these `k`, if a substep ends
    /// there.
    pub halvings: Vec<u32>,
}

impl Samples {
    /// Keeps the phase field of every so many steps.
    pub fn every(steps: usize) -> Self {
        Self {
            every: steps,
            also: Vec::new(),
            halvings: Vec::new(),
        }
    }

    /// Whether the phase field after a step is kept, if it is not the last one.
    pub fn holds(&self, step: usize) -> bool {
        step.is_multiple_of(self.every) || self.also.contains(&step)
    }

    /// Name of the file of a step.
    pub fn name(step: usize) -> String {
        format!("step_{step:05}.npy")
    }

    /// Name of the file inside the first step.
    pub fn part_name(halvings: u32) -> String {
        format!("part_{halvings:02}.npy")
    }
}

impl<const D: usize> Observer<D> for Samples {
    fn observe(&mut self, event: &mut Event<'_, D>) -> Result<(), Error> {
        if let Some(last) = event.run.records().last().filter(|last| last.step == 1) {
            let tau = event.run.case().steps.rule.size(1);
            let ends = |k: &&u32| (tau * 0.5_f64.powi(**k as i32)).to_bits() == last.time.to_bits();
            if let Some(&halvings) = self.halvings.iter().find(ends) {
                event.write_field(&Self::part_name(halvings))?;
            }
        }
        match event.step() {
            Some(step) if self.holds(step) || event.run.ended().is_some() => {
                event.write_field(&Self::name(step))
            }
            _ => Ok(()),
        }
    }
}
