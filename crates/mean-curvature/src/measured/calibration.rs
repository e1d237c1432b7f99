//! The calibration of a step from its flat interfaces on a periodic box.

use std::ops::Range;
use std::sync::Arc;

use faer::linalg::solvers::{PartialPivLu, Solve};
use faer::{Col, Mat};
use geometry::{Grid, optimal_profile};
use operators::ComputeDevice;

use super::derivative::Derivative;
use super::fixed_point::fixed_point;
use super::planes::{Planes, Waves, length};
use crate::calibration::{OfNormal, POSITIONS, mean};
use crate::planar::{Modes, OFF, PlanarInterface, dot};
use crate::{Calibration, Error, MeanCurvatureStep, StepScales, normals};

/// Least distance of the two interfaces in the box, in units of `eps`: what one sees of the other is `e^-12`.
const APART: f64 = 8.0;
/// Distance in the boxes that are chosen here.
const FAR_APART: f64 = 10.0;
/// Residual of a fixed point, in double precision, and how many roundings it may be otherwise.
const CONVERGED: f64 = 1e-9;
const ROUNDINGS: f64 = 64.0;

/// Where the derivative has no eigenvalue near 1.
const LOST: &str = "translations of the flat interface are no eigenvector";

/// What a step makes of the Willmore energy, [measured](super).
///
/// It is measured on the box of the `scales`, or where the step can be put [on](MeanCurvatureStep::on) smaller ones, there. Normals whose interfaces
/// do not fit the box are left out: all fit 51 `eps` in the plane and 28 `eps` in space.
///
/// # Errors
/// [`Error::Calibration`] if the step has no flat interface at rest, [`Error::BoxTooSmall`], or what the step raises.
pub fn calibrate<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    scales: &StepScales,
    device: &ComputeDevice,
) -> Result<Calibration, Error> {
    let eps = scales.eps / scales.spacing;
    let needed = |normal: &[isize], apart: f64| (2.0 * apart * eps * length(normal)).ceil();
    let mut found = Vec::new();
    for (normal, weight) in normals(D) {
        let smaller = smaller_box(step, scales, needed(normal, FAR_APART))?;
        let (step, cells) = match &smaller {
            Some(SmallerBox { step, cells }) => (&**step, *cells),
            None => (step, scales.cells),
        };
        // NaN does not.
        let fits = needed(normal, APART) <= cells as f64;
        if !fits {
            continue;
        }
        let mut bench = Bench {
            derivative: Derivative::new(step, [cells; D], 1.0, device)?,
            eps,
            mcf_step: scales.mcf_step / scales.spacing.powi(2),
            tolerance: CONVERGED.max(ROUNDINGS * device.epsilon()),
        };
        found.push(OfNormal {
            interfaces: bench.interfaces(&Planes::new(normal, cells))?,
            weight: *weight,
        });
    }
    if found.is_empty() {
        return Err(Error::BoxTooSmall {
            cells: scales.cells,
            eps,
            least: needed(&[1], APART) as usize,
        });
    }
    Ok(mean(&found))
}

/// A step on a box of its spacing that is large enough.
struct SmallerBox<const D: usize> {
    step: Arc<dyn MeanCurvatureStep<D>>,
    cells: usize,
}

/// The step on a box of `ample` cells, if that is less than its own and it can be put there.
fn smaller_box<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    scales: &StepScales,
    ample: f64,
) -> Result<Option<SmallerBox<D>>, Error> {
    let is_smaller = ample < scales.cells as f64;
    if !is_smaller {
        return Ok(None);
    }
    let cells = ample as usize;
    let grid = Grid::<D>::new(cells, cells as f64 * scales.spacing)?;
    let step = step.on(&grid.into()).ok();
    Ok(step.map(|step| SmallerBox { step, cells }))
}

/// A step on a box, in units of the spacing.
struct Bench<'a, const D: usize> {
    derivative: Derivative<'a, D>,
    eps: f64,
    mcf_step: f64,
    tolerance: f64,
}

/// `q` and `q'` of two interfaces that face each other, the phase `u = 1` between them; a half of the planes belongs to each.
///
/// Slopes are those along the planes, of both signs: what one interface leaves at the other then cancels half-way, as it does in translations.
struct Pair {
    profile: Col<f64>,
    slope: Col<f64>,
    /// The first plane that belongs to the second interface.
    middle: usize,
}

