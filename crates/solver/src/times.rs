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
    /// The coarse correction in these applications.
    pub coarse: f64,
    /// Assembly of the coarse correction.
    pub assembly: f64,
    /// The search for the nodes of the interface with their normals and curvatures, in this assembly.
    pub samples: f64,
    /// Energies and gradients.
    pub energies: f64,
    /// Minimizations on coarser grids that find the start.
    pub start: f64,
}

impl PhaseTimes {
    /// The names of [`Self::parts`].
    pub const PARTS: [&'static str; 7] = [
        "products",
        "inverse in the pure phases",
        "coarse correction",
        "samples of the interface",
        "factorization",
        "energies and gradients",
        "starts on coarser grids",
    ];

    /// The times without overlap.
    pub fn parts(&self) -> [(&'static str, f64); 7] {
        let seconds = [
            self.products,
            self.preconditioner - self.coarse,
            self.coarse,
            self.samples,
            self.assembly - self.samples,
            self.energies,
            self.start,
        ];
        std::array::from_fn(|k| (Self::PARTS[k], seconds[k]))
    }
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
