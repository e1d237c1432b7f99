//! The slow modes of a Willmore step: displacements of the interface.
//!
//! A displacement `d` of the interface along its normal is the motion `p = q phi` of the phase field, with `q = 1 - u^2` and
//! `phi = 3 d / (4 eps)` constant along normals. Along such motions the Hessian of a minimizing movement is that of the
//! geometric problem: `1/2 |p|^2` is the fidelity, and since mean curvature changes by the surface Laplacian,
//! `c/2 |V[u] - u|^2` becomes `tau/2 int q^2 (Lap phi)^2`, up to lower order terms in the curvature. It does not depend on
//! how the step of mean curvature flow is computed.
//!
//! So the coarse part of the preconditioner is `Z (M + tau (S M^-1 S + B))^-1 Z^T` on hat functions `phi_j` of a lattice of
//! spacing `4 eps`, evaluated at the foot point on the interface: `Z = q phi_j`, `M = int q^2 phi_j phi_k`,
//! `S = int q^2 grad phi_j . grad phi_k` with tangential gradients, and `B = 4 int q^2 (kappa^2 grad phi_j . grad phi_k +
//! kappa^4 phi_j phi_k)` for the terms of lower order. Nothing of it needs a Hessian-vector product.

use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, Side};
use geometry::Grid;
use operators::{HostUpdate, HostVectors, Real};

/// Spacing of the lattice in units of `eps`.
const SPACING: f64 = 4.0;
/// Nodes with `1 - u^2` above this belong to the interface: `|s| < 3.1 eps`.
const WINDOW: f64 = 0.03;
/// More functions than this cost more than they save.
const MOST_COLUMNS: usize = 2000;
/// With more than this part of the interface curved more sharply than `1/eps` (corners, in the first steps), displacements
/// along normals say nothing about the slow modes, and the correction is left out.
const SHARP: f64 = 1e-3;
/// Weight of the terms of lower order; with too little of them the correction is too large where the interface is curved.
const BENT: f64 = 4.0;
/// Regularization of the mass matrix of the functions on the interface, which may depend on each other there.
const RIDGE: f64 = 1e-7;

/// A coarse correction at one phase field for one time step.
pub(crate) struct InterfaceModes {
    /// Grid node, then the column and the value of `q phi` for each hat function that does not vanish there.
    nodes: Vec<u32>,
    entries: Vec<(u32, f64)>,
    per_node: usize,
    columns: usize,
    factor: Llt<f64>,
}

impl InterfaceModes {
    /// The correction for the interface of `u`, or none if there is no interface, or too much of it.
    pub(crate) fn new<const D: usize>(
        grid: &Grid<D>,
        u: &[f64],
        eps: f64,
        tau: f64,
    ) -> Option<Self> {
        let cells = grid.cells();
        let spacing = grid.spacing();
        let lattice = ((grid.side() / (SPACING * eps)).round() as usize).max(4);
        let width = cells as f64 / lattice as f64;
        let corners = 1_usize << D;
        let strides: [usize; D] = std::array::from_fn(|axis| grid.stride(axis));
        let mut column_of = vec![u32::MAX; lattice.pow(D as u32)];
        let mut columns = 0;
        let (mut nodes, mut entries) = (Vec::new(), Vec::new());
        let mut slopes: Vec<[f64; D]> = Vec::new();
        let mut sharp = 0_usize;
        let mut curvatures: Vec<f64> = Vec::new();
        let distance = |v: f64| -4.0 / 3.0 * eps * v.clamp(-0.999_999, 0.999_999).atanh();
        for (node, &value) in u.iter().enumerate() {
            let q = 1.0 - value * value;
            if q < WINDOW {
                continue;
            }
            let index = grid.multi_index(node);
            let here = distance(value);
            let mut laplacian = 0.0;
            let mut normal: [f64; D] = std::array::from_fn(|axis| {
                let at = |shift: usize| {
                    let moved = (index[axis] + shift) % cells;
                    distance(u[node + moved * strides[axis] - index[axis] * strides[axis]])
                };
                let (after, before) = (at(1), at(cells - 1));
                laplacian += after - 2.0 * here + before;
                after - before
            });
            // For a distance function the Laplacian is the mean curvature.
            let curvature = laplacian / (spacing * spacing);
            let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
            let slope = length / (2.0 * spacing);
            if slope < 1e-3 {
                continue;
            }
            if curvature.abs() * eps > 1.0 {
                sharp += 1;
            }
            for n in &mut normal {
                *n /= length;
            }
            // The foot point on the interface, in units of the lattice.
            let mut low = [0; D];
            let mut fraction = [0.0; D];
            for axis in 0..D {
                let x = (index[axis] as f64 - here * normal[axis] / spacing) / width;
                low[axis] = x.floor().rem_euclid(lattice as f64) as usize % lattice;
                fraction[axis] = x - x.floor();
            }
            nodes.push(node as u32);
            curvatures.push(curvature);
            for corner in 0..corners {
                let (mut hat, mut position) = (1.0, 0);
                let mut slope = [1.0; D];
                for axis in 0..D {
                    let upper = corner >> axis & 1;
                    let (along, change) = if upper == 1 {
                        (fraction[axis], 1.0)
                    } else {
                        (1.0 - fraction[axis], -1.0)
                    };
                    hat *= along;
                    for (other, slope) in slope.iter_mut().enumerate() {
                        *slope *= if other == axis { change } else { along };
                    }
                    position = position * lattice + (low[axis] + upper) % lattice;
                }
                let column = &mut column_of[position];
                if *column == u32::MAX {
                    *column = columns;
                    columns += 1;
                }
                // The tangential part of the gradient.
                let across: f64 = slope.iter().zip(&normal).map(|(a, n)| a * n).sum();
                let scale = q / (width * spacing);
                slopes.push(std::array::from_fn(|axis| {
                    scale * (slope[axis] - across * normal[axis])
                }));
                entries.push((*column, q * hat));
            }
        }
        let columns = columns as usize;
        let corners_dominate = sharp as f64 > SHARP * nodes.len() as f64;
        if columns == 0 || columns > MOST_COLUMNS || corners_dominate {
            return None;
        }
        let mut mass = Mat::<f64>::zeros(columns, columns);
        let mut stiffness = Mat::<f64>::zeros(columns, columns);
        let mut bent = Mat::<f64>::zeros(columns, columns);
        for ((entries, slopes), curvature) in entries
            .chunks(corners)
            .zip(slopes.chunks(corners))
            .zip(&curvatures)
        {
            let square = curvature * curvature;
            for (&(j, a), da) in entries.iter().zip(slopes) {
                for (&(k, b), db) in entries.iter().zip(slopes) {
                    let dot: f64 = da.iter().zip(db).map(|(x, y)| x * y).sum();
                    mass[(j as usize, k as usize)] += a * b;
                    stiffness[(j as usize, k as usize)] += dot;
                    bent[(j as usize, k as usize)] += BENT * square * (dot + square * a * b);
                }
            }
        }
        let mean: f64 = (0..columns).map(|j| mass[(j, j)]).sum::<f64>() / columns as f64;
        for j in 0..columns {
            mass[(j, j)] += RIDGE * mean;
        }
        // M + tau S M^-1 S
        let bending = &stiffness * mass.llt(Side::Lower).ok()?.solve(&stiffness);
        let coarse = Mat::from_fn(columns, columns, |j, k| {
            mass[(j, k)] + tau * (0.5 * (bending[(j, k)] + bending[(k, j)]) + bent[(j, k)])
        });
        Some(Self {
            nodes,
            entries,
            per_node: corners,
            columns,
            factor: coarse.llt(Side::Lower).ok()?,
        })
    }

