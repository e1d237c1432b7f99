//! A time scheme of one's own: two implicit Euler steps of half the size, whose difference to one whole step estimates the error.

use willmore::prelude::*;

/// Step doubling (Hairer, Norsett and Wanner, *Solving Ordinary Differential Equations I*, II.4).
#[derive(Default)]
pub struct StepDoubling<const D: usize> {
    whole: Euler<D>,
    half: Euler<D>,
}

impl<const D: usize> Scheme<D> for StepDoubling<D> {
    fn step(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        size: StepSize,
    ) -> Result<Candidate<D>, StepError> {
        let half = StepSize {
            tau: 0.5 * size.tau,
            whole: size.whole,
        };
        let whole = self.whole.step(problem, from, size)?;
        let middle = self.half.step(problem, from, half)?;
        let Candidate {
            mut state, record, ..
        } = self.half.step(problem, &middle.state, half)?;
        // The records of a run count the steps of the scheme.
        state.step = from.step + 1;

        let eps = problem.params.eps;
        let [before, once, twice] = [from, &whole.state, &state].map(State::stored);
        let (before, once, twice) = (before?, once?, twice?);
        let moved = eps * widths_between(&before, &twice);
        let estimates = StepEstimates {
            error: Some(eps * widths_between(&once, &twice)),
            motion: moved,
            displacement: moved,
        };
        let record = record.map(|last| StepRecord {
            step: state.step,
            tau: size.tau,
            energy_before: whole
                .record
                .map_or(last.energy_before, |whole| whole.energy_before),
            energy: 2.0 * size.tau * last.willmore_energy,
            estimates: Some(estimates),
            ..last
        });
        Ok(Candidate {
            state,
            tau: size.tau,
            record,
        })
    }

    fn name(&self) -> &'static str {
        "step doubling"
    }

    fn estimates(&self) -> bool {
        true
    }
}

/// Runs the example; a test does, too.
///
/// # Errors
/// Those of the flow.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let grid = Grid::<2>::per_unit(64, 1.25)?;
    let mut flow = Willmore::on(grid)
        .scheme(StepDoubling::default)
        .start(&Ellipse::new([0.3, 0.2])?)?;
    for record in flow.take(6) {
        let record = record?;
        let made = record.minimization.expect("it minimizes");
        let error = made
            .estimates
            .and_then(|lengths| lengths.error)
            .expect("it estimates");
        println!(
            "t = {:.2e}, tau = {:.2e}: off by {error:.1e}",
            record.time, record.tau
        );
        assert!(error < 0.1 * grid.spacing());
    }
    Ok(())
}
