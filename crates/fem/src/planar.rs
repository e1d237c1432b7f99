//! Finite-element steps on flat and slightly bent interfaces, for their calibration.
//!
//! For an integer normal `a` a cell with its first corner on the plane `e` has its corners on the planes `e + a . c`,
//! `c` in `{0, 1}^D`: functions of the plane alone make all matrices one-dimensional. All of them are sums of element matrices
//! `L_cc'`, and on a bent interface the corner `c'` of an element is nearer by `kappa |b_t|^2 / (2 (D - 1))` than on the flat one,
//! seen from the corner `c`, where `b_t` is the part of `b = c' - c` along the interface.

use faer::linalg::solvers::{PartialPivLu, Solve};
use faer::{Col, Mat};
use mean_curvature::PlanarStep;
use mean_curvature::calibration::PlanarScales;

use crate::element::gauss_points;
use crate::finite_elements::TimeDiscretization;

/// A limit that no well-posed step comes near.
const NEWTON: usize = 40;
/// Last correction of a converged step.
const CONVERGED: f64 = 1e-13;

/// A finite-element step on planes with one normal.
pub(crate) struct ElementsOnPlanes {
    discretization: TimeDiscretization,
    scales: PlanarScales,
    /// `9/8 tautilde / eps^2`.
    reaction: f64,
    /// Planes of the corners, from the plane of the first.
    corners: Vec<usize>,
    /// Weights and values of the corners' basis functions at the Gauss points.
    points: Vec<(f64, Vec<f64>)>,
    /// Element matrices, corner by corner.
    mass: Vec<Vec<f64>>,
    stiffness: Vec<Vec<f64>>,
    /// `|b_t|^2 / (2 (D - 1))` from corner to corner.
    bend: Vec<Vec<f64>>,
}

/// A sum of element matrices, for functions of the plane.
#[derive(Clone, Copy)]
enum Part<'a> {
    Mass(f64),
    Stiffness(f64),
    /// `int v^2 phi_i phi_j` for nodal values `v`.
    Weighted(f64, &'a Col<f64>),
}

