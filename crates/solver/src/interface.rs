//! The slow modes of a Willmore step: displacements of the interface.
//!
//! A displacement `d` of the interface along its normal is the motion `p = q phi` of the phase field, with `q = 1 - u^2` and
//! `phi = 3 d / (4 eps)` constant along normals. Along such motions the Hessian of a minimizing movement is that of the
//! geometric problem: `1/2 |p|^2` is the fidelity, and since mean curvature changes by the surface Laplacian,
//! `c/2 |V[u] - u|^2` becomes `tau/2 int q^2 (Lap phi)^2`, up to lower order terms in the curvature. It does not depend on
//! how the step of mean curvature flow is computed.
//!
//! So the coarse correction of the preconditioner is `Z (M + tau (S M^-1 S + B))^-1 Z^T` on hat functions `phi_j` of a lattice of
//! spacing `4 eps`, evaluated at the foot point on the interface: `Z = q phi_j`, cut off where `q` is small, `M = int q^2 phi_j phi_k`,
//! `S = int q^2 grad phi_j . grad phi_k` with tangential gradients, and `B = 4 int q^2 (kappa^2 grad phi_j . grad phi_k +
//! kappa^4 phi_j phi_k)` for the terms of lower order. Nothing of it needs a Hessian-vector product. Where there are too many functions for
//! dense matrices, and on active bricks, the [sparse] form takes their place.
//!
//! [sparse]: crate::sparse

use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::solve::solve_in_place;
use faer::linalg::solvers::Solve;
use faer::{ColMut, Mat, Par, Side};
use geometry::{Nodes, parallel};
use operators::{HostUpdate, Interpolation, Real};

use crate::dissection::dissection;
use crate::samples::{MOST_CORNERS, Samples};
use crate::sparse::{Entry, SparseInverse};

/// Spacing of the lattice in units of `eps`.
const SPACING: f64 = 4.0;
/// The functions are cut off where `q` falls below this: at `|s| = 3.1 eps`,
const WINDOW: f64 = 0.03;
/// or below this over the square root of `c = tau / tautilde^2`, since the edge adds about `c q^2` to the energy of a displacement,
const CUT: f64 = 5.0;
/// but nowhere below this, at `|s| = 5.5 eps`.
const LEAST: f64 = 0.001;
/// With more functions than this the matrices are sparse.
const MOST_DENSE: usize = 2000;
/// With more than this fraction of the interface curved more sharply than `1/eps` (corners, in the first steps), displacements
/// along normals are not the slow modes, and the correction is left out.
const SHARP: f64 = 1e-3;
/// Weight of the terms of lower order; with too little of them the correction is too large where the interface is curved.
const BENT: f64 = 4.0;
/// Regularization of the mass matrix of the functions on the interface, which may depend on each other there.
const RIDGE: f64 = 1e-7;
/// Vectors are worked on in pieces of this many entries.
const CHUNK: usize = 1 << 14;

/// A coarse correction at one phase field for one time step.
pub(crate) struct InterfaceModes<const D: usize> {
    samples: Samples<D>,
    inverse: Inverse,
}

/// Applies the inverse of the coarse problem.
type Inverse = Box<dyn Fn(&mut [f64]) + Send + Sync>;

/// One matrix per cell, rows and columns being the corners.
type Local = [[f64; MOST_CORNERS]; MOST_CORNERS];

impl<const D: usize> InterfaceModes<D> {
    /// The interface of `u`, whose values lie at some nodes of the grid; with a `region` only its nodes count.
    pub(crate) fn samples(
        nodes: &Nodes<D>,
        u: &[f64],
        eps: f64,
        stiffness: f64,
        region: Option<&[bool]>,
    ) -> Option<Samples<D>> {
        let window = (CUT / stiffness.sqrt()).clamp(LEAST, WINDOW);
        Samples::new(nodes, u, eps, SPACING * eps, window, region)
    }

    /// The correction for an interface of width `eps`, or none if there is no interface, or one with corners.
    pub(crate) fn on(nodes: &Nodes<D>, samples: Samples<D>, eps: f64, tau: f64) -> Option<Self> {
        let inner = samples.nodes.iter().filter(|s| s.weight >= WINDOW);
        let sharp = (inner.clone()).filter(|s| s.curvature.abs() * eps > 1.0);
        let corners_dominate = sharp.count() as f64 > SHARP * inner.count() as f64;
        if samples.nodes.is_empty() || corners_dominate {
            return None;
        }
        let inverse: Inverse = if nodes.bricks().is_none() && samples.columns.len() <= MOST_DENSE {
            dense_inverse(coarse_matrices(&samples), tau)?
        } else {
            let inverse = sparse_inverse(&samples, tau)?;
            Box::new(move |x| inverse.apply(x))
        };
        Some(Self { samples, inverse })
    }
}

