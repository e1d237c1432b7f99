//! The flat interface of a step: a dense problem in one dimension.

use faer::linalg::solvers::{PartialPivLu, Solve};
use faer::{Col, Mat, MatRef};
use geometry::optimal_profile;

use crate::Error;

/// The scales of a step on planes, in units of the grid spacing `h`.
#[derive(Clone, Copy, Debug)]
pub struct PlanarScales {
    /// Interface width `eps / h`.
    pub eps: f64,
    /// Time step `tautilde / h^2`.
    pub mcf_step: f64,
    /// Distance of neighbouring planes; `1 / |a|` for the integer normal `a`.
    pub spacing: f64,
}

/// A step of mean curvature flow restricted to functions that are constant on parallel planes of grid nodes.
///
/// Lengths are in units of the grid spacing `h`, times in `h^2`. Beyond the first and the last plane the function continues as
/// a constant.
pub trait PlanarStep: Sync {
    /// The lengths and the time that it depends on.
    fn scales(&self) -> PlanarScales;

    /// `v[w]` and the matrix of its derivative.
    ///
    /// # Errors
    /// If the step's own solver fails.
    fn linearize(&self, w: &Col<f64>) -> Result<(Col<f64>, Mat<f64>), Error>;

    /// `A = d/dkappa (v[u] - u)` on the normal line of a bent interface `u(x) = w(sdist(x))`, where `kappa` is the sum of its
    /// principal curvatures, all equal, positive if the phase `u = 1` is convex. `slope` is `w'` per unit `h`.
    fn bending(&self, w: &Col<f64>, slope: &Col<f64>) -> Col<f64>;

    /// The matrix `M` of the inner product, for one that is not the identity; its rows sum to 1.
    fn mass(&self, _planes: usize) -> Option<Mat<f64>> {
        None
    }
}

/// The flat interface of a step at one position, and the factors of the scheme's energy that follow from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarInterface {
    /// `c = <A, psi>^2 / (|psi|^2 tautilde^2 |q'|^2)`.
    pub energy: f64,
    /// `m = |w'|^2 / |q'|^2`.
    pub metric: f64,
    /// `eps kappa_0 = -eps <v[w] - w, psi> / <A, psi>`.
    pub spontaneous_curvature: f64,
    /// `-<A, w'> / (tautilde |w'|^2)`.
    pub displacement: f64,
    /// `<psi, w'>^2 / (|psi|^2 |w'|^2)`.
    pub alignment: f64,
    /// The eigenvalue of `psi`.
    pub eigenvalue: f64,
}

/// Half the thickness of the layer of planes in units of `eps`; the profile's tails are `2 e^-18` there.
const HALF_WIDTH: f64 = 12.0;
/// Limit of Newton's method for the flat interface.
const NEWTON: usize = 40;
/// Last correction of a converged flat interface.
const CONVERGED: f64 = 1e-11;
/// Shift of the inverse iteration: off the eigenvalue 1, but nearer to it than to any other.
const SHIFT: f64 = 1.003;
/// Steps of the inverse iteration. The next eigenvalue is below 0.9, so that each gains more than an order of magnitude.
const INVERSE: usize = 24;
/// Largest residual of the eigenvector, relative to it.
const RESIDUAL: f64 = 1e-8;
/// Largest number of planes of a dense problem.
const MOST_PLANES: f64 = 8192.0;
/// Largest distance of the eigenvalue of translations from 1.
pub(crate) const OFF: f64 = 1e-2;

