//! The paper's linear algebra: sparse Cholesky factorizations (faer).

use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{Pair, SparseColMat, SymbolicSparseColMat};
use faer::{Mat, Side};

use crate::Error;
use crate::element::Stencil;

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

fn failed(unknowns: usize, reason: &impl std::fmt::Debug) -> Error {
    Error::Factorization {
        unknowns,
        reason: format!("{reason:?}"),
    }
}

impl Symbolic {
    pub(crate) fn new<const D: usize>(matrix: &Stencil<D>) -> Result<Self, Error> {
        let unknowns = matrix.diagonal().len();
        let indices: Vec<Pair<usize, usize>> = matrix
            .lower_entries()
            .map(|(row, col, _)| Pair { row, col })
            .collect();
        let (pattern, order) =
            SymbolicSparseColMat::try_new_from_indices(unknowns, unknowns, &indices)
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

    pub(crate) fn factorize<const D: usize>(
        &self,
        matrix: &Stencil<D>,
    ) -> Result<Factorization, Error> {
        let values: Vec<f64> = matrix.lower_entries().map(|(.., value)| value).collect();
        let matrix = SparseColMat::new_from_argsort(self.pattern.clone(), &self.order, &values)
            .map_err(|error| failed(self.unknowns, &error))?;
        Llt::try_new_with_symbolic(self.cholesky.clone(), matrix.as_ref(), Side::Lower)
            .map(Factorization)
            .map_err(|error| failed(self.unknowns, &error))
    }
}

impl Factorization {
    pub(crate) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = Mat::from_fn(right.len(), 1, |i, _| right[i]);
        self.0.solve_in_place(&mut x);
        x.col_as_slice(0).to_vec()
    }
}
