//! Wall times of the phases of a minimization.

use std::cell::Cell;
use std::time::Instant;

use burn::tensor::{DType, Tensor};
use serde::{Deserialize, Serialize};

use crate::{Error, Objective};

/// Wall times of the phases of a minimization in seconds. Their sum is less than the step's time by vector operations, line searches
/// and measurements.
///
/// On a GPU, which works while the host goes on, only sums mean something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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

impl PhaseTimes {
    /// With those of a minimization before it.
    pub(crate) fn after(self, first: &Self) -> Self {
        Self {
            products: first.products + self.products,
            preconditioner: first.preconditioner + self.preconditioner,
            assembly: first.assembly + self.assembly,
            energies: first.energies + self.energies,
            start: first.start + self.start,
        }
    }
}

/// Adds up wall times.
#[derive(Default)]
pub(crate) struct Stopwatch(Cell<f64>);

impl Stopwatch {
    pub(crate) fn time<T>(&self, f: impl FnOnce() -> T) -> T {
        let clock = Instant::now();
        let result = f();
        self.0.set(self.0.get() + clock.elapsed().as_secs_f64());
        result
    }

    pub(crate) fn seconds(&self) -> f64 {
        self.0.get()
    }
}

/// An objective that measures its own time.
pub(crate) struct Timed<'a, O> {
    objective: &'a mut O,
    pub(crate) products: Stopwatch,
    pub(crate) energies: Stopwatch,
}

impl<'a, O> Timed<'a, O> {
    pub(crate) fn new(objective: &'a mut O) -> Self {
        Self {
            objective,
            products: Stopwatch::default(),
            energies: Stopwatch::default(),
        }
    }
}

impl<const D: usize, O: Objective<D>> Objective<D> for Timed<'_, O> {
    fn value(&mut self, u: &Tensor<D>) -> Result<f64, Error> {
        self.energies.time(|| self.objective.value(u))
    }

    fn evaluate(&mut self, u: &Tensor<D>) -> Result<(f64, Tensor<D>), Error> {
        self.energies.time(|| self.objective.evaluate(u))
    }

    fn hessian_vector_product(&mut self, p: &Tensor<D>) -> Result<Tensor<D>, Error> {
        self.products
            .time(|| self.objective.hessian_vector_product(p))
    }

    fn product_dtype(&self) -> Option<DType> {
        self.objective.product_dtype()
    }

    fn hold(&self, u: Tensor<D>) -> Tensor<D> {
        self.objective.hold(u)
    }

    fn unit(&self) -> f64 {
        self.objective.unit()
    }
}