impl Pair {
    /// Interfaces at a quarter and at three quarters of the box, moved by fractions of the distance of planes.
    fn new(planes: &Planes, eps: f64, positions: [f64; 2]) -> Self {
        let (count, spacing) = (planes.count(), planes.spacing());
        let rising = (count / 4) as f64 + positions[0];
        let falling = (3 * count / 4) as f64 + positions[1];
        let profile = Col::from_fn(count, |m| {
            let inside = (m as f64 - rising).min(falling - m as f64);
            optimal_profile(-inside * spacing, eps)
        });
        let middle = count.div_ceil(2);
        let slope = Col::from_fn(count, |m| {
            let sign = if m < middle { 1.0 } else { -1.0 };
            sign * 0.75 / eps * (1.0 - profile[m].powi(2))
        });
        Self {
            profile,
            slope,
            middle,
        }
    }

    /// The planes that belong to each interface.
    fn halves(&self) -> [Range<usize>; 2] {
        [0..self.middle, self.middle..self.slope.nrows()]
    }

    /// `<q', x>` of each interface.
    fn products(&self, x: &Col<f64>) -> [f64; 2] {
        self.halves()
            .map(|half| half.map(|m| self.slope[m] * x[m]).sum())
    }

    /// `x` times a factor for each interface.
    fn scaled(&self, mut x: Col<f64>, factors: [f64; 2]) -> Col<f64> {
        for (half, factor) in self.halves().into_iter().zip(factors) {
            half.for_each(|m| x[m] *= factor);
        }
        x
    }

    /// `x` with the products of `q'`.
    fn normalized(&self, x: Col<f64>) -> Col<f64> {
        let (wanted, found) = (self.products(&self.slope), self.products(&x));
        let factors = [0, 1].map(|i| wanted[i] / found[i]);
        self.scaled(x, factors)
    }
}

