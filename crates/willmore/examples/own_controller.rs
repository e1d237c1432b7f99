//! A controller of one's own: steps are twice as long after an easy minimization, and half as long after a hard one or a failure.

use willmore::prelude::*;

/// Sizes by the Newton iterations of the last step. It depends on the records alone, so that a run that is resumed goes on as before.
pub struct ByNewton {
    tau: f64,
}

impl ByNewton {
    /// The first step has this size.
    pub fn from(tau: f64) -> Self {
        Self { tau }
    }
}

impl<const D: usize> Controller<D> for ByNewton {
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
            Err(error) if error.shorter_step_may_succeed() => {
                self.tau *= 0.5;
                Verdict::Retry
            }
            Err(_) => Verdict::GiveUp { halvings: 0 },
        })
    }

    fn accept(&mut self, record: &Record) -> Result<bool, willmore::Error> {
        let newton = record.minimization.map_or(0, |step| step.newton.newton);
        self.tau = match newton {
            0..=4 => 2.0 * record.tau,
            5..=8 => record.tau,
            _ => 0.5 * record.tau,
        };
        Ok(true)
    }

    fn identity(&self) -> serde_json::Value {
        json!("sizes by Newton iterations")
    }
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the flow.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid::<2>::per_unit(64, 1.25)?;
    let first = 0.25 * grid.spacing().powi(4);
    let mut flow = Willmore::on(grid)
        .steps(StepRule::Constant(first))
        .controller(move |_| Ok(ByNewton::from(first)))
        .start(&Cross::new(0.3, 0.12)?)?;
    for record in flow.take(8) {
        let record = record?;
        let newton = record.minimization.map_or(0, |step| step.newton.newton);
        println!("tau = {:.2e}: {newton} Newton steps", record.tau);
    }
    assert!(flow.time() > 8.0 * first);
    Ok(())
}