    /// Adds `Z A^-1 Z^T r` to `z`.
    pub(crate) fn correct<T: Real>(&self, r: &[T], z: &mut [T]) {
        let mut coarse = Mat::<f64>::zeros(self.columns, 1);
        for (&node, entries) in self.nodes.iter().zip(self.entries.chunks(self.per_node)) {
            let value = r[node as usize].double();
            for &(column, weight) in entries {
                coarse[(column as usize, 0)] += weight * value;
            }
        }
        self.factor.solve_in_place(&mut coarse);
        for (&node, entries) in self.nodes.iter().zip(self.entries.chunks(self.per_node)) {
            let sum: f64 = entries
                .iter()
                .map(|&(column, weight)| weight * coarse[(column as usize, 0)])
                .sum();
            let z = &mut z[node as usize];
            *z = T::of(z.double() + sum);
        }
    }
}

impl HostUpdate for InterfaceModes {
    fn update(&self, vectors: HostVectors<'_>) {
        match vectors {
            HostVectors::Double(r, z) => self.correct(r, z),
            HostVectors::Single(r, z) => self.correct(r, z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::phase_field;
    use geometry::shapes::{Ball, Cuboid};

    const EPS: f64 = 1.0 / 32.0;

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
    fn displacements_of_a_disc_are_damped_as_the_geometric_problem_says() {
        let grid = Grid::<2>::centred(96, 1.0).unwrap();
        let u = disc(&grid);
        let tau = 2e-5;
        let modes = InterfaceModes::new(&grid, &u, EPS, tau).unwrap();
        for k in [0.0_f64, 2.0, 5.0] {
            let p = wave(&grid, &u, k);
            let mut z = vec![0.0; p.len()];
            modes.correct(&p, &mut z);
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
        let modes = InterfaceModes::new(&grid, &u, EPS, 1e-4).unwrap();
        let vector = |a: f64| -> Vec<f64> {
            (0..u.len())
                .map(|i| (a * i as f64).sin() + 0.2 * (a * a * i as f64).cos())
                .collect()
        };
        let apply = |x: &[f64]| {
            let mut z = vec![0.0; x.len()];
            modes.correct(x, &mut z);
            z
        };
        let (a, b) = (vector(0.37), vector(1.91));
        let (za, zb) = (apply(&a), apply(&b));
        let scale = (dot(&za, &za) * dot(&b, &b)).sqrt();
        assert!((dot(&za, &b) - dot(&a, &zb)).abs() < 1e-12 * scale);
        assert!(dot(&a, &za) >= 0.0 && dot(&b, &zb) >= 0.0);
    }

    #[test]
    fn nothing_is_corrected_without_an_interface_or_at_corners() {
        let grid = Grid::<2>::centred(64, 1.0).unwrap();
        let flat = vec![1.0; grid.len()];
        assert!(InterfaceModes::new(&grid, &flat, EPS, 1e-4).is_none());
        let square = Cuboid::new([0.3, 0.3]).unwrap();
        let square = phase_field(grid, &square, EPS).unwrap();
        assert!(InterfaceModes::new(&grid, square.values(), EPS, 1e-4).is_none());
    }
}