impl ElementsOnPlanes {
    /// A step with these ratios on planes with this normal, whose entries must not be negative.
    pub(crate) fn new(
        discretization: TimeDiscretization,
        eps_over_h: f64,
        step_over_h2: f64,
        normal: &[isize],
    ) -> Self {
        let dimension = normal.len();
        let square: f64 = normal.iter().map(|a| (a * a) as f64).sum();
        let count = 1_usize << dimension;
        let bit = |corner: usize, axis: usize| corner >> axis & 1;
        let plane = |corner: usize| -> isize {
            let along = |(axis, a): (usize, &isize)| a * bit(corner, axis).cast_signed();
            normal.iter().enumerate().map(along).sum()
        };
        let table = |entry: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            let row = |c: usize| (0..count).map(|d| entry(c, d)).collect();
            (0..count).map(row).collect()
        };
        // Along one axis: 1/3 and 1/6 for masses, 1 and -1 for slopes.
        let line_mass = |c: usize, d: usize| if c == d { 1.0 / 3.0 } else { 1.0 / 6.0 };
        let mass = table(&|c, d| {
            (0..dimension)
                .map(|axis| line_mass(bit(c, axis), bit(d, axis)))
                .product()
        });
        let stiffness = table(&|c, d| {
            let along = |slope: usize| -> f64 {
                (0..dimension)
                    .map(|axis| {
                        let (c, d) = (bit(c, axis), bit(d, axis));
                        match (axis == slope, c == d) {
                            (true, true) => 1.0,
                            (true, false) => -1.0,
                            (false, _) => line_mass(c, d),
                        }
                    })
                    .product()
            };
            (0..dimension).map(along).sum()
        });
        let bend = table(&|c, d| {
            let length = f64::from((c ^ d).count_ones());
            let along = (plane(d) - plane(c)) as f64;
            (length - along * along / square) / (2.0 * (dimension - 1) as f64)
        });
        Self {
            discretization,
            scales: PlanarScales {
                eps: eps_over_h,
                mcf_step: step_over_h2,
                spacing: 1.0 / square.sqrt(),
            },
            reaction: 9.0 / 8.0 * step_over_h2 / (eps_over_h * eps_over_h),
            corners: (0..count).map(|c| plane(c).cast_unsigned()).collect(),
            points: gauss_points(dimension),
            mass,
            stiffness,
            bend,
        }
    }

    /// Calls `f(row, column, entry)` for the sum over all cells that touch the layer of planes. Beyond the layer functions are
    /// constant.
    fn assemble(
        &self,
        planes: usize,
        parts: &[Part],
        bent: bool,
        mut f: impl FnMut(usize, usize, f64),
    ) {
        let count = self.corners.len();
        let reach = self.corners.iter().copied().max().unwrap_or(0);
        let mut local = vec![vec![0.0; count]; count];
        for first in 0..planes + reach {
            // The plane of the first corner is `first - reach`.
            let plane = |corner: usize| (first + self.corners[corner]).checked_sub(reach);
            let inside = |corner: usize| plane(corner).unwrap_or(0).min(planes - 1);
            for row in &mut local {
                row.fill(0.0);
            }
            for part in parts {
                match part {
                    Part::Mass(factor) => add(&mut local, *factor, &self.mass),
                    Part::Stiffness(factor) => add(&mut local, *factor, &self.stiffness),
                    Part::Weighted(factor, v) => {
                        for (weight, values) in &self.points {
                            let at: f64 = (values.iter().enumerate())
                                .map(|(corner, value)| value * v[inside(corner)])
                                .sum();
                            let weight = factor * weight * at * at;
                            for (row, a) in local.iter_mut().zip(values) {
                                for (entry, b) in row.iter_mut().zip(values) {
                                    *entry += weight * a * b;
                                }
                            }
                        }
                    }
                }
            }
            for (c, row) in local.iter().enumerate() {
                let Some(i) = plane(c).filter(|&i| i < planes) else {
                    continue;
                };
                for (d, entry) in row.iter().enumerate() {
                    let factor = if bent { -self.bend[c][d] } else { 1.0 };
                    f(i, inside(d), factor * entry);
                }
            }
        }
    }

    fn matrix(&self, planes: usize, parts: &[Part]) -> Mat<f64> {
        let mut matrix = Mat::zeros(planes, planes);
        self.assemble(planes, parts, false, |i, j, entry| matrix[(i, j)] += entry);
        matrix
    }

    fn apply(&self, parts: &[Part], bent: bool, x: &Col<f64>) -> Col<f64> {
        let mut y = Col::zeros(x.nrows());
        self.assemble(x.nrows(), parts, bent, |i, j, entry| y[i] += entry * x[j]);
        y
    }

    /// The derivative of the left side of the step's equation in `v`.
    fn left<'a>(&self, v: &'a Col<f64>) -> Vec<Part<'a>> {
        let r = self.reaction;
        let mut parts = vec![Part::Mass(1.0), Part::Stiffness(self.scales.mcf_step)];
        if self.discretization == TimeDiscretization::Implicit {
            parts.extend([Part::Mass(-r), Part::Weighted(3.0 * r, v)]);
        }
        parts
    }

    /// The nodal factors before the mass matrix in the derivative of the right side in `u`.
    fn right(&self, u: &Col<f64>) -> Col<f64> {
        let r = self.reaction;
        match self.discretization {
            TimeDiscretization::Implicit => Col::full(u.nrows(), 1.0),
            TimeDiscretization::SemiImplicit => {
                Col::from_fn(u.nrows(), |i| 1.0 + r - 3.0 * r * u[i] * u[i])
            }
        }
    }

    /// `v[u]`.
    fn step(&self, u: &Col<f64>) -> Result<Col<f64>, mean_curvature::Error> {
        let r = self.reaction;
        let planes = u.nrows();
        let solve = |parts: &[Part], right: &Col<f64>| {
            PartialPivLu::new(self.matrix(planes, parts).as_ref()).solve(right)
        };
        if self.discretization == TimeDiscretization::SemiImplicit {
            let g = Col::from_fn(planes, |i| u[i] * (1.0 + r - r * u[i] * u[i]));
            return Ok(solve(
                &self.left(u),
                &self.apply(&[Part::Mass(1.0)], false, &g),
            ));
        }
        let right = self.apply(&[Part::Mass(1.0)], false, u);
        let mut v = u.clone();
        for _ in 0..NEWTON {
            let linear = [Part::Mass(1.0 - r), Part::Stiffness(self.scales.mcf_step)];
            let cubic = [Part::Weighted(r, &v)];
            let residual =
                &right - &self.apply(&linear, false, &v) - &self.apply(&cubic, false, &v);
            let correction = solve(&self.left(&v), &residual);
            v += &correction;
            // Not for what is not a number.
            if correction.iter().all(|c| c.abs() < CONVERGED) {
                return Ok(v);
            }
        }
        let reason = "the implicit step does not converge";
        Err(mean_curvature::Error::uncalibrated(reason))
    }
}

