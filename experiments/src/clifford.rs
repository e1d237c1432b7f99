//! The Clifford torus nearest to a phase field.

use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
use geometry::shapes::Torus;
use geometry::{Field, SignedDistance, measure, optimal_profile};
use serde::Serialize;

use crate::Error;

/// Steps of the simplex method.
const ITERATIONS: u64 = 400;
/// Spread of the distances in the simplex at which the search ends.
const TOLERANCE: f64 = 1e-7;

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

/// A torus by its centre, the tilt of its axis from a first guess, and its outer radius.
struct Family<'a> {
    u: &'a Field<3>,
    eps: f64,
    /// The guessed axis, and two vectors that complete it to an orthonormal basis.
    frame: [[f64; 3]; 3],
}

impl Family<'_> {
    fn torus(&self, parameters: &[f64]) -> CliffordFit {
        let [c0, c1, c2, a, b, outer_radius] = parameters else {
            unreachable!("six parameters");
        };
        let tilted: [f64; 3] =
            std::array::from_fn(|i| self.frame[0][i] + a * self.frame[1][i] + b * self.frame[2][i]);
        CliffordFit {
            centre: [*c0, *c1, *c2],
            axis: normalized(tilted),
            outer_radius: *outer_radius,
            l2: f64::INFINITY,
        }
    }

    fn distance(&self, torus: &CliffordFit) -> Result<f64, Error> {
        Ok(measure::l2_distance(
            self.u,
            &torus.phase_field(self.u, self.eps)?,
        )?)
    }
}

impl CostFunction for Family<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, parameters: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        // Beyond the positive radii there is no torus, which is no reason to stop.
        Ok(self
            .distance(&self.torus(parameters))
            .unwrap_or(f64::INFINITY))
    }
}

impl CliffordFit {
    /// The torus whose phase field is nearest to `u` in `L2`: a simplex search over centre, axis and radius, from the centre of
    /// mass, the axis of largest moment of inertia and the volume.
    ///
    /// # Errors
    /// [`Error::Options`] if there is no volume inside or the search fails.
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
            let family = Family { u, eps, frame };
            let [c0, c1, c2] = moments.centre;
            let start = vec![c0, c1, c2, 0.0, 0.0, radius];
            let steps = [
                0.1 * radius,
                0.1 * radius,
                0.1 * radius,
                0.2,
                0.2,
                0.1 * radius,
            ];
            let mut simplex = vec![start.clone()];
            for (i, step) in steps.into_iter().enumerate() {
                let mut vertex = start.clone();
                vertex[i] += step;
                simplex.push(vertex);
            }
            let solver = NelderMead::new(simplex)
                .with_sd_tolerance(TOLERANCE)
                .map_err(|error| failed(&error.to_string()))?;
            let result = Executor::new(family, solver)
                .configure(|state| state.max_iters(ITERATIONS))
                .run()
                .map_err(|error| failed(&error.to_string()))?;
            let family = Family { u, eps, frame };
            let Some(parameters) = result.state().get_best_param() else {
                continue;
            };
            let mut torus = family.torus(parameters);
            torus.l2 = family.distance(&torus)?;
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
            let height = dot(x, self.axis);
            let across: [f64; 3] = std::array::from_fn(|i| x[i] - height * self.axis[i]);
            let in_its_frame = [dot(across, across).sqrt(), 0.0, height];
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

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn normalized(a: [f64; 3]) -> [f64; 3] {
    let length = dot(a, a).sqrt();
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
    let along = dot(e, axis);
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
        assert!(dot(found.axis, torus.axis).abs() > 1.0 - 1e-6, "{found:?}");
        for (a, b) in found.centre.iter().zip(torus.centre) {
            assert!((a - b).abs() < 1e-4, "{found:?}");
        }
        for circle in found.minor_circles(3, 16).unwrap() {
            for x in circle {
                let x: [f64; 3] = std::array::from_fn(|i| x[i] - found.centre[i]);
                let height = dot(x, found.axis);
                let across = (dot(x, x) - height * height).sqrt();
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