/// Solves for the flat interface at `position` (in plane distances, from a plane).
///
/// # Errors
/// [`Error::Calibration`].
pub fn solve(step: &impl PlanarStep, position: f64) -> Result<PlanarInterface, Error> {
    let PlanarScales {
        eps,
        mcf_step: tautilde,
        spacing,
    } = step.scales();
    let thickness = 2.0 * HALF_WIDTH * eps / spacing;
    if thickness.is_nan() || thickness > MOST_PLANES {
        return Err(Error::uncalibrated(
            "the interface is too wide for the grid spacing",
        ));
    }
    let (start, optimal_slope) = optimal_interface(step, position);
    let planes = start.nrows();
    let optimal_square = dot(&optimal_slope, &optimal_slope);

    let w = flat_interface(step, &start, &optimal_slope)?;
    let (value, jacobian) = step.linearize(&w)?;
    let shifted = |matrix: MatRef<f64>| {
        let shift = |i, j| if i == j { SHIFT } else { 0.0 };
        let shifted = Mat::from_fn(planes, planes, |i, j| matrix[(i, j)] - shift(i, j));
        PartialPivLu::new(shifted.as_ref())
    };
    let (left, right) = (shifted(jacobian.transpose()), shifted(jacobian.as_ref()));
    let mut psi = optimal_slope.clone();
    let mut slope = optimal_slope.clone();
    for _ in 0..INVERSE {
        psi = normalized(left.solve(&psi));
        slope = normalized(right.solve(&slope));
    }
    let image = jacobian.transpose() * &psi;
    let eigenvalue = dot(&psi, &image);
    let residual = eigenvector_residual(&image, &psi, eigenvalue);
    // Written so that NaN is refused.
    if !((eigenvalue - 1.0).abs() <= OFF && residual <= RESIDUAL) {
        return Err(Error::Calibration {
            reason: "translations of the flat interface are no eigenvector",
            eigenvalue,
        });
    }
    // The slope integrates to the jump between the phases.
    let jump = w[planes - 1] - w[0];
    let slope = &slope * faer::Scale(jump / (slope.sum() * spacing));

    let mass = step.mass(planes);
    let (mass_of_slope, dual_psi) = match &mass {
        Some(mass) => (mass * &slope, PartialPivLu::new(mass.as_ref()).solve(&psi)),
        None => (slope.clone(), psi.clone()),
    };
    let bending = step.bending(&w, &slope);
    let modes = Modes {
        optimal_square,
        slope,
        mass_of_slope,
        psi,
        dual_psi,
        eigenvalue,
        residual: &value - &w,
        bending,
    };
    modes.interface(eps, tautilde)
}

/// What the factors follow from, on the planes of one flat interface.
pub(crate) struct Modes {
    /// `|q'|^2`.
    pub(crate) optimal_square: f64,
    /// The right null vector `w'`, which integrates to the jump between the phases, and `M w'`.
    pub(crate) slope: Col<f64>,
    pub(crate) mass_of_slope: Col<f64>,
    /// The left null vector, and `M^-1 psi`.
    pub(crate) psi: Col<f64>,
    pub(crate) dual_psi: Col<f64>,
    /// That of `psi`.
    pub(crate) eigenvalue: f64,
    /// `v[w] - w`.
    pub(crate) residual: Col<f64>,
    /// `A`.
    pub(crate) bending: Col<f64>,
}

impl Modes {
    /// The factors for an interface of this width in a step of this size.
    ///
    /// # Errors
    /// [`Error::Calibration`] if they are not positive.
    pub(crate) fn interface(&self, eps: f64, tautilde: f64) -> Result<PlanarInterface, Error> {
        let (psi, slope, eigenvalue) = (&self.psi, &self.slope, self.eigenvalue);
        let response = dot(&self.bending, psi);
        let (psi_square, slope_square) =
            (dot(psi, &self.dual_psi), dot(slope, &self.mass_of_slope));
        let energy = response * response / (psi_square * tautilde * tautilde * self.optimal_square);
        let metric = slope_square / self.optimal_square;
        if !(energy.is_finite() && energy > 0.0 && metric.is_finite() && metric > 0.0) {
            return Err(Error::Calibration {
                reason: "the step does not see curvature",
                eigenvalue,
            });
        }
        Ok(PlanarInterface {
            energy,
            metric,
            spontaneous_curvature: -eps * dot(&self.residual, psi) / response,
            displacement: -dot(&self.bending, &self.mass_of_slope) / (tautilde * slope_square),
            alignment: dot(psi, slope).powi(2) / (psi_square * slope_square),
            eigenvalue,
        })
    }
}

