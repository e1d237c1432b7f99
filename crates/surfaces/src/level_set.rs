//! Points on level sets.

use geometry::{Field, Grid, distance_from_phase_field};
use rayon::prelude::*;

use crate::vector::Vector;
use crate::{Error, positive};

/// The distances `-(4 eps/3) atanh u` of a phase field as a function with a continuous gradient: the tensor product of
/// Catmull-Rom splines, of third order where `u` is smooth.
#[derive(Clone, Debug)]
pub(crate) struct LevelSet {
    distance: Field<3>,
}

/// Newton steps of a projection, at most,
const STEPS: usize = 10;
/// and the part of the spacing at which they end.
const TOLERANCE: f64 = 1e-6;
/// A gradient below this, where that of a distance is 1, points nowhere.
const FLAT: f64 = 0.1;

impl LevelSet {
    /// Of a phase field.
    ///
    /// # Errors
    /// `eps` must be finite and positive, the values finite.
    pub(crate) fn new(u: &Field<3>, eps: f64) -> Result<Self, Error> {
        positive("eps", eps)?;
        u.check_finite()?;
        let distance = u.map(|u| distance_from_phase_field(u, eps));
        Ok(Self { distance })
    }

    /// The distances at the nodes.
    pub(crate) fn distance(&self) -> &Field<3> {
        &self.distance
    }

    /// The grid.
    pub(crate) fn grid(&self) -> &Grid<3> {
        self.distance.grid()
    }

    /// The distance at `x`, negative inside.
    pub(crate) fn value(&self, x: [f64; 3]) -> f64 {
        self.value_and_gradient(Vector::from_array(x)).0
    }

    /// The point where the distance has the value `level`, by Newton's method along the gradient from `x`. Where the gradient
    /// vanishes on the way, as in the middle of a plate, it ends; it goes no further than `reach` from `x`.
    pub(crate) fn project(&self, x: [f64; 3], level: f64, reach: f64) -> [f64; 3] {
        let start = Vector::from_array(x);
        let spacing = self.grid().spacing();
        let mut at = start;
        for _ in 0..STEPS {
            let (value, gradient) = self.value_and_gradient(at);
            let squared = gradient.length_squared();
            if squared < FLAT * FLAT {
                break;
            }
            let step = gradient * ((level - value) / squared);
            at += step.clamp_length_max(spacing);
            if step.length_squared() < (TOLERANCE * spacing).powi(2) {
                break;
            }
        }
        (start + (at - start).clamp_length_max(reach)).to_array()
    }

    /// Many points at once, in parallel.
    pub(crate) fn values(&self, points: &[[f64; 3]]) -> Vec<f64> {
        points.par_iter().map(|&x| self.value(x)).collect()
    }

    /// The distance at `x` and its gradient.
    pub(crate) fn value_and_gradient(&self, x: Vector) -> (f64, Vector) {
        let grid = self.grid();
        let cells = grid.cells();
        let mut nodes = [[0; 4]; 3];
        let (mut weights, mut slopes) = ([[0.0; 4]; 3], [[0.0; 4]; 3]);
        for axis in 0..3 {
            let position = (x[axis] - grid.origin()[axis]) / grid.spacing();
            let floor = position.floor();
            (weights[axis], slopes[axis]) = catmull_rom(position - floor);
            let first = (floor.rem_euclid(cells as f64)) as usize + cells - 1;
            nodes[axis] = [0, 1, 2, 3].map(|i| (first + i) % cells);
        }
        let (mut value, mut gradient) = (0.0, Vector::ZERO);
        for (i, &x) in nodes[0].iter().enumerate() {
            for (j, &y) in nodes[1].iter().enumerate() {
                let row = grid.index([x, y, 0]);
                let (mut line, mut slope) = (0.0, 0.0);
                for (k, &z) in nodes[2].iter().enumerate() {
                    let distance = self.distance.values()[row + z];
                    line += weights[2][k] * distance;
                    slope += slopes[2][k] * distance;
                }
                value += weights[0][i] * weights[1][j] * line;
                gradient += Vector::new(
                    slopes[0][i] * weights[1][j] * line,
                    weights[0][i] * slopes[1][j] * line,
                    weights[0][i] * weights[1][j] * slope,
                );
            }
        }
        (value, gradient / grid.spacing())
    }
}

/// Weights of four nodes in a row for a point `t` behind the second of them, and their derivatives.
fn catmull_rom(t: f64) -> ([f64; 4], [f64; 4]) {
    let (t2, t3) = (t * t, t * t * t);
    let weights = [
        -t + 2.0 * t2 - t3,
        2.0 - 5.0 * t2 + 3.0 * t3,
        t + 4.0 * t2 - 3.0 * t3,
        t3 - t2,
    ];
    let slopes = [
        -1.0 + 4.0 * t - 3.0 * t2,
        -10.0 * t + 9.0 * t2,
        1.0 + 8.0 * t - 9.0 * t2,
        3.0 * t2 - 2.0 * t,
    ];
    (weights.map(|w| 0.5 * w), slopes.map(|s| 0.5 * s))
}