fn add(local: &mut [Vec<f64>], factor: f64, matrix: &[Vec<f64>]) {
    for (row, other) in local.iter_mut().zip(matrix) {
        for (entry, value) in row.iter_mut().zip(other) {
            *entry += factor * value;
        }
    }
}

impl PlanarStep for ElementsOnPlanes {
    fn scales(&self) -> PlanarScales {
        self.scales
    }

    fn linearize(&self, w: &Col<f64>) -> Result<(Col<f64>, Mat<f64>), mean_curvature::Error> {
        let planes = w.nrows();
        let v = self.step(w)?;
        let factors = self.right(w);
        let mut right = self.matrix(planes, &[Part::Mass(1.0)]);
        for j in 0..planes {
            for i in 0..planes {
                right[(i, j)] *= factors[j];
            }
        }
        let left = PartialPivLu::new(self.matrix(planes, &self.left(&v)).as_ref());
        Ok((v, left.solve(&right)))
    }

    /// Both `u` and `v` are functions of the distance; to first order in the curvature the equation of the step becomes
    /// `L p + L_t w' = R_t w'` for the change `p` of `v`, with the bent matrices of both sides.
    fn bending(&self, w: &Col<f64>, slope: &Col<f64>) -> Col<f64> {
        let planes = w.nrows();
        let factors = self.right(w);
        let scaled = Col::from_fn(planes, |i| factors[i] * slope[i]);
        let mass = self.apply(&[Part::Mass(1.0)], true, &scaled);
        let right = mass - self.apply(&self.left(w), true, slope);
        PartialPivLu::new(self.matrix(planes, &self.left(w)).as_ref()).solve(&right)
    }

