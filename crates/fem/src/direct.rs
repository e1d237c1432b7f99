//! Direct linear solvers, as in the paper's comparison: sparse Cholesky factorizations (faer), for all dimensions alike.

use std::sync::LazyLock;

use faer::linalg::solvers::Solve;
pub(crate) use faer::sparse::Pair;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Mat, Side};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::Error;

type Argsort = faer::sparse::Argsort<usize>;

/// Fill-reducing ordering and structure, shared by all matrices of one grid.
pub(crate) struct Symbolic {
    pattern: SymbolicSparseColMat<usize>,
    order: Argsort,
    cholesky: SymbolicLlt<usize>,
    unknowns: usize,
}

/// `L L^T`
pub(crate) struct Factorization(Llt<usize, f64>);

/// The order of sums in factorizations and solutions depends on the number of threads.
fn on_two_threads<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    static POOL: LazyLock<Option<ThreadPool>> =
        LazyLock::new(|| ThreadPoolBuilder::new().num_threads(2).build().ok());
    match &*POOL {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

fn failed(unknowns: usize, reason: &impl std::fmt::Debug) -> Error {
    Error::Factorization {
        unknowns,
        reason: format!("{reason:?}"),
    }
}

impl Symbolic {
    /// Of matrices with entries at these places of the lower triangle.
    pub(crate) fn new(unknowns: usize, places: &[Pair<usize, usize>]) -> Result<Self, Error> {
        let (pattern, order) =
            SymbolicSparseColMat::try_new_from_indices(unknowns, unknowns, places)
                .map_err(|error| failed(unknowns, &error))?;
        let cholesky = SymbolicLlt::try_new(pattern.as_ref(), Side::Lower)
            .map_err(|error| failed(unknowns, &error))?;
        Ok(Self {
            pattern,
            order,
            cholesky,
            unknowns,
        })
    }

    /// The matrix with these entries at the places.
    pub(crate) fn factorize(&self, entries: &[f64]) -> Result<Factorization, Error> {
        let matrix = SparseColMat::new_from_argsort(self.pattern.clone(), &self.order, entries)
            .map_err(|error| failed(self.unknowns, &error))?;
        let factorize =
            || Llt::try_new_with_symbolic(self.cholesky.clone(), matrix.as_ref(), Side::Lower);
        on_two_threads(factorize)
            .map(Factorization)
            .map_err(|error| failed(self.unknowns, &error))
    }
}

impl Factorization {
    pub(crate) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = Mat::from_fn(right.len(), 1, |i, _| right[i]);
        on_two_threads(|| self.0.solve_in_place(&mut x));
        x.col_as_slice(0).to_vec()
    }
}
