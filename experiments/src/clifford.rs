//! The Clifford torus nearest to a phase field.

use faer::linalg::solvers::Solve;
use faer::{Col, Mat, Side};
use geometry::shapes::Torus;
use geometry::{Field, SignedDistance, measure, optimal_profile};
use serde::Serialize;

use crate::Error;

/// Most steps of the Levenberg-Marquardt method.
const ITERATIONS: usize = 100;
/// Length of its last step: lengths are relative to the radius, tilts in radians.
const TOLERANCE: f64 = 1e-7;
/// Length of the differences for derivatives.
const DIFFERENCE: f64 = 1e-5;

/// A Clifford torus in space, fitted to a phase field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CliffordFit {
    /// Its centre.
    pub centre: [f64; 3],
    /// Unit vector along its axis.
    pub axis: [f64; 3],
    /// Radius of its outer equator.
    pub outer_radius: f64,
    /// `L2` distance of the two phase fields.
    pub l2: f64,
}

/// Tori by centre, tilt of the axis from a first guess, and outer radius.
struct Family<'a> {
    u: &'a Field<3>,
    eps: f64,
    /// The guessed axis, and two vectors that complete it to an orthonormal basis.
    frame: [[f64; 3]; 3],
}

type Parameters = [f64; 6];

impl Family<'_> {
    fn torus(&self, [c0, c1, c2, a, b, outer_radius]: Parameters) -> CliffordFit {
        let tilted: [f64; 3] =
            std::array::from_fn(|i| self.frame[0][i] + a * self.frame[1][i] + b * self.frame[2][i]);
        CliffordFit {
            centre: [c0, c1, c2],
            axis: normalized(tilted),
            outer_radius,
            l2: f64::INFINITY,
        }
    }

    /// The phase field of a torus without `u`.
    fn residual(&self, parameters: Parameters) -> Result<Vec<f64>, Error> {
        let field = self.torus(parameters).phase_field(self.u, self.eps)?;
        Ok(field.zip_map(self.u, |v, u| v - u)?.into_values())
    }

    /// Levenberg-Marquardt from the given parameters.
    fn nearest(&self, start: Parameters) -> Result<CliffordFit, Error> {
        let radius = start[5];
        let units = [radius, radius, radius, 1.0, 1.0, radius];
        let (mut at, mut residual) = (start, self.residual(start)?);
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let mut derivatives = Vec::with_capacity(at.len());
            for (k, unit) in units.iter().enumerate() {
                let mut moved = at;
                moved[k] += DIFFERENCE * unit;
                let mut derivative = self.residual(moved)?;
                for (d, r) in derivative.iter_mut().zip(&residual) {
                    *d = (*d - r) / DIFFERENCE;
                }
                derivatives.push(derivative);
            }
            let gradient = Col::from_fn(at.len(), |i| dot(&derivatives[i], &residual));
            let matrix = Mat::from_fn(at.len(), at.len(), |i, j| {
                let damped = if i == j { 1.0 + damping } else { 1.0 };
                damped * dot(&derivatives[i], &derivatives[j])
            });
            let Ok(factors) = matrix.llt(Side::Lower) else {
                break;
            };
            let step = factors.solve(&gradient);
            let next = std::array::from_fn(|k| at[k] - units[k] * step[k]);
            // Where there is no torus, none is nearer.
            match self.residual(next) {
                Ok(found) if dot(&found, &found) < dot(&residual, &residual) => {
                    (at, residual) = (next, found);
                    damping *= 0.1;
                }
                _ => damping *= 10.0,
            }
            if step.norm_l2() < TOLERANCE {
                break;
            }
        }
        let torus = self.torus(at);
        Ok(CliffordFit {
            l2: measure::l2_distance(self.u, &torus.phase_field(self.u, self.eps)?)?,
            ..torus
        })
    }
}

impl CliffordFit {
    /// The torus whose phase field is nearest to `u` in `L2`: least squares over centre, axis and radius, from the centre of
    /// mass, each principal axis of inertia and the volume.
    ///
    /// # Errors
    /// [`Error::Options`] if there is no volume inside or nothing fits.
    pub fn to(u: &Field<3>, eps: f64) -> Result<Self, Error> {
        let failed = |reason: &str| Error::Options(format!("no Clifford torus fits: {reason}"));
        let moments = Moments::of(u);
        if moments.volume <= 0.0 {
            return Err(failed("the phase field has no inside"));
        }
        // 2 pi^2 R r^2 with R = sqrt(2) r.
        let minor = (moments.volume
            / (2.0 * std::f64::consts::SQRT_2 * std::f64::consts::PI.powi(2)))
        .cbrt();
        let radius = minor * (1.0 + std::f64::consts::SQRT_2);
        let mut best: Option<Self> = None;
        for frame in moments.frames() {
            let [c0, c1, c2] = moments.centre;
            let torus = Family { u, eps, frame }.nearest([c0, c1, c2, 0.0, 0.0, radius])?;
            if best.is_none_or(|best| torus.l2 < best.l2) {
                best = Some(torus);
            }
        }
        best.filter(|best| best.l2.is_finite())
            .ok_or_else(|| failed("the search found none"))
    }

    /// The phase field of the torus on the grid of another field.
    ///
    /// # Errors
    /// [`Error::Geometry`] for a radius that is not positive.
    pub fn phase_field(&self, like: &Field<3>, eps: f64) -> Result<Field<3>, Error> {
        let torus = Torus::clifford(self.outer_radius)?;
        Ok(Field::from_fn(*like.grid(), |x| {
            let x: [f64; 3] = std::array::from_fn(|i| x[i] - self.centre[i]);
            let height = dot(&x, &self.axis);
            let across: [f64; 3] = std::array::from_fn(|i| x[i] - height * self.axis[i]);
            let in_its_frame = [dot(&across, &across).sqrt(), 0.0, height];
            optimal_profile(torus.signed_distance(in_its_frame), eps)
        }))
    }

