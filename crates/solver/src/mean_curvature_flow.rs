//! Mean curvature flow by the step inside.

use crate::region::Region;
use crate::{Candidate, Error, Memory, Problem, Scheme, State, StepSize};

/// Mean curvature flow, `u <- v[u]`: every step has the size of the step inside, and the whole grid is stored.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeanCurvatureFlow;

impl<const D: usize> Scheme<D> for MeanCurvatureFlow {
    /// # Errors
    /// [`Error::Step`] if the step's own solver fails, [`Error::NeedsGrid`] on bricks. A value that is not finite is reported by the
    /// [state](State::stored).
    fn step(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        size: StepSize,
    ) -> Result<Candidate<D>, Error> {
        if from.field.nodes().bricks().is_some() {
            let what = "mean curvature flows";
            return Err(Error::NeedsGrid { what });
        }
        let (u, operator) = (from.field.values(), &problem.operator);
        let next = operator.apply(u.clone());
        if let Some(failure) = operator.failure() {
            return Err(Error::Step(failure));
        }
        let next = match &problem.region {
            Some(nodes) => {
                let region = Region::new(from.field.nodes(), nodes, &problem.device);
                Region::hold(Some(&region), next, u)
            }
            None => next,
        };
        let step = from.step + 1;
        Ok(Candidate {
            state: State {
                field: from.field.with(next),
                step,
                time: step as f64 * problem.params.mcf_step,
                progress: from.progress + size.part(),
                memory: Memory::default(),
            },
            tau: problem.params.mcf_step,
            record: None,
        })
    }

    fn name(&self) -> &'static str {
        "mean_curvature"
    }
}
