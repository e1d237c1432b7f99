//! The flows of curves and of surfaces of revolution, in the frame of equal arc length.

use realfft::num_complex::Complex;

use crate::spectral::{Coefficients, Grid, Series, collect};

/// A gradient flow in `L2`, of a plane curve or of the surface that it generates about the y axis.
///
/// In the plane `kappa` is the curvature of the curve. On a surface it is the sum of the principal curvatures, that of the curve and
/// `sin(theta) / x`, positive for spheres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Of `1/2 int kappa^2`: the outward normal velocity is `kappa'' + kappa (|A|^2 - kappa^2 / 2)`, in which `kappa''` is the Laplacian along the curve
    /// or on the surface and `|A|^2` the sum of the squared principal curvatures. In the plane that is `kappa_ss + kappa^3 / 2`, and
    /// the radius of a circle grows as `R^4 = R_0^4 + 2 t`; spheres are stationary.
    Willmore,
    /// Of the length or the area: the outward normal velocity is `-kappa`. In the plane this is curve shortening.
    MeanCurvature,
}

impl Flow {
    /// Order of the derivatives of the tangent angle.
    pub(crate) fn order(self) -> i32 {
        match self {
            Flow::Willmore => 4,
            Flow::MeanCurvature => 2,
        }
    }
}

/// How accurately to compute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// A polygon starts with the self-similar solutions of its corners, over this fraction of its shortest edge; at most 1/80. In the
    /// plane that is exact, on surfaces of revolution the error is of nearly third order in it.
    pub rounding: f64,
    /// Root mean square of the error of the tangent angle in one time step.
    pub tolerance: f64,
}

/// Geometry at the nodes of the curve scaled to length `2 pi`.
pub(crate) struct Nodes {
    /// Unit tangent.
    pub(crate) tangent: Coefficients,
    pub(crate) curvature: Vec<f64>,
    /// The curvature of the parallels, `sin(theta) / x`; zero in the plane.
    pub(crate) parallel: Vec<f64>,
    /// `cos(theta) / x`; zero in the plane.
    widening: Vec<f64>,
    /// Distance from the axis; zero in the plane.
    pub(crate) radius: Vec<f64>,
    pub(crate) h: Vec<f64>,
}

impl Nodes {
    /// `axis`: the x coordinate of the centre over the scale, for surfaces of revolution.
    pub(crate) fn new(grid: &Grid, angle: &[Complex<f64>], axis: Option<f64>) -> Self {
        let n = grid.points;
        let angles = grid.values(angle);
        let bend = grid.values(&grid.derivative(angle));
        let tangent = collect(n, |i| grid.turns[i] * Complex::cis(angles[i]));
        let curvature = collect(n, |i| 1.0 + bend[i]);
        let Some(axis) = axis else {
            return Self {
                tangent,
                h: curvature.clone(),
                curvature,
                parallel: vec![0.0; n],
                widening: vec![0.0; n],
                radius: vec![0.0; n],
            };
        };
        let positions = Series::positions(grid, &angles).at_nodes(grid);
        let radius = collect(n, |i| axis + positions[i].re);
        let parallel = collect(n, |i| tangent[i].im / radius[i]);
        Self {
            widening: collect(n, |i| tangent[i].re / radius[i]),
            h: collect(n, |i| curvature[i] + parallel[i]),
            tangent,
            curvature,
            parallel,
            radius,
        }
    }

    /// `kappa'' + kappa (|A|^2 - kappa^2 / 2)`, in which the bracket is half the squared difference of the principal curvatures.
    pub(crate) fn willmore(&self, grid: &Grid) -> Vec<f64> {
        let slope = grid.derivative(&grid.coefficients(self.h.clone()));
        let (first, second) = (grid.values(&slope), grid.values(&grid.derivative(&slope)));
        let value = |i: usize| {
            let difference = self.curvature[i] - self.parallel[i];
            second[i] + self.widening[i] * first[i] + self.h[i] * difference * difference / 2.0
        };
        collect(grid.points, value)
    }
}

/// How a curve of length `2 pi` changes.
pub(crate) struct Rates {
    /// Coefficients of the rate of the tangent angle.
    pub(crate) angle: Coefficients,
    /// Rate of the logarithm of the scale.
    pub(crate) log_scale: f64,
    /// Rate of the centre.
    pub(crate) centre: [f64; 2],
}

impl Rates {
    /// The outward normal velocity `V` moves the points also along the curve, by `-S`, so that they stay equally spaced:
    /// `S_s = kappa V - mean(kappa V)`, `theta_t = -V_s - kappa S`.
    pub(crate) fn new(flow: Flow, grid: &Grid, nodes: &Nodes) -> Self {
        let velocity = match flow {
            Flow::Willmore => nodes.willmore(grid),
            Flow::MeanCurvature => nodes.h.iter().map(|h| -h).collect(),
        };
        let curvature = &nodes.curvature;
        let stretching = grid.expand(|i| curvature[i] * velocity[i]);
        let sliding = grid.values(&grid.antiderivative(&stretching));
        let turning = grid.expand(|i| curvature[i] * sliding[i]);
        let slope = grid.derivative(&grid.expand(|i| velocity[i]));
        // The outward normal is the tangent turned to the right.
        let moved = |i: usize| -nodes.tangent[i] * Complex::new(sliding[i], velocity[i]);
        let sum: Complex<f64> = (0..grid.points).map(moved).sum();
        // A curve with rotational symmetry keeps its centre.
        let centre = if grid.folds == 1 {
            sum / grid.points as f64
        } else {
            Complex::ZERO
        };
        Self {
            angle: collect(slope.len(), |j| -slope[j] - turning[j]),
            log_scale: stretching[0].re,
            centre: [centre.re, centre.im],
        }
    }
}
