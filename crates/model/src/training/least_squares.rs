//! The accurate recipe: the heat kernel, and an odd activation by linear least squares.
//!
//! What the calibrated Willmore scheme asks of `V[u] = F(K * u)` is not what the paper's loss measures. It needs every
//! curvature at the same relative accuracy, both phases treated alike, and an `F` without wiggles, since `F''` is in every
//! Hessian. So here
//!
//! - `K` is the heat kernel of variance `2 tautilde` per axis (a wider Gaussian where the kernel's width cuts it off), for which a single step is exact to first order in the
//!   curvature once `F` keeps the flat interface (`docs/calibration.md`);
//! - `F` is an odd polynomial, found by linear least squares: no start, no local minima. Each radius counts relative to how
//!   far its sphere moves, and flat interfaces in many directions must stay where they are;
//! - a [distillation](Distillation) fits a perceptron of the paper's form to the polynomial, with its first and second derivatives.

use chacha20::ChaCha8Rng;
use faer::linalg::solvers::SolveLstsq;
use faer::{Col, Mat};
use geometry::optimal_profile;
use operators::ComputeDevice;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::distillation::{Distillation, distill_odd};
use super::levenberg_marquardt::heat_kernel;
use super::spheres::{BAND, direction, norm};
use super::{Recipe, SphereData, TrainingObserver};
use crate::ratios::offsets;
use crate::{Error, Mlp, Ratios};

/// Settings of the accurate recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeastSquaresParams {
    /// Number of radii, evenly spread in their logarithm.
    pub radii: usize,
    /// Smallest and largest radius in units of `eps`. A sphere of the smallest must survive the step.
    pub range: [f64; 2],
    /// Strata across the interface band, per radius.
    pub shells: usize,
    /// Number of random points per stratum.
    pub directions: usize,
    /// Number of normals of flat interfaces.
    pub normals: usize,
    /// Weight of the flat interfaces against the spheres, as a factor of the residual.
    pub flat: f64,
    /// Number of odd Chebyshev polynomials; the highest has degree `2 terms - 1`.
    pub terms: usize,
    /// Settings of the perceptron's fit.
    pub distillation: Distillation,
}

impl Default for LeastSquaresParams {
    fn default() -> Self {
        Self {
            radii: 24,
            range: [3.2, 40.0],
            shells: 48,
            directions: 3,
            normals: 24,
            flat: 1e3,
            terms: 8,
            distillation: Distillation::default(),
        }
    }
}

/// An odd function on `[-1, 1]`, continued by its second-order Taylor polynomial.
#[derive(Clone, Debug, PartialEq)]
pub struct OddPolynomial {
    /// Of the Chebyshev polynomials of degree 1, 3, 5, ...
    coefficients: Vec<f64>,
}

impl OddPolynomial {
    /// `[F, F', F'']` at `z`.
    pub fn jet(&self, z: f64) -> [f64; 3] {
        let x = z.clamp(-1.0, 1.0);
        let mut sum = [0.0; 3];
        for (coefficient, jet) in self.coefficients.iter().zip(odd_chebyshev(x)) {
            for (sum, t) in sum.iter_mut().zip(jet) {
                *sum += coefficient * t;
            }
        }
        let beyond = z - x;
        [
            sum[0] + beyond * (sum[1] + 0.5 * beyond * sum[2]),
            sum[1] + beyond * sum[2],
            sum[2],
        ]
    }
}

/// The Chebyshev polynomials of degree 1, 3, 5, ... at `x`, with their first two derivatives.
fn odd_chebyshev(x: f64) -> impl Iterator<Item = [f64; 3]> {
    // T_(n+1) = 2 x T_n - T_(n-1), differentiated twice.
    let next = move |[before, now]: [[f64; 3]; 2]| {
        let next = [
            2.0 * x * now[0] - before[0],
            2.0 * (now[0] + x * now[1]) - before[1],
            2.0 * (2.0 * now[1] + x * now[2]) - before[2],
        ];
        [now, next]
    };
    let first = [[1.0, 0.0, 0.0], [x, 1.0, 0.0]];
    std::iter::successors(Some(first), move |pair| Some(next(next(*pair)))).map(|[_, now]| now)
}

/// Number of samples across a flat interface.
const ACROSS: usize = 64;
/// Weight of `F(1) = 1`.
const PHASE: f64 = 1e3;

/// One equation `weight (F(K * u) - target) = 0`.
struct Row {
    smoothed: f64,
    target: f64,
    weight: f64,
}

