//! The distance to the interface of a phase field between its nodes.

use geometry::{Field, Grid, SignedDistance, distance_from_phase_field};

use crate::Error;
use crate::error::positive;

/// The distance `s = -(4 eps / 3) atanh u` to the interface, interpolated by cubics.
///
/// The interpolant takes the nodal values and is continuously differentiable (bicubic, after
/// Catmull and Rom); its error is `O(h^3)` where `s` is smooth. Near the interface of a phase field
/// that keeps its profile it is the signed distance; elsewhere it has the right sign. In the
/// box it is periodic; it ends at the faces, beyond which everything is outside.
#[derive(Clone, Debug)]
pub struct Interface {
    grid: Grid<2>,
    distance: Vec<f64>,
}

impl Interface {
    /// Of a phase field with an interface of width `eps`.
    ///
    /// # Errors
    /// `eps` must be finite and positive, the values finite.
    pub fn new(u: &Field<2>, eps: f64) -> Result<Self, Error> {
        positive("eps", eps)?;
        u.check_finite()?;
        let distance = u.map(|u| distance_from_phase_field(u, eps));
        Ok(Self {
            grid: *u.grid(),
            distance: distance.into_values(),
        })
    }

    /// The interpolant; periodic.
    fn interpolate(&self, x: [f64; 2]) -> f64 {
        let cells = self.grid.cells();
        let (mut first, mut weights) = ([0; 2], [[0.0; 4]; 2]);
        for axis in 0..2 {
            let position = (x[axis] - self.grid.origin()[axis]) / self.grid.spacing();
            let floor = position.floor();
            // One node before the cell; less than one box away for points in the box.
            first[axis] = (floor as usize + cells - 1) % cells;
            weights[axis] = catmull_rom(position - floor);
        }
        let mut sum = 0.0;
        for (i, a) in weights[0].into_iter().enumerate() {
            for (j, b) in weights[1].into_iter().enumerate() {
                let node = self.grid.index([first[0] + i, first[1] + j]);
                sum += a * b * self.distance[node];
            }
        }
        sum
    }
}

impl SignedDistance<2> for Interface {
    fn signed_distance(&self, x: [f64; 2]) -> f64 {
        let (low, side) = (self.grid.origin(), self.grid.side());
        let nearest = std::array::from_fn(|i| x[i].clamp(low[i], low[i] + side));
        // The box is inside its faces.
        let [a, b] = std::array::from_fn(|i| (low[i] - x[i]).max(x[i] - low[i] - side));
        let to_box = if a.max(b) > 0.0 {
            a.max(0.0).hypot(b.max(0.0))
        } else {
            a.max(b)
        };
        if x.iter().any(|v| v.is_nan()) {
            return f64::NAN;
        }
        self.interpolate(nearest).max(to_box)
    }
}

/// Weights of the four nodes around a point at `t` from 0 to 1 between the middle two.
fn catmull_rom(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t + 2.0 * t2 - t3),
        0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
        0.5 * (t + 4.0 * t2 - 3.0 * t3),
        0.5 * (t3 - t2),
    ]
}