impl<const D: usize> HostUpdate for InterfaceModes<D> {
    /// Adds `Z A^-1 Z^T r` to `z`.
    fn update<T: Real>(&self, r: &[T], z: &mut [T]) {
        let samples = &self.samples;
        let sums = parallel::map(samples.corners.len(), 16, &|cell| {
            let mut sums = [0.0; MOST_CORNERS];
            for sample in samples.of_cell(cell) {
                let value = sample.weight * r[sample.node as usize].double();
                for (sum, hat) in sums.iter_mut().zip(sample.hats()).take(1 << D) {
                    *sum += hat * value;
                }
            }
            sums
        });
        let coarse = self.solved(sums.iter().map(|sums| &sums[..1 << D]));
        parallel::over_chunks(z, CHUNK, &|first, z| {
            let from = samples.nodes.partition_point(|s| (s.node as usize) < first);
            for sample in &samples.nodes[from..] {
                let Some(z) = z.get_mut(sample.node as usize - first) else {
                    break;
                };
                let sum: f64 = (sample.hats().iter())
                    .zip(&samples.corners[sample.cell as usize])
                    .take(1 << D)
                    .map(|(hat, &column)| hat * coarse[column as usize])
                    .sum();
                *z = T::of(z.double() + sample.weight * sum);
            }
        });
    }

    fn interpolation(&self) -> Option<Interpolation> {
        Some(self.samples.interpolation())
    }

    fn at_corners(&self, sums: &mut [f64]) {
        let coarse = self.solved(sums.chunks(1 << D));
        let corners = self.samples.corners.iter();
        for (values, corners) in sums.chunks_mut(1 << D).zip(corners) {
            for (value, &column) in values.iter_mut().zip(corners) {
                *value = coarse[column as usize];
            }
        }
    }
}

impl<const D: usize> InterfaceModes<D> {
    /// The solution of the coarse problem for what the cells contribute to the functions at their corners.
    fn solved<'a>(&self, sums: impl Iterator<Item = &'a [f64]>) -> Vec<f64> {
        let mut coarse = vec![0.0; self.samples.columns.len()];
        for (corners, sums) in self.samples.corners.iter().zip(sums) {
            for (&column, sum) in corners.iter().zip(sums) {
                coarse[column as usize] += sum;
            }
        }
        (self.inverse)(&mut coarse);
        coarse
    }
}

/// `M`, `S` and `B`.
fn coarse_matrices<const D: usize>(samples: &Samples<D>) -> [Mat<f64>; 3] {
    let locals = local_matrices(samples, |dot, product, square| {
        [product, dot, BENT * square * (dot + square * product)]
    });
    let columns = samples.columns.len();
    let mut mass = Mat::<f64>::zeros(columns, columns);
    let mut stiffness = Mat::<f64>::zeros(columns, columns);
    let mut bent = Mat::<f64>::zeros(columns, columns);
    for (corners, [m, s, b]) in samples.corners.iter().zip(&locals) {
        for (j, &row) in corners.iter().enumerate().take(1 << D) {
            for (k, &column) in corners.iter().enumerate().take(1 << D) {
                let place = (row as usize, column as usize);
                mass[place] += m[j][k];
                stiffness[place] += s[j][k];
                bent[place] += b[j][k];
            }
        }
    }
    [mass, stiffness, bent]
}

/// `(M + tau (S M^-1 S + B))^-1`
fn dense_inverse([mut mass, stiffness, bent]: [Mat<f64>; 3], tau: f64) -> Option<Inverse> {
    let columns = mass.nrows();
    let mean: f64 = (0..columns).map(|j| mass[(j, j)]).sum::<f64>() / columns as f64;
    for j in 0..columns {
        mass[(j, j)] += RIDGE * mean;
    }
    let bending = &stiffness * mass.llt(Side::Lower).ok()?.solve(&stiffness);
    let matrix = Mat::from_fn(columns, columns, |j, k| {
        mass[(j, k)] + tau * (0.5 * (bending[(j, k)] + bending[(k, j)]) + bent[(j, k)])
    });
    let factor = matrix.llt(Side::Lower).ok()?;
    Some(Box::new(move |x| {
        let x = ColMut::from_slice_mut(x).as_mat_mut();
        // On any number of threads sums are divided as on two.
        let threads = Par::rayon(2);
        solve_in_place(factor.L(), x, threads, MemStack::new(&mut []));
    }))
}

