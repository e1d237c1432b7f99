//! The coarse problem with sparse matrices.
//!
//! `M + tau (S M^-1 S + B)` is dense because of `M^-1`. But `C M^-1 conj(C)` with `C = M + i sqrt(tau) (S + 2 M')`,
//! `M' = int q^2 kappa^2 phi_j phi_k`, is the same up to derivatives of `kappa`, and its inverse `conj(C)^-1 M C^-1` takes two solutions
//! with a sparse complex symmetric matrix. As a real system in the real and imaginary parts, `[M, -K; -K, -M]`, that is quasidefinite:
//! every order of elimination works without pivoting, and couplings stay between neighbours on the lattice.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, Par, Side, Spec};

/// `conj(C)^-1 M C^-1`.
pub(crate) struct SparseInverse {
    /// Where each column is in the order of elimination.
    position: Vec<u32>,
    /// Lower triangle, in that order.
    mass: SparseColMat<usize, f64>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
}

/// An entry `(row, column, M, K)`; entries at the same place add up.
pub(crate) type Entry = (u32, u32, f64, f64);

impl SparseInverse {
    /// Factorizes, eliminating the columns in this order.
    pub(crate) fn new(order: &[u32], entries: &[Entry]) -> Option<Self> {
        let count = order.len();
        let mut position = vec![0; count];
        for (place, &column) in order.iter().enumerate() {
            position[column as usize] = place as u32;
        }
        let (mut mass, mut real) = (Vec::new(), Vec::new());
        for &(row, column, m, k) in entries {
            let [row, column] = [row, column].map(|i| position[i as usize] as usize);
            if row < column {
                continue;
            }
            mass.push(Triplet::new(row, column, m));
            // The entries in the upper triangle of the real system.
            let (below, left) = (2 * row, 2 * column);
            real.push(Triplet::new(left, below, m));
            real.push(Triplet::new(left, below + 1, -k));
            if row > column {
                real.push(Triplet::new(left + 1, below, -k));
            }
            real.push(Triplet::new(left + 1, below + 1, -m));
        }
        let mass = SparseColMat::try_new_from_triplets(count, count, &mass).ok()?;
        let real = SparseColMat::try_new_from_triplets(2 * count, 2 * count, &real).ok()?;
        let (symbolic, factor) = factorize(&real)?;
        Some(Self {
            position,
            mass,
            symbolic,
            factor,
        })
    }

    /// Applies it.
    pub(crate) fn apply(&self, x: &mut [f64]) {
        let count = x.len();
        let mut pairs = Mat::<f64>::zeros(2 * count, 1);
        for (value, &place) in x.iter().zip(&self.position) {
            pairs[(2 * place as usize, 0)] = *value;
        }
        self.solve(&mut pairs);
        // The product of `M` with the conjugate, of which the real system takes minus the imaginary part.
        let mut product = Mat::<f64>::zeros(2 * count, 1);
        for column in 0..count {
            let rows = self.mass.row_idx_of_col(column);
            for (row, m) in rows.zip(self.mass.val_of_col(column)) {
                for part in 0..2 {
                    product[(2 * row + part, 0)] += m * pairs[(2 * column + part, 0)];
                    if row != column {
                        product[(2 * column + part, 0)] += m * pairs[(2 * row + part, 0)];
                    }
                }
            }
        }
        self.solve(&mut product);
        for (value, &place) in x.iter_mut().zip(&self.position) {
            *value = product[(2 * place as usize, 0)];
        }
    }

    /// Real and imaginary parts of `C^-1 b`, of the real part of `b` and minus its imaginary part.
    fn solve(&self, pairs: &mut Mat<f64>) {
        let factor = LdltRef::new(&self.symbolic, &self.factor);
        let memory = self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        factor.solve_in_place_with_conj(
            Conj::No,
            pairs.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(memory)),
        );
    }
}

fn factorize(matrix: &SparseColMat<usize, f64>) -> Option<(SymbolicCholesky<usize>, Vec<f64>)> {
    // Without a permutation, it is the upper triangle that is looked at.
    let symbolic = factorize_symbolic_cholesky(
        matrix.symbolic(),
        Side::Upper,
        SymmetricOrdering::Identity,
        CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        },
    )
    .ok()?;
    let mut factor = vec![0.0; symbolic.len_val()];
    let memory = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Spec::default());
    symbolic
        .factorize_numeric_ldlt(
            &mut factor,
            matrix.as_ref(),
            Side::Upper,
            LdltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(memory)),
            Spec::default(),
        )
        .ok()?;
    Some((symbolic, factor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dissection::dissection;
    use faer::c64;
    use faer::linalg::solvers::Solve;

    #[test]
    fn it_is_the_inverse_of_the_product_of_dense_matrices() {
        // Tensor products of hat functions' mass and stiffness matrices on a periodic lattice, with a bump in both.
        let cells = 9;
        let places: Vec<[u32; 2]> = (0..cells * cells).map(|i| [i / cells, i % cells]).collect();
        let count = places.len();
        let mut entries: Vec<Entry> = Vec::new();
        let (mut m, mut c) = (Mat::<c64>::zeros(count, count), Mat::zeros(count, count));
        let values = [[4.0, 1.0], [2.0, -1.0]];
        for (i, a) in places.iter().enumerate() {
            for (j, b) in places.iter().enumerate() {
                let gap = |axis: usize| {
                    let gap = a[axis].abs_diff(b[axis]);
                    gap.min(cells - gap) as usize
                };
                let [x, y] = [gap(0), gap(1)];
                if x > 1 || y > 1 {
                    continue;
                }
                let bump = 1.0 + (i as f64).cos() * (j as f64).cos();
                let mass = bump * values[0][x] * values[0][y];
                let stiff = 3.0 * (values[0][x] * values[1][y] + values[1][x] * values[0][y]);
                m[(i, j)] = c64::new(mass, 0.0);
                c[(i, j)] = c64::new(mass, stiff);
                // In two parts, which add up.
                entries.push((i as u32, j as u32, 0.25 * mass, stiff));
                entries.push((i as u32, j as u32, 0.75 * mass, 0.0));
            }
        }
        let conjugate = Mat::from_fn(count, count, |i, j| c[(i, j)].conj());
        let product = &c * m.partial_piv_lu().solve(&conjugate);
        let b: Vec<f64> = (0..count).map(|i| (1.3 * i as f64).sin()).collect();
        let right = Mat::from_fn(count, 1, |i, _| c64::new(b[i], 0.0));
        let expected = product.partial_piv_lu().solve(&right);
        let mut found = b;
        SparseInverse::new(&dissection(&places, cells), &entries)
            .unwrap()
            .apply(&mut found);
        for (i, found) in found.iter().enumerate() {
            let exact = expected[(i, 0)];
            assert!(
                (found - exact.re).abs() < 1e-12 && exact.im.abs() < 1e-12,
                "{found} {exact}"
            );
        }
    }
}
