//! Implicit Euler steps: the scheme of the paper.

use std::time::Instant;

use crate::movement::{Minimizations, Movement};
use crate::record::At;
use crate::start::{self, PREVIOUS, PREVIOUS_TAU};
use crate::{Candidate, Error, Memory, Problem, Scheme, State, StepSize};

/// Implicit Euler: a step is one minimizing movement from the phase field itself. It begins where the half grid says, if the problem
/// [has one](Problem::begin_on), or where the last motion leads.
#[derive(Default)]
pub struct Euler<const D: usize> {
    minimizations: Minimizations<D>,
    /// The same on the half grid, where steps may begin.
    pub(crate) half: Option<Box<Euler<D>>>,
}

impl<const D: usize> Euler<D> {
    /// The scheme, before it has prepared anything.
    pub fn new() -> Self {
        Self {
            minimizations: Minimizations::default(),
            half: None,
        }
    }

    /// A step that ends with these sizes held.
    pub(crate) fn step_to(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        movement: StepTo,
    ) -> Result<Candidate<D>, Error> {
        let clock = Instant::now();
        let StepTo { size, targets } = movement;
        let from = problem.followed(from)?;
        let start = start::of(self, problem, &from, movement)?;
        let beginning = clock.elapsed().as_secs_f64();
        let minimum = self.minimizations.minimize(
            problem,
            &from,
            Movement {
                anchor: from.field.clone(),
                factors: None,
                start: start.field,
                tau: size.tau,
                targets,
            },
        )?;
        let scale = problem.energy_scale();
        let at = At { from: &from, size };
        let mut record = minimum.record(&at, start.origin, clock);
        record.energy_before = scale * minimum.newton.energy_before;
        record.energy = scale * minimum.newton.energy;
        record.times.start = beginning;
        let mut memory = Memory {
            fields: start.half_motions,
            ..Memory::default()
        };
        memory
            .fields
            .insert(PREVIOUS.to_owned(), from.field.clone());
        memory.numbers.insert(PREVIOUS_TAU.to_owned(), size.tau);
        let state = from.after(size, minimum.u, memory);
        Ok(Candidate {
            state,
            tau: size.tau,
            record: Some(record),
        })
    }
}

/// The size of a step, and the sizes that are held at its end.
#[derive(Clone, Copy)]
pub(crate) struct StepTo {
    pub(crate) size: StepSize,
    pub(crate) targets: crate::Constraints,
}

impl<const D: usize> Scheme<D> for Euler<D> {
    fn step(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        size: StepSize,
    ) -> Result<Candidate<D>, Error> {
        let targets = problem.held.at(from.progress + size.part());
        self.step_to(problem, from, StepTo { size, targets })
    }

    fn name(&self) -> &'static str {
        "euler"
    }
}