/// Real and imaginary parts of the eigenvalues of `J` at the flat interface, largest real part first.
///
/// # Errors
/// [`Error::Calibration`] if there is no such interface, or the eigenvalues do not converge.
pub(crate) fn spectrum(step: &impl PlanarStep, position: f64) -> Result<Vec<[f64; 2]>, Error> {
    let (start, optimal_slope) = optimal_interface(step, position);
    let w = flat_interface(step, &start, &optimal_slope)?;
    let (_, jacobian) = step.linearize(&w)?;
    let failed = |_| Error::uncalibrated("the eigenvalues of the flat interface do not converge");
    let values = jacobian.eigenvalues().map_err(failed)?;
    let mut values: Vec<[f64; 2]> = values.iter().map(|z| [z.re, z.im]).collect();
    values.sort_by(|a, b| b[0].total_cmp(&a[0]));
    Ok(values)
}

/// `q` and `q'` on the planes of the layer.
pub fn optimal_interface(step: &impl PlanarStep, position: f64) -> (Col<f64>, Col<f64>) {
    let PlanarScales { eps, spacing, .. } = step.scales();
    let half = (HALF_WIDTH * eps / spacing).ceil();
    let planes = 2 * half as usize + 1;
    let x = |i: usize| (i as f64 - half + position) * spacing;
    let start = Col::from_fn(planes, |i| optimal_profile(-x(i), eps));
    let slope = Col::from_fn(planes, |i| 0.75 / eps * (1.0 - start[i] * start[i]));
    (start, slope)
}

/// The profile `w` with `v[w] - w = s q'` at the position of `start`, for some speed `s`: zero unless the step moves flat
/// interfaces, up to what the grid holds on to.
///
/// # Errors
/// [`Error::Calibration`] if Newton's method finds none.
pub fn flat_interface(
    step: &impl PlanarStep,
    start: &Col<f64>,
    optimal_slope: &Col<f64>,
) -> Result<Col<f64>, Error> {
    let planes = start.nrows();
    let (mut w, mut speed) = (start.clone(), 0.0);
    for _ in 0..NEWTON {
        let (value, jacobian) = step.linearize(&w)?;
        let matrix = Mat::from_fn(planes + 1, planes + 1, |i, j| {
            match (i < planes, j < planes) {
                (true, true) => jacobian[(i, j)] - if i == j { 1.0 } else { 0.0 },
                (true, false) => -optimal_slope[i],
                (false, true) => optimal_slope[j],
                (false, false) => 0.0,
            }
        });
        let residual = Col::from_fn(planes + 1, |i| {
            if i < planes {
                w[i] + speed * optimal_slope[i] - value[i]
            } else {
                dot(optimal_slope, &(start - &w))
            }
        });
        let correction = PartialPivLu::new(matrix.as_ref()).solve(&residual);
        for i in 0..planes {
            w[i] += correction[i];
        }
        speed += correction[planes];
        // Not for what is not a number.
        if correction.iter().take(planes).all(|c| c.abs() < CONVERGED) {
            return Ok(w);
        }
    }
    Err(Error::uncalibrated("no flat interface is at rest"))
}

pub(crate) fn dot(a: &Col<f64>, b: &Col<f64>) -> f64 {
    a.iter().zip(b.iter()).map(|(a, b)| a * b).sum()
}

/// `|y - lambda x|` for a normalized `x`.
fn eigenvector_residual(y: &Col<f64>, x: &Col<f64>, lambda: f64) -> f64 {
    let rest = y - x * faer::Scale(lambda);
    dot(&rest, &rest).sqrt()
}

fn normalized(x: Col<f64>) -> Col<f64> {
    let norm = dot(&x, &x).sqrt();
    x * faer::Scale(1.0 / norm)
}