    fn mass(&self, planes: usize) -> Option<Mat<f64>> {
        Some(self.matrix(planes, &[Part::Mass(1.0)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FiniteElementStep, Tolerances};
    use geometry::shapes::Ball;
    use geometry::{Field, Grid};

    const DISCRETIZATIONS: [TimeDiscretization; 2] = [
        TimeDiscretization::Implicit,
        TimeDiscretization::SemiImplicit,
    ];

    fn grid_step<const D: usize>(
        discretization: TimeDiscretization,
        grid: &Grid<D>,
        eps: f64,
    ) -> FiniteElementStep<D> {
        let step = grid.spacing().powi(2);
        match discretization {
            TimeDiscretization::Implicit => FiniteElementStep::implicit(grid, eps, step),
            TimeDiscretization::SemiImplicit => FiniteElementStep::semi_implicit(grid, eps, step),
        }
        .unwrap()
    }

    /// A wave along `(1, 1)` and one along `(1, 1, 1)`: the step on planes and that of the grid give the same.
    #[test]
    fn planes_do_what_the_grid_does() {
        fn check<const D: usize>(cells: usize) {
            let grid = Grid::<D>::centred(cells, 1.0).unwrap();
            let eps = 2.0 * grid.spacing();
            let wave = |plane: f64| 0.9 * (std::f64::consts::TAU * plane / cells as f64).sin();
            let values = (0..grid.len())
                .map(|i| wave(grid.multi_index(i).iter().sum::<usize>() as f64))
                .collect();
            let u = Field::from_values(grid, values).unwrap();
            // Several periods, so that the ends do not matter in the middle.
            let planes = 9 * cells;
            let w = Col::from_fn(planes, |i| wave(i as f64));
            for discretization in DISCRETIZATIONS {
                let on_planes = ElementsOnPlanes::new(discretization, 2.0, 1.0, &[1; D]);
                let (v, _) = on_planes.linearize(&w).unwrap();
                let step = grid_step(discretization, &grid, eps);
                step.elements().set_tolerances(Tolerances {
                    linear: 1e-13,
                    newton: 1e-13,
                    ..Tolerances::default()
                });
                let expected = step.step(&u).unwrap();
                for (i, value) in expected.values().iter().enumerate() {
                    let plane = grid.multi_index(i).iter().sum::<usize>() % cells + 4 * cells;
                    let error = (value - v[plane]).abs();
                    assert!(error < 1e-7, "{D}D {discretization:?} at {i}: {error:e}");
                }
            }
        }
        check::<2>(16);
        check::<3>(12);
    }

    #[test]
    fn jacobians_are_derivatives() {
        let w = Col::from_fn(60, |i| (0.4 * (i as f64 - 29.3)).tanh());
        let p = Col::from_fn(60, |i| (-0.05 * (i as f64 - 31.0).powi(2)).exp());
        for discretization in DISCRETIZATIONS {
            let step = ElementsOnPlanes::new(discretization, 2.0, 1.0, &[2, 1]);
            let (v, jacobian) = step.linearize(&w).unwrap();
            let product = &jacobian * &p;
            let remainder = |t: f64| {
                let (moved, _) = step.linearize(&(&w + &p * faer::Scale(t))).unwrap();
                (moved - &v - &product * faer::Scale(t)).norm_l2()
            };
            let rate = (remainder(1e-2) / remainder(5e-3)).log2();
            assert!((rate - 2.0).abs() < 0.1, "{discretization:?}: {rate}");
        }
    }

    /// The response to bending against the step of the grid at a large circle and its complement, along an axis and a diagonal.
    #[test]
    fn bending_is_what_large_circles_show() {
        let cells = 256;
        let grid = Grid::<2>::centred(cells, cells as f64).unwrap();
        let eps = 2.0;
        let radius = 90.0;
        let disc = geometry::phase_field(grid, &Ball::new([0.0, 0.0], radius).unwrap(), eps);
        let disc = disc.unwrap();
        for discretization in DISCRETIZATIONS {
            let moved = grid_step(discretization, &grid, eps).step(&disc).unwrap();
            for normal in [[1_isize, 0], [1, 1]] {
                let planes = ElementsOnPlanes::new(discretization, eps, 1.0, &normal);
                // Nodes of the grid along the normal, from the inside out, as planes of distance growing outwards.
                let spacing = planes.scales.spacing;
                let skip = if normal == [1, 1] { 2 } else { 1 };
                let count = 61;
                let start = (radius / (skip as f64 * spacing)).round() as usize - 15;
                let node = |k: usize| {
                    let along = cells / 2 + start + k / skip;
                    let across = if normal == [1, 1] { along } else { cells / 2 };
                    along * cells + across
                };
                // The profile on planes is that of the disc, flat.
                let distance = |k: usize| (start * skip + k) as f64 * spacing - radius;
                let w = Col::from_fn(count, |k| geometry::optimal_profile(distance(k), eps));
                let slope = Col::from_fn(count, |k| -0.75 / eps * (1.0 - w[k] * w[k]));
                let (flat, _) = planes.linearize(&w).unwrap();
                // In terms of the distance inwards the slope is positive: the sign of both cancels.
                let change = planes.bending(&w, &(&slope * faer::Scale(-1.0)));
                for k in (10 * skip..20 * skip).step_by(skip) {
                    let found = (moved.values()[node(k)] - flat[k]) * radius;
                    let scale = 0.75 / eps;
                    assert!(
                        (found - change[k]).abs() < 0.05 * scale,
                        "{discretization:?} {normal:?} {k}: {found} {}",
                        change[k]
                    );
                }
            }
        }
    }
}