/// `conj(C)^-1 M C^-1`, see [`crate::sparse`].
fn sparse_inverse<const D: usize>(samples: &Samples<D>, tau: f64) -> Option<SparseInverse> {
    let root = tau.sqrt();
    // To the terms of lower order half of their weight, since `C` comes twice.
    let locals = local_matrices(samples, |dot, product, square| {
        [product, root * (dot + 0.5 * BENT * square * product)]
    });
    let mut entries: Vec<Entry> = Vec::new();
    for (corners, [m, k]) in samples.corners.iter().zip(&locals) {
        for (i, &row) in corners.iter().enumerate().take(1 << D) {
            for (j, &column) in corners.iter().enumerate().take(1 << D) {
                entries.push((row, column, m[i][j], k[i][j]));
            }
        }
    }
    let columns = samples.columns.len();
    let diagonal = entries.iter().filter(|(row, column, ..)| row == column);
    let mean = diagonal.map(|(.., m, _)| m).sum::<f64>() / columns as f64;
    entries.extend((0..columns as u32).map(|j| (j, j, RIDGE * mean, 0.0)));
    let order = dissection(&samples.columns, samples.cells as u32);
    SparseInverse::new(&order, &entries)
}

/// What each cell of the lattice adds to some matrices: for every sample and every pair of functions the `entries` made of
/// `q^2 grad phi_j . grad phi_k`, `q^2 phi_j phi_k` and `kappa^2`.
fn local_matrices<const D: usize, const N: usize>(
    samples: &Samples<D>,
    entries: impl Fn(f64, f64, f64) -> [f64; N] + Sync,
) -> Vec<[Local; N]> {
    let unit = samples.spacing.powi(-2);
    let of_cell = |cell: usize| {
        let mut matrices = [[[0.0; MOST_CORNERS]; MOST_CORNERS]; N];
        for sample in samples.of_cell(cell) {
            let (hats, slopes) = (sample.hats(), sample.slopes());
            let weight = sample.weight * sample.weight;
            let square = sample.curvature * sample.curvature;
            for j in 0..1 << D {
                for k in 0..1 << D {
                    let slope: f64 = slopes[j].iter().zip(&slopes[k]).map(|(a, b)| a * b).sum();
                    let (dot, product) = (weight * unit * slope, weight * hats[j] * hats[k]);
                    for (matrix, entry) in matrices.iter_mut().zip(entries(dot, product, square)) {
                        matrix[j][k] += entry;
                    }
                }
            }
        }
        matrices
    };
    parallel::map(samples.corners.len(), 1, &of_cell)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::shapes::{Ball, Cuboid};
    use geometry::{Grid, phase_field};

    const EPS: f64 = 1.0 / 32.0;

    impl<const D: usize> InterfaceModes<D> {
        /// Where `c = 1`.
        fn new(grid: Grid<D>, u: &[f64], tau: f64) -> Option<Self> {
            let nodes = grid.into();
            let samples = Self::samples(&nodes, u, EPS, 1.0, None)?;
            Self::on(&nodes, samples, EPS, tau)
        }
    }

    fn disc(grid: &Grid<2>) -> Vec<f64> {
        let ball = Ball::new([0.0, 0.0], 0.3).unwrap();
        phase_field(*grid, &ball, EPS).unwrap().into_values()
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// `q cos(k theta)` around the disc.
    fn wave(grid: &Grid<2>, u: &[f64], k: f64) -> Vec<f64> {
        (0..u.len())
            .map(|i| {
                let [x, y] = grid.node(i);
                (1.0 - u[i] * u[i]) * (k * y.atan2(x)).cos()
            })
            .collect()
    }

    #[test]
    fn the_inverse_does_not_depend_on_the_number_of_threads() {
        const COLUMNS: usize = 900;
        let matrix = |diagonal: f64| {
            Mat::from_fn(COLUMNS, COLUMNS, |j, k| {
                let far = j.abs_diff(k) as f64;
                (0.7 * (j + k) as f64).sin() / (1.0 + far * far)
                    + if j == k { diagonal } else { 0.0 }
            })
        };
        let solved = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let matrices = [matrix(4.0), matrix(3.0), matrix(2.0)];
                let mut x: Vec<f64> = (0..COLUMNS).map(|j| (1.3 * j as f64).cos()).collect();
                dense_inverse(matrices, 0.3).unwrap()(&mut x);
                x.into_iter().map(f64::to_bits).collect::<Vec<_>>()
            })
        };
        let two = solved(2);
        for threads in [1, 3, 5] {
            assert!(solved(threads) == two, "{threads} threads");
        }
    }

    #[test]
    fn displacements_of_a_disc_are_damped_as_the_geometric_problem_says() {
        let grid = Grid::<2>::centred(96, 1.0).unwrap();
        let u = disc(&grid);
        let tau = 2e-5;
        let modes = InterfaceModes::new(grid, &u, tau).unwrap();
        for k in [0.0_f64, 2.0, 5.0] {
            let p = wave(&grid, &u, k);
            let mut z = vec![0.0; p.len()];
            modes.update(&p, &mut z);
            // On the circle of radius R, with kappa = 1/R and the wave number k/R.
            let (w, kappa) = (k / 0.3, 1.0_f64 / 0.3);
            let stiffness = w.powi(4) + BENT * kappa.powi(2) * (w.powi(2) + kappa.powi(2));
            let expected = 1.0 / (1.0 + tau * stiffness);
            let found = dot(&p, &z) / dot(&p, &p);
            assert!(
                (found / expected - 1.0).abs() < 0.05,
                "{k}: {found} {expected}"
            );
        }
    }

    #[test]
    fn the_correction_is_symmetric_and_not_negative() {
        let grid = Grid::<2>::centred(64, 1.0).unwrap();
        let u = disc(&grid);
        let modes = InterfaceModes::new(grid, &u, 1e-4).unwrap();
        let vector = |a: f64| -> Vec<f64> {
            (0..u.len())
                .map(|i| (a * i as f64).sin() + 0.2 * (a * a * i as f64).cos())
                .collect()
        };
        let apply = |x: &[f64]| {
            let mut z = vec![0.0; x.len()];
            modes.update(x, &mut z);
            z
        };
        let (a, b) = (vector(0.37), vector(1.91));
        let (za, zb) = (apply(&a), apply(&b));
        let scale = (dot(&za, &za) * dot(&b, &b)).sqrt();
        assert!((dot(&za, &b) - dot(&a, &zb)).abs() < 1e-12 * scale);
        assert!(dot(&a, &za) >= 0.0 && dot(&b, &zb) >= 0.0);
    }

    fn interpolation_case<const D: usize>(cells: usize) {
        let grid = Grid::<D>::centred(cells, 1.0).unwrap();
        let ball = Ball::new([0.0; D], 0.3).unwrap();
        let u = phase_field(grid, &ball, EPS).unwrap().into_values();
        let modes = InterfaceModes::new(grid, &u, 1e-4).unwrap();
        let r: Vec<f64> = (0..u.len()).map(|i| (0.37 * i as f64).sin()).collect();
        let (mut expected, mut found) = (r.clone(), r.clone());
        modes.update(&r, &mut expected);

        let lattice = modes.interpolation().unwrap();
        let corners = 1 << D;
        let hat = |sample: usize, corner: usize| -> f64 {
            let places = &lattice.places[sample * (D + 1)..][..=D];
            let along = |axis: usize| match corner >> axis & 1 {
                1 => places[1 + axis],
                _ => 1.0 - places[1 + axis],
            };
            places[0] * (0..D).map(along).product::<f64>()
        };
        let samples =
            |cell: usize| lattice.starts[cell] as usize..lattice.starts[cell + 1] as usize;
        let mut values = vec![0.0; (lattice.starts.len() - 1) * corners];
        for (place, value) in values.iter_mut().enumerate() {
            let terms = samples(place / corners);
            let term = |i: usize| hat(i, place % corners) * r[lattice.entries[i] as usize];
            *value = terms.map(term).sum();
        }
        modes.at_corners(&mut values);
        for (cell, values) in values.chunks(corners).enumerate() {
            for i in samples(cell) {
                let terms = values.iter().enumerate();
                let sum: f64 = terms.map(|(corner, value)| hat(i, corner) * value).sum();
                found[lattice.entries[i] as usize] += sum;
            }
        }
        let difference: Vec<f64> = found.iter().zip(&expected).map(|(a, b)| a - b).collect();
        assert!(dot(&difference, &difference) < 1e-26 * dot(&expected, &expected));
        assert!(expected != r);
    }

    /// What a GPU does of the correction, and what visits the host for it.
    #[test]
    fn the_correction_is_an_interpolation_and_its_transpose() {
        interpolation_case::<2>(64);
        interpolation_case::<3>(48);
    }

    #[test]
    fn nothing_is_corrected_without_an_interface_or_at_corners() {
        let grid = Grid::<2>::centred(64, 1.0).unwrap();
        let flat = vec![1.0; grid.len()];
        assert!(InterfaceModes::new(grid, &flat, 1e-4).is_none());
        let square = Cuboid::new([0.3, 0.3]).unwrap();
        let square = phase_field(grid, &square, EPS).unwrap();
        assert!(InterfaceModes::new(grid, square.values(), 1e-4).is_none());
    }
}
