//! Flows of surfaces of revolution about the y axis.
//!
//! The profile is a plane curve that is symmetric about the axis, as the outline of a disk, or that lies beside it, as the circle
//! that generates a torus; it flows in the frame of [`planar`](crate::planar), with the normal velocity of the surface. Beside the
//! axis exponential time differencing serves as in the plane. At the axis the terms in `1 / x` are as stiff as the fourth
//! derivative: the sine series of the tangent angle, whose nodes avoid the axis, is integrated by a Rosenbrock method with the
//! whole Jacobian matrix.

use std::f64::consts::{PI, TAU};

use crate::exponential::Exponential;
use crate::flow::Nodes;
use crate::rosenbrock::Rosenbrock;
use crate::shape::MOST_ROUNDING;
use crate::{Accuracy, Curve, Error, Flow, Shape, stepping};

/// The accuracy of surfaces: errors of about 1e-6 of their size.
pub const ACCURACY: Accuracy = Accuracy {
    rounding: MOST_ROUNDING,
    tolerance: 1e-7,
};

/// The surface at increasing times.
///
/// ```
/// use reference::{Flow, Shape, revolution};
///
/// let ellipsoid = Shape::ellipse(0.3, 0.2)?;
/// let surfaces = revolution::evolve(&ellipsoid, Flow::Willmore, &[0.001], &revolution::ACCURACY)?;
/// assert!((surfaces[0].energy() / (8.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
/// # Ok::<(), reference::Error>(())
/// ```
///
/// # Errors
/// The shape must be symmetric about the y axis and start on it, or have positive x. See [`Error`] for the others.
pub fn evolve(
    shape: &Shape,
    flow: Flow,
    times: &[f64],
    accuracy: &Accuracy,
) -> Result<Vec<Surface>, Error> {
    let Surface { profile, off_axis } = Surface::from_shape(shape, flow, accuracy.rounding)?;
    let profiles = if off_axis {
        let method = Exponential {
            flow,
            revolution: true,
        };
        stepping::run(&method, flow, accuracy.tolerance, profile, times)
    } else {
        stepping::run(&Rosenbrock(flow), flow, accuracy.tolerance, profile, times)
    };
    let surface = |profile| Surface { profile, off_axis };
    Ok(profiles?.into_iter().map(surface).collect())
}

/// A surface of revolution about the y axis.
#[derive(Clone)]
pub struct Surface {
    profile: Curve,
    off_axis: bool,
}

impl Surface {
    fn from_shape(shape: &Shape, flow: Flow, rounding: f64) -> Result<Self, Error> {
        let profile = shape.curve(flow, rounding, 1)?;
        if profile.points().iter().all(|p| p[0] > 0.0) {
            return Ok(Self {
                profile,
                off_axis: true,
            });
        }
        Self::about_axis(shape.curve(flow, rounding, 2)?)
    }

    /// The surface with a profile that must be symmetric about the axis and start on it.
    pub(crate) fn about_axis(mut profile: Curve) -> Result<Self, Error> {
        const ROUNDING: f64 = 1e-9;
        let even = profile.angle.iter().map(|c| c.re.abs()).fold(0.0, f64::max);
        let asymmetry = (profile.centre[0].abs() / profile.scale).max(even);
        if asymmetry > ROUNDING {
            return Err(Error::NoProfile);
        }
        for c in &mut profile.angle {
            c.re = 0.0;
        }
        profile.centre[0] = 0.0;
        Ok(Self {
            profile,
            off_axis: false,
        })
    }

    /// Time since the start.
    pub fn time(&self) -> f64 {
        self.profile.time
    }

    /// The profile: the half with positive x generates the surface.
    pub fn profile(&self) -> &Curve {
        &self.profile
    }

    /// Area, `2 pi int x ds`.
    pub fn area(&self) -> f64 {
        TAU * self.profile.scale.powi(2) * self.integral(|nodes, i| nodes.radius[i])
    }

    /// Enclosed volume, `pi int x^2 dy`.
    pub fn volume(&self) -> f64 {
        PI * self.profile.scale.powi(3)
            * self.integral(|nodes, i| nodes.radius[i].powi(2) * nodes.tangent[i].im)
    }

    /// Integrated mean curvature `int kappa`, `kappa` the sum of the principal curvatures: `8 pi R` for spheres.
    pub fn mean_curvature(&self) -> f64 {
        TAU * self.profile.scale * self.integral(|nodes, i| nodes.radius[i] * nodes.h[i])
    }

    /// Willmore energy `1/2 int kappa^2`: `8 pi` for spheres.
    pub fn energy(&self) -> f64 {
        PI * self.integral(|nodes, i| nodes.radius[i] * nodes.h[i].powi(2))
    }

    /// Volume over that of the ball with the same area.
    pub fn reduced_volume(&self) -> f64 {
        self.volume() / (4.0 / 3.0 * PI * (self.area() / (4.0 * PI)).powf(1.5))
    }

    /// The largest distance from the axis.
    pub fn equator(&self) -> f64 {
        let points = self.profile.points();
        let order = |a: &usize, b: &usize| points[*a][0].total_cmp(&points[*b][0]);
        let widest = (0..points.len()).max_by(order).expect("a curve has points");
        let mut alpha = (widest as f64 + 0.5) * TAU / points.len() as f64;
        let mut largest = points[widest][0];
        for _ in 0..5 {
            // Newton's method for an upright tangent, which a flat wall may lead astray.
            let (sin, cos) = self.profile.angle_at(alpha).sin_cos();
            alpha += cos / (sin * self.profile.curvature_at(alpha) * self.profile.scale);
            largest = largest.max(self.profile.point(alpha)[0]);
        }
        largest
    }

    /// The heights of the lower and the upper pole. None for surfaces that do not meet the axis.
    pub fn poles(&self) -> Option<[f64; 2]> {
        (!self.off_axis).then(|| [0.0, PI].map(|alpha| self.profile.point(alpha)[1]))
    }

    /// The integral over the profile, scaled to length `2 pi` with its mirror image or beside the axis.
    fn integral(&self, value: impl Fn(&Nodes, usize) -> f64) -> f64 {
        let grid = &self.profile.grid;
        let axis = self.profile.centre[0] / self.profile.scale;
        let nodes = Nodes::new(grid, &self.profile.angle, Some(axis));
        if self.off_axis {
            (0..grid.points).map(|i| value(&nodes, i)).sum::<f64>() * TAU / grid.points as f64
        } else {
            let weights = grid.pole_weights().iter().enumerate();
            weights.map(|(i, weight)| weight * value(&nodes, i)).sum()
        }
    }
}
