//! Wall times of the phases of a minimization.

use std::cell::Cell;
use std::time::Instant;

use serde::{Deserialize, Serialize};

/// Wall times of the phases of a minimization in seconds. Their sum is less than the step's time by vector operations, line searches
/// and measurements.
///
/// On a GPU, which works while the host goes on, only sums mean something.
#[derive(Clone, Copy, Debug, Default, PartialEq, derive_more::Add, Serialize, Deserialize)]
pub struct PhaseTimes {
    /// Hessian-vector products.
    pub products: f64,
    /// Applications of the preconditioner.
    pub preconditioner: f64,
    /// Assembly of its coarse correction.
    pub assembly: f64,
    /// Energies and gradients.
    pub energies: f64,
    /// Minimizations on coarser grids that find the start.
    pub start: f64,
}

/// Adds the wall time of some work to that of a phase.
pub(crate) fn timed<T>(
    times: &Cell<PhaseTimes>,
    phase: fn(&mut PhaseTimes) -> &mut f64,
    work: impl FnOnce() -> T,
) -> T {
    let clock = Instant::now();
    let result = work();
    let mut sum = times.get();
    *phase(&mut sum) += clock.elapsed().as_secs_f64();
    times.set(sum);
    result
}