/// `K * u` at a point, for a function `u` of the point.
fn smoothed(kernel: &[(Vec<f64>, f64)], x: &[f64], u: impl Fn(&[f64]) -> f64) -> f64 {
    let mut moved = vec![0.0; x.len()];
    kernel
        .iter()
        .map(|(offset, weight)| {
            for ((moved, x), b) in moved.iter_mut().zip(x).zip(offset) {
                *moved = x + b;
            }
            weight * u(&moved)
        })
        .sum()
}

/// Equations for a shrinking sphere; their weights make the identity map score 1.
fn sphere_rows(
    data: &SphereData,
    params: &LeastSquaresParams,
    kernel: &[(Vec<f64>, f64)],
    radius: f64,
    points: &[(f64, Vec<f64>)],
) -> Vec<Row> {
    let eps = data.eps();
    let shrunk = data.shrunk(radius);
    let mut rows: Vec<Row> = points
        .iter()
        .map(|(weight, x)| Row {
            smoothed: smoothed(kernel, x, |y| optimal_profile(norm(y) - radius, eps)),
            target: optimal_profile(norm(x) - shrunk, eps),
            weight: *weight,
        })
        .collect();
    let identity: f64 = (rows.iter().zip(points))
        .map(|(row, (_, x))| {
            let motion = row.target - optimal_profile(norm(x) - radius, eps);
            row.weight * motion * motion
        })
        .sum();
    for row in &mut rows {
        row.weight = (row.weight / (identity * params.radii as f64)).sqrt();
    }
    rows
}

/// Equations for flat interfaces, which stay.
fn flat_rows(
    data: &SphereData,
    params: &LeastSquaresParams,
    kernel: &[(Vec<f64>, f64)],
    normal: &[f64],
    shift: f64,
) -> Vec<Row> {
    let eps = data.eps();
    let thickness = 2.0 * BAND * eps / ACROSS as f64;
    let weight = params.flat * (thickness / params.normals as f64).sqrt();
    (0..ACROSS)
        .map(|i| {
            let distance = (i as f64 + shift) * thickness - BAND * eps;
            let x: Vec<f64> = normal.iter().map(|n| n * distance).collect();
            let along = |y: &[f64]| y.iter().zip(normal).map(|(y, n)| y * n).sum::<f64>();
            Row {
                smoothed: smoothed(kernel, &x, |y| optimal_profile(along(y), eps)),
                target: optimal_profile(distance, eps),
                weight,
            }
        })
        .collect()
}

/// The activation for a given kernel, by linear least squares.
///
/// # Errors
/// [`Error::Training`] for radii that vanish within the step, or settings that determine nothing.
pub fn fit(
    data: &SphereData,
    params: &LeastSquaresParams,
    kernel: &[f64],
    seed: u64,
) -> Result<OddPolynomial, Error> {
    data.ratios.validate()?;
    let (dimension, eps) = (data.ratios.dimension, data.eps());
    let [low, high] = params.range.map(|r| r * eps);
    let enough = params.radii > 1 && params.terms > 0 && params.shells * params.directions > 1;
    if !(enough && params.normals > 0 && low > 0.0 && low < high && data.shrunk(low) > 0.0) {
        return Err(Error::Training(format!(
            "{} radii from {low} to {high} and {} normals determine no activation of {} terms",
            params.radii, params.normals, params.terms
        )));
    }
    let kernel = with_offsets(data, kernel);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let spheres: Vec<(f64, Vec<(f64, Vec<f64>)>)> = (0..params.radii)
        .map(|i| {
            let part = i as f64 / (params.radii - 1) as f64;
            let radius = low * (high / low).powf(part);
            let nearest = (radius - BAND * eps).max(0.0);
            let thickness = (radius + BAND * eps - nearest) / params.shells as f64;
            let points = (0..params.shells * params.directions)
                .map(|k| {
                    let shell = (k / params.directions) as f64 + rng.random_range(0.0..1.0);
                    let rho = nearest + thickness * shell;
                    let weight = rho.powi(dimension as i32 - 1);
                    (weight, direction(dimension, rho, &mut rng))
                })
                .collect();
            (radius, points)
        })
        .collect();
    let planes: Vec<(Vec<f64>, f64)> = (0..params.normals)
        .map(|_| {
            (
                direction(dimension, 1.0, &mut rng),
                rng.random_range(0.0..1.0),
            )
        })
        .collect();
    let mut rows: Vec<Row> = spheres
        .par_iter()
        .flat_map_iter(|(radius, points)| sphere_rows(data, params, &kernel, *radius, points))
        .collect();
    let flat: Vec<Row> = planes
        .par_iter()
        .flat_map_iter(|(normal, shift)| flat_rows(data, params, &kernel, normal, *shift))
        .collect();
    rows.extend(flat);
    rows.push(Row {
        smoothed: 1.0,
        target: 1.0,
        weight: PHASE,
    });
    let mut matrix = Mat::zeros(rows.len(), params.terms);
    for (i, row) in rows.iter().enumerate() {
        let basis = odd_chebyshev(row.smoothed).take(params.terms);
        for (j, [value, ..]) in basis.enumerate() {
            matrix[(i, j)] = row.weight * value;
        }
    }
    let right = Col::from_fn(rows.len(), |i| rows[i].weight * rows[i].target);
    let solution = matrix.col_piv_qr().solve_lstsq(&right);
    let coefficients: Vec<f64> = solution.iter().copied().collect();
    if coefficients.iter().any(|c| !c.is_finite()) {
        return Err(Error::Training(
            "the least-squares problem of the activation is singular".to_owned(),
        ));
    }
    Ok(OddPolynomial { coefficients })
}

