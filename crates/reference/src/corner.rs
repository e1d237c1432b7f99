//! The first moments of a corner.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::dense::Newton;
use crate::spectral::{Coefficients, Grid, collect, sines};
use crate::{Error, Flow};

/// The self-similar solution of the flow from a corner, the curve whose tangent angle `phi(s / t^(1/m))` runs from `-angle / 2` to
/// `angle / 2`, where `m` is the order of the flow.
///
/// In `eta = s / t^(1/m)` from the tip, with `g = phi'`, the normal velocity `V(g)` and the sliding `S = int_0^eta g V`, the flow
/// `theta_t = -V_s - kappa S` is `eta g / m = V' + g S`: solved by Newton's method for the cosine series of `g` over
/// `-REACH < eta < REACH`, beyond which `g` is below rounding, from the solution `e^{-k^m}` of the linear equation.
pub(crate) struct Corner {
    pub(crate) angle: f64,
    grid: Arc<Grid>,
    /// Cosine coefficients of `g` over `alpha = pi eta / REACH`.
    cosines: Vec<f64>,
}

impl Corner {
    /// Half the interval of `eta`.
    pub(crate) const REACH: f64 = 45.0;
    /// Cosines.
    const MODES: usize = 192;
    /// The largest wave number over `eta`.
    pub(crate) const LARGEST_WAVE: f64 = Self::MODES as f64 * PI / Self::REACH;

    pub(crate) fn new(flow: Flow, angle: f64) -> Result<Self, Error> {
        const TOLERANCE: f64 = 1e-12;
        let grid = Grid::new(1, 2 * Self::MODES);
        let linear = |j: usize| {
            angle / (2.0 * Self::REACH) * (-(j as f64 * PI / Self::REACH).powi(flow.order())).exp()
        };
        let residual = |x: &[f64]| Self::residual(&grid, flow, angle, x);
        let newton = Newton::solve(&residual, collect(Self::MODES, linear), TOLERANCE);
        if newton.step.is_nan() || newton.step > TOLERANCE {
            return Err(Error::Corner {
                angle,
                residual: newton.step,
            });
        }
        Ok(Self {
            angle,
            grid,
            cosines: newton.solution,
        })
    }

    fn residual(grid: &Grid, flow: Flow, angle: f64, cosines: &[f64]) -> Vec<f64> {
        let rate = PI / Self::REACH; // d alpha / d eta
        let even = even(cosines);
        let bend = grid.values(&even);
        let second = grid.values(&grid.derivative(&grid.derivative(&even)));
        let velocity = collect(grid.points, |i| match flow {
            Flow::Willmore => rate * rate * second[i] + bend[i].powi(3) / 2.0,
            Flow::MeanCurvature => -bend[i],
        });
        let sliding = Self::integral(grid, &grid.expand(|i| bend[i] * velocity[i]));
        let slope = grid.values(&grid.derivative(&grid.coefficients(velocity)));
        let at = |i: usize| {
            let stretch = Self::eta(grid, i) / f64::from(flow.order());
            rate * slope[i] + bend[i] * (sliding[i] - stretch)
        };
        let mut result: Vec<f64> = sines(&grid.expand(at)).collect();
        result.push(cosines[0] * Self::REACH - angle / 2.0);
        result
    }

    /// `eta` at a node, from `-REACH` to `REACH`.
    fn eta(grid: &Grid, i: usize) -> f64 {
        let alpha = grid.node(i);
        (if alpha > PI { alpha - 2.0 * PI } else { alpha }) * Self::REACH / PI
    }

    /// The integral from 0 to `eta` at the nodes, of an even function.
    fn integral(grid: &Grid, coefficients: &Coefficients) -> Vec<f64> {
        let periodic = grid.values(&grid.antiderivative(coefficients));
        let mean = coefficients[0].re;
        collect(grid.points, |i| {
            mean * Self::eta(grid, i) + periodic[i] * Self::REACH / PI
        })
    }

    /// `int_0^inf cos(phi) / cos(angle / 2) - 1 d eta`: how much longer the straight edge is, up to the vertex, than the curve, up
    /// to its tip.
    pub(crate) fn gain(&self) -> f64 {
        let phi = Self::integral(&self.grid, &even(&self.cosines));
        let edge = (self.cosines[0] * Self::REACH).cos();
        let sum: f64 = phi[..Self::MODES]
            .iter()
            .map(|p| p.cos() / edge - 1.0)
            .sum();
        sum * Self::REACH / Self::MODES as f64
    }

    /// `int g cos(wave eta) d eta`.
    pub(crate) fn transform(&self) -> impl Fn(f64) -> f64 {
        let nodes = collect(Self::MODES, |i| Self::eta(&self.grid, i));
        let bend = self.grid.values(&even(&self.cosines));
        move |wave| {
            if wave > Self::LARGEST_WAVE {
                return 0.0;
            }
            let term = |i: usize| bend[i] * (wave * nodes[i]).cos();
            let sum: f64 = (0..Self::MODES).map(term).sum();
            2.0 * sum * Self::REACH / Self::MODES as f64
        }
    }
}

/// Coefficients of `sum_j x_j cos(j alpha)` for `j < 0` and `j >= 0` together, `x_j` counted twice from `j = 1`.
fn even(cosines: &[f64]) -> Coefficients {
    cosines.iter().chain([&0.0]).map(|&c| c.into()).collect()
}
