//! An independent method: central differences of second order in polar coordinates, explicit in time, extrapolated.

use std::f64::consts::{PI, TAU};

use crate::integrate;

/// Where the axis of revolution is.
#[derive(Clone, Copy)]
pub enum Axis {
    None,
    /// At this x coordinate.
    At(f64),
}

/// Willmore flow of `r(phi)` about the origin until `time`: the radii at `phi = 0` and `phi = pi / 2`.
pub fn willmore(start: impl Fn(f64) -> f64 + Copy, axis: Axis, time: f64) -> [f64; 2] {
    let levels = [24, 48, 96].map(|nodes| Polar { nodes, axis }.run(start, time));
    // Removes the errors of order two and four.
    let extrapolated = |i: usize| {
        let finer =
            [0, 1].map(|level: usize| (4.0 * levels[level + 1][i] - levels[level][i]) / 3.0);
        (16.0 * finer[1] - finer[0]) / 15.0
    };
    [extrapolated(0), extrapolated(1)]
}

struct Polar {
    nodes: usize,
    axis: Axis,
}

impl Polar {
    fn spacing(&self) -> f64 {
        TAU / self.nodes as f64
    }

    fn angle(&self, i: usize) -> f64 {
        (i as f64 + 0.5) * self.spacing()
    }

    fn run(&self, start: impl Fn(f64) -> f64, time: f64) -> [f64; 2] {
        let r: Vec<f64> = (0..self.nodes).map(|i| start(self.angle(i))).collect();
        let smallest = r.iter().copied().fold(f64::INFINITY, f64::min);
        let steps = (time / (0.12 * (self.spacing() * smallest).powi(4))).ceil();
        let r = integrate(r, time, steps as usize, |r: &Vec<f64>| self.rates(r));
        [0.0, PI / 2.0].map(|at| self.interpolated(&r, at))
    }

    /// By the trigonometric interpolation of an odd number of harmonics.
    fn interpolated(&self, r: &[f64], at: f64) -> f64 {
        let n = self.nodes as f64;
        let kernel = |x: f64| (n * x / 2.0).sin() / (n * (x / 2.0).tan());
        r.iter()
            .enumerate()
            .map(|(i, r)| r * kernel(at - self.angle(i)))
            .sum()
    }

    fn rates(&self, r: &[f64]) -> Vec<f64> {
        let (n, d) = (self.nodes, self.spacing());
        let next = |i: usize| (i + 1) % n;
        let before = |i: usize| (i + n - 1) % n;
        let slope = |i: usize| (r[next(i)] - r[before(i)]) / (2.0 * d);
        let x = |r: f64, angle: f64| match self.axis {
            Axis::None => 1.0,
            Axis::At(axis) => r * angle.cos() - axis,
        };
        // The principal curvatures at the nodes.
        let curvatures: Vec<[f64; 2]> = (0..n)
            .map(|i| {
                let (p, q) = (slope(i), (r[next(i)] - 2.0 * r[i] + r[before(i)]) / (d * d));
                let g = r[i].hypot(p);
                let (sin, cos) = self.angle(i).sin_cos();
                let parallel = match self.axis {
                    Axis::None => 0.0,
                    Axis::At(_) => (r[i] * cos + p * sin) / (g * x(r[i], self.angle(i))),
                };
                [(r[i] * r[i] + 2.0 * p * p - r[i] * q) / g.powi(3), parallel]
            })
            .collect();
        let h = |i: usize| curvatures[i][0] + curvatures[i][1];
        // x dh/ds between node i and the next one.
        let flux = |i: usize| {
            let (middle, p) = (f64::midpoint(r[i], r[next(i)]), (r[next(i)] - r[i]) / d);
            x(middle, self.angle(i) + d / 2.0) * (h(next(i)) - h(i)) / (d * middle.hypot(p))
        };
        let rate = |i: usize| {
            let g = r[i].hypot(slope(i));
            let laplacian = (flux(i) - flux(before(i))) / (d * g * x(r[i], self.angle(i)));
            let difference = curvatures[i][0] - curvatures[i][1];
            (laplacian + h(i) * difference * difference / 2.0) * g / r[i]
        };
        (0..n).map(rate).collect()
    }
}

/// Points of the curve, from its bottom.
pub fn points(radius: impl Fn(f64) -> f64) -> [[f64; 2]; 128] {
    std::array::from_fn(|i| {
        let angle = TAU * i as f64 / 128.0 - PI / 2.0;
        [radius(angle) * angle.cos(), radius(angle) * angle.sin()]
    })
}

/// The radius of an ellipse in polar coordinates.
pub fn ellipse(a: f64, b: f64) -> impl Fn(f64) -> f64 + Copy {
    move |angle: f64| 1.0 / (angle.cos() / a).hypot(angle.sin() / b)
}