/// The kernel's entries with their offsets as lengths.
fn with_offsets(data: &SphereData, kernel: &[f64]) -> Vec<(Vec<f64>, f64)> {
    let (ratios, h) = (data.ratios, data.spacing());
    (offsets(ratios.dimension, ratios.width).zip(kernel))
        // The fastest axis first.
        .map(|(offset, &weight)| (offset.iter().rev().map(|&b| b as f64 * h).collect(), weight))
        .collect()
}

/// The heat kernel; where the given width cuts off so much of it that its variance falls short by more than one percent, a wider
/// Gaussian that has the variance `2 tautilde` per axis after the cut. The variance is what moves nearly flat interfaces.
///
/// # Errors
/// [`Error::Training`] if the kernel is too narrow for that.
pub fn kernel_of_full_variance(data: &SphereData) -> Result<Vec<f64>, Error> {
    const SHORT: f64 = 0.01;
    let wanted = 2.0 * data.ratios.step_over_h2;
    let kernel_for = |step_over_h2: f64| {
        heat_kernel(Ratios {
            step_over_h2,
            ..data.ratios
        })
    };
    let variance = |kernel: &[f64]| -> f64 {
        let per_length = 1.0 / (data.spacing() * data.spacing() * data.ratios.dimension as f64);
        (with_offsets(data, kernel).iter())
            .map(|(offset, weight)| weight * offset.iter().map(|b| b * b).sum::<f64>())
            .sum::<f64>()
            * per_length
    };
    let kernel = kernel_for(data.ratios.step_over_h2);
    let holds = |kernel: &[f64]| variance(kernel) > (1.0 - SHORT) * wanted;
    if holds(&kernel) {
        return Ok(kernel);
    }
    let (mut low, mut high) = (data.ratios.step_over_h2, 4.0 * data.ratios.step_over_h2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if variance(&kernel_for(middle)) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    let widest = kernel_for(0.5 * (low + high));
    if !holds(&widest) {
        return Err(Error::Training(format!(
            "a kernel of width {} is too narrow for steps of {} h^2: its variance stays at {:.3} h^2 where {wanted} h^2 is wanted; choose a \
             wider one or shorter steps",
            data.ratios.width,
            data.ratios.step_over_h2,
            variance(&widest)
        )));
    }
    Ok(widest)
}

impl LeastSquaresParams {
    /// The settings of the shipped networks, or of a smoke test of seconds.
    pub fn new(quick: bool) -> Self {
        let mut params = Self::default();
        if quick {
            params.distillation = Distillation {
                starts: 1,
                start_iterations: 10,
                iterations: 10,
            };
        }
        params
    }
}

impl Recipe for LeastSquaresParams {
    type State = ();

    const GOES_ON: bool = false;

    /// The heat kernel, [`fit`], and a perceptron of the paper's layers, made odd (so that its hidden layers are twice as wide).
    fn train(
        &self,
        data: &SphereData,
        seed: u64,
        _: Option<()>,
        device: &ComputeDevice,
        observer: &mut TrainingObserver<'_, ()>,
    ) -> Result<(Vec<f64>, Mlp), Error> {
        let kernel = kernel_of_full_variance(data)?;
        let polynomial = fit(data, self, &kernel, seed)?;
        let target = |z: f64| polynomial.jet(z)[0];
        let activation = distill_odd(&target, &self.distillation, seed, device, observer)?;
        Ok((kernel, activation))
    }

    fn describe(&self, _: &SphereData, _: usize) -> String {
        format!(
            "least squares, heat kernel, {} radii of {} to {} eps, {} x {} points each, {} flat interfaces, odd polynomial \
             of degree {}",
            self.radii,
            self.range[0],
            self.range[1],
            self.shells,
            self.directions,
            self.normals,
            2 * self.terms - 1
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::tests::ratios;

    fn data() -> SphereData {
        SphereData::new(ratios(2, 17), 128).unwrap()
    }

    #[test]
    fn jets_of_polynomials_are_their_derivatives() {
        let polynomial = OddPolynomial {
            coefficients: vec![0.9, -0.2, 0.05, 0.01],
        };
        for z in [-0.8, 0.0, 0.35, 0.99] {
            let h = 1e-4;
            let [minus, here, plus] = [z - h, z, z + h].map(|z| polynomial.jet(z));
            assert!(((plus[0] - minus[0]) / (2.0 * h) - here[1]).abs() < 1e-6);
            assert!(((plus[1] - minus[1]) / (2.0 * h) - here[2]).abs() < 1e-5);
            assert!((polynomial.jet(-z)[0] + here[0]).abs() < 1e-15);
        }
        // cos 3 arccos 0.5 = -1
        let third = OddPolynomial {
            coefficients: vec![0.0, 1.0],
        };
        assert!((third.jet(0.5)[0] + 1.0).abs() < 1e-15);
    }

    /// The polynomial moves spheres of radii that are not those of the fit, and points that are not, as far as it should.
    #[test]
    fn displacements_are_exact_up_to_the_square_of_the_curvature() {
        let data = data();
        let params = LeastSquaresParams::default();
        let kernel = heat_kernel(data.ratios);
        let polynomial = fit(&data, &params, &kernel, 7).unwrap();
        let offsets = with_offsets(&data, &kernel);
        let mut rng = ChaCha8Rng::seed_from_u64(99);
        for (radius, bound) in [(0.06, 1.5e-2), (0.17, 4e-3), (0.5, 2e-3)] {
            let (mut along, mut square) = (0.0, 0.0);
            for k in 0..400 {
                let rho = radius + (f64::from(k) / 200.0 - 1.0) * 4.0 * data.eps();
                if rho < 0.0 {
                    continue;
                }
                let x = direction(2, rho, &mut rng);
                let profile = |r: f64| optimal_profile(rho - r, data.eps());
                let v = polynomial.jet(smoothed(&offsets, &x, |y| {
                    optimal_profile(norm(y) - radius, data.eps())
                }))[0];
                let exact = profile(data.shrunk(radius)) - profile(radius);
                along += rho * (v - profile(radius)) * exact;
                square += rho * exact * exact;
            }
            let error = along / square - 1.0;
            assert!(error.abs() < bound, "radius {radius}: {error}");
        }
    }

    #[test]
    fn narrow_kernels_keep_the_variance() {
        let wide = data();
        assert_eq!(
            kernel_of_full_variance(&wide).unwrap(),
            heat_kernel(wide.ratios)
        );
        let ratios = Ratios {
            eps_over_h: 4.0,
            step_over_h2: 4.0,
            ..wide.ratios
        };
        let narrow = SphereData::new(ratios, 256).unwrap();
        let kernel = kernel_of_full_variance(&narrow).unwrap();
        let h = narrow.spacing();
        let variance: f64 = (with_offsets(&narrow, &kernel).iter())
            .map(|(b, k)| k * b[0] * b[0] / (h * h))
            .sum();
        assert!((variance - 8.0).abs() < 1e-9, "{variance}");
        assert!((kernel.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn settings_that_determine_nothing_are_refused() {
        let data = data();
        let kernel = heat_kernel(data.ratios);
        for params in [
            LeastSquaresParams {
                range: [0.1, 30.0],
                ..LeastSquaresParams::default()
            },
            LeastSquaresParams {
                terms: 0,
                ..LeastSquaresParams::default()
            },
        ] {
            assert!(matches!(
                fit(&data, &params, &kernel, 1),
                Err(Error::Training(_))
            ));
        }
    }

    #[test]
    fn perceptrons_follow_the_polynomial_to_the_second_derivative() {
        let device = ComputeDevice::default_compiled().unwrap();
        let data = data();
        // Fewer iterations than by default, which reach 5e-5.
        let params = LeastSquaresParams {
            distillation: Distillation {
                starts: 4,
                iterations: 60,
                ..Distillation::default()
            },
            ..LeastSquaresParams::default()
        };
        let mut observer = |_: &_, (): &()| Ok(true);
        let (kernel, mlp) = (params.train(&data, 1, None, &device, &mut observer)).unwrap();
        let polynomial = fit(&data, &params, &kernel, 1).unwrap();
        let mut worst = [0.0_f64; 3];
        for i in -100..=100 {
            let z = f64::from(i) / 100.0;
            let (found, wanted) = (mlp.jet(z), polynomial.jet(z));
            for (k, worst) in worst.iter_mut().enumerate() {
                *worst = worst.max((found[k] - wanted[k]).abs());
            }
        }
        assert!(
            worst[0] < 1e-4 && worst[1] < 2e-3 && worst[2] < 0.1,
            "{worst:?}"
        );
    }
}