    /// Circles around the tube, as closed polylines.
    ///
    /// # Errors
    /// [`Error::Geometry`] for a radius that is not positive.
    pub fn minor_circles(&self, count: usize, points: usize) -> Result<Vec<Vec<[f64; 3]>>, Error> {
        let torus = Torus::clifford(self.outer_radius)?;
        let [axis, e, f] = frame_of(self.axis);
        let angle = |k: usize, of: usize| 2.0 * std::f64::consts::PI * k as f64 / of as f64;
        let circle = |k: usize| {
            let (sin, cos) = angle(k, count).sin_cos();
            let outward: [f64; 3] = std::array::from_fn(|i| cos * e[i] + sin * f[i]);
            let point = |j: usize| {
                let (up, out) = angle(j, points).sin_cos();
                let radius = torus.major() + torus.minor() * out;
                let height = torus.minor() * up;
                std::array::from_fn(|i| self.centre[i] + radius * outward[i] + height * axis[i])
            };
            (0..points).map(point).collect()
        };
        Ok((0..count).map(circle).collect())
    }
}

/// Volume, centre of mass and second moments of the inside.
struct Moments {
    volume: f64,
    centre: [f64; 3],
    second: [[f64; 3]; 3],
}

impl Moments {
    fn of(u: &Field<3>) -> Self {
        let grid = u.grid();
        let inside = |u: f64| 0.5 * (1.0 + u.clamp(-1.0, 1.0));
        let sum: f64 = u.values().iter().map(|&u| inside(u)).sum();
        let mut centre = [0.0; 3];
        for (i, &value) in u.values().iter().enumerate() {
            for (c, x) in centre.iter_mut().zip(grid.node(i)) {
                *c += inside(value) * x / sum;
            }
        }
        let mut second = [[0.0; 3]; 3];
        for (i, &value) in u.values().iter().enumerate() {
            let x = grid.node(i);
            for (j, row) in second.iter_mut().enumerate() {
                for (k, entry) in row.iter_mut().enumerate() {
                    *entry += inside(value) * (x[j] - centre[j]) * (x[k] - centre[k]) / sum;
                }
            }
        }
        Self {
            volume: sum * grid.cell_volume(),
            centre,
            second,
        }
    }

    /// The principal axes, each as the first vector of a frame: the axis of a torus that is still far from round need not
    /// be the one of largest inertia.
    fn frames(&self) -> [[[f64; 3]; 3]; 3] {
        let matrix = faer::Mat::from_fn(3, 3, |i, j| self.second[i][j]);
        let axes = match matrix.self_adjoint_eigen(faer::Side::Lower) {
            Ok(eigen) => [0, 1, 2].map(|k| std::array::from_fn(|i| eigen.U()[(i, k)])),
            // Of a matrix that is not finite, which the fit will report.
            Err(_) => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        };
        axes.map(frame_of)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn normalized(a: [f64; 3]) -> [f64; 3] {
    let length = dot(&a, &a).sqrt();
    a.map(|a| a / length)
}

/// An orthonormal basis that begins with the given direction.
fn frame_of(axis: [f64; 3]) -> [[f64; 3]; 3] {
    let axis = normalized(axis);
    // The coordinate direction that is farthest from the axis.
    let k = (0..3)
        .min_by(|&i, &j| axis[i].abs().total_cmp(&axis[j].abs()))
        .unwrap_or(0);
    let mut e = [0.0; 3];
    e[k] = 1.0;
    let along = dot(&e, &axis);
    let e = normalized(std::array::from_fn(|i| e[i] - along * axis[i]));
    let f = [
        axis[1] * e[2] - axis[2] * e[1],
        axis[2] * e[0] - axis[0] * e[2],
        axis[0] * e[1] - axis[1] * e[0],
    ];
    [axis, e, f]
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Grid;

    #[test]
    fn a_clifford_torus_is_found_in_any_position() {
        let grid = Grid::<3>::new(32, 1.0).unwrap();
        let eps = 2.0 * grid.spacing();
        let like = Field::constant(grid, 0.0);
        let torus = CliffordFit {
            centre: [0.52, 0.47, 0.5],
            axis: normalized([0.3, -0.5, 1.0]),
            outer_radius: 0.36,
            l2: 0.0,
        };
        let u = torus.phase_field(&like, eps).unwrap();
        let found = CliffordFit::to(&u, eps).unwrap();
        assert!(found.l2 < 1e-4, "{found:?}");
        assert!((found.outer_radius - 0.36).abs() < 1e-4, "{found:?}");
        assert!(
            dot(&found.axis, &torus.axis).abs() > 1.0 - 1e-6,
            "{found:?}"
        );
        for (a, b) in found.centre.iter().zip(torus.centre) {
            assert!((a - b).abs() < 1e-4, "{found:?}");
        }
        for circle in found.minor_circles(3, 16).unwrap() {
            for x in circle {
                let x: [f64; 3] = std::array::from_fn(|i| x[i] - found.centre[i]);
                let height = dot(&x, &found.axis);
                let across = (dot(&x, &x) - height * height).sqrt();
                let shape = Torus::clifford(found.outer_radius).unwrap();
                assert!(shape.signed_distance([across, 0.0, height]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn nothing_fits_an_empty_field() {
        let grid = Grid::<3>::new(8, 1.0).unwrap();
        assert!(CliffordFit::to(&Field::constant(grid, -1.0), 0.1).is_err());
    }
}