impl<const D: usize> Bench<'_, D> {
    /// The interfaces with one normal at all positions, two at a time. Where one rises at a position, the other falls: its position seen in its
    /// own direction is one less that, so that every position comes once if the step is symmetric.
    fn interfaces(&mut self, planes: &Planes) -> Result<Vec<PlanarInterface>, Error> {
        let [a, b, _, _] = POSITIONS;
        let mut interfaces = Vec::new();
        for positions in [[a, b], [b, a]] {
            let pair = Pair::new(planes, self.eps, positions);
            interfaces.extend(self.pair(planes, &pair)?);
        }
        Ok(interfaces)
    }

    fn pair(&mut self, planes: &Planes, pair: &Pair) -> Result<[PlanarInterface; 2], Error> {
        let w = self.at_rest(planes, pair)?;
        let value = planes.means(&self.derivative.at(&planes.lifted(&w))?);
        let tolerance = self.tolerance;
        let lost = |found: Option<Col<f64>>| found.ok_or(Error::uncalibrated(LOST));
        let slope = lost(fixed_point(pair.slope.clone(), tolerance, |x| {
            let image = self.derivative.product(&planes.lifted(x))?;
            Ok(pair.normalized(planes.means(&image)))
        })?)?;
        let psi = lost(fixed_point(pair.slope.clone(), tolerance, |x| {
            let image = self.derivative.transposed(&planes.lifted(x))?;
            Ok(pair.normalized(planes.means(&image)))
        })?)?;
        let image = planes.means(&self.derivative.transposed(&planes.lifted(&psi))?);
        // The slopes integrate to the jumps between the phases.
        let jump = w[pair.middle] - w[0];
        let sums = pair
            .halves()
            .map(|half| half.map(|m| slope[m]).sum::<f64>());
        let jumps = [jump, -jump];
        let factors = [0, 1].map(|i| jumps[i] / (sums[i] * planes.spacing()));
        let slope = pair.scaled(slope, factors);
        let bending = self.bending(planes, &slope)?;
        let mass = self.mass(planes)?;
        let signed = Signed {
            mass_of_slope: &mass * &slope,
            dual_psi: PartialPivLu::new(mass.as_ref()).solve(&psi),
            image,
            residual: value - w,
            slope,
            psi,
            bending,
        };
        let [rising, falling] = pair.halves();
        let (eps, mcf_step) = (self.eps, self.mcf_step);
        Ok([
            signed.modes(pair, rising, 1.0)?.interface(eps, mcf_step)?,
            signed
                .modes(pair, falling, -1.0)?
                .interface(eps, mcf_step)?,
        ])
    }

    /// The profile `w` with `v[w] - w = s q'` at the positions of the pair, for some speed `s` of each.
    fn at_rest(&mut self, planes: &Planes, pair: &Pair) -> Result<Col<f64>, Error> {
        let squares = pair.products(&pair.slope);
        let found = fixed_point(pair.profile.clone(), self.tolerance, |w| {
            let value = planes.means(&self.derivative.value(&planes.lifted(w))?);
            let moved = pair.products(&(&value - &pair.profile));
            let speeds = [0, 1].map(|i| moved[i] / squares[i]);
            Ok(value - pair.scaled(pair.slope.clone(), speeds))
        })?;
        found.ok_or(Error::uncalibrated("no flat interface is at rest"))
    }

    /// `A`, the response to bending: with `J_k x = exp(-i k t) J (exp(i k t) x)`, whose real part is twice the mean of the response to
    /// `x cos(k t)` times `cos(k t)`, the limit of `(J_k w' - J w') / |k|^2`, summed over directions at right angles, over `D - 1`.
    fn bending(&mut self, planes: &Planes, slope: &Col<f64>) -> Result<Col<f64>, Error> {
        let lifted = planes.lifted(slope);
        let straight = planes.means(&self.derivative.product(&lifted)?);
        let mut sum = Col::<f64>::zeros(planes.count());
        for waves in planes.waves((2.0 * self.mcf_step).sqrt()) {
            for (wave, weight) in waves.0.iter().zip(Waves::TO_ZERO) {
                if !planes.tell(wave) {
                    return Err(Error::BoxTooSmall {
                        cells: planes.count(),
                        eps: self.eps,
                        least: planes.count() + 1,
                    });
                }
                let mut direction = lifted.clone();
                wave.multiply(&mut direction);
                let mut image = self.derivative.product(&direction)?;
                wave.multiply(&mut image);
                let change = planes.means(&image) * faer::Scale(2.0) - &straight;
                sum += change * faer::Scale(weight / wave.square);
            }
        }
        Ok(sum * faer::Scale(1.0 / (D - 1) as f64))
    }

    /// The mass matrix on planes, which is circulant.
    fn mass(&self, planes: &Planes) -> Result<Mat<f64>, Error> {
        let count = planes.count();
        let first = Col::from_fn(count, |m| if m == 0 { 1.0 } else { 0.0 });
        let column = planes.means(&self.derivative.mass(&planes.lifted(&first))?);
        Ok(Mat::from_fn(count, count, |i, j| {
            column[(count + i - j) % count]
        }))
    }
}

/// What the [`Modes`] of two interfaces are made of; all but the residual along the planes.
struct Signed {
    slope: Col<f64>,
    mass_of_slope: Col<f64>,
    psi: Col<f64>,
    dual_psi: Col<f64>,
    /// `J^T psi`.
    image: Col<f64>,
    residual: Col<f64>,
    bending: Col<f64>,
}

impl Signed {
    /// Those of one interface, towards the phase `u = 1`.
    fn modes(&self, pair: &Pair, half: Range<usize>, sign: f64) -> Result<Modes, Error> {
        let part = |x: &Col<f64>| Col::from_fn(half.len(), |m| sign * x[half.start + m]);
        let (optimal_slope, psi, image) = (part(&pair.slope), part(&self.psi), part(&self.image));
        let eigenvalue = dot(&psi, &image) / dot(&psi, &psi);
        // NaN is not.
        let near = (eigenvalue - 1.0).abs() <= OFF;
        if !near {
            return Err(Error::Calibration {
                reason: LOST,
                eigenvalue,
            });
        }
        Ok(Modes {
            optimal_square: dot(&optimal_slope, &optimal_slope),
            slope: part(&self.slope),
            mass_of_slope: part(&self.mass_of_slope),
            psi,
            dual_psi: part(&self.dual_psi),
            eigenvalue,
            residual: part(&self.residual) * faer::Scale(sign),
            bending: part(&self.bending),
        })
    }
}
