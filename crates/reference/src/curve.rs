//! Closed curves given by their tangent angle.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use realfft::num_complex::Complex;

use crate::flow::Nodes;
use crate::spectral::{Coefficients, Grid, Series, collect, power_sum};
use crate::{Error, Flow};

/// Most points of a whole curve.
pub(crate) const MOST_POINTS: usize = 1 << 20;

/// A smooth simple closed curve at a time, counterclockwise, by its tangent angle `theta` over `alpha = 2 pi s / length`, where `s`
/// is the arc length: `theta(alpha) - alpha` is a Fourier series, so that all measures are exact to rounding.
#[derive(Clone)]
pub struct Curve {
    pub(crate) grid: Arc<Grid>,
    /// Coefficients of `theta - alpha`.
    pub(crate) angle: Coefficients,
    /// Length over `2 pi`.
    pub(crate) scale: f64,
    /// Mean of the positions over the arc length.
    pub(crate) centre: [f64; 2],
    pub(crate) time: f64,
}

/// A circle, or a line, by one of its points.
struct Circle {
    point: [f64; 2],
    /// The unit normal to the outside.
    normal: [f64; 2],
    curvature: f64,
}

impl Circle {
    /// The squared distance to the point.
    fn squared(&self, x: [f64; 2]) -> f64 {
        let [a, b] = [0, 1].map(|axis| x[axis] - self.point[axis]);
        a * a + b * b
    }

    fn signed_distance(&self, x: [f64; 2]) -> f64 {
        let [a, b] = [0, 1].map(|axis| x[axis] - self.point[axis]);
        let along = a * self.normal[0] + b * self.normal[1];
        // The squared distance from the centre in radii is 1 + curvature * gap.
        let gap = 2.0 * along + self.curvature * (a * a + b * b);
        gap / (1.0 + (1.0 + self.curvature * gap).max(0.0).sqrt())
    }
}

impl Curve {
    /// Time since the start.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Length.
    pub fn length(&self) -> f64 {
        TAU * self.scale
    }

    /// Enclosed area, `1/2 int x dy - y dx`.
    pub fn area(&self) -> f64 {
        let positions = self.series().at_nodes(&self.grid);
        let tangent = Nodes::new(&self.grid, &self.angle, None).tangent;
        let term = |i: usize| (positions[i].conj() * tangent[i]).im;
        let sum: f64 = (0..self.grid.points).map(term).sum();
        PI * self.scale * self.scale * sum / self.grid.points as f64
    }

    /// Willmore energy `1/2 int kappa^2 ds`.
    pub fn energy(&self) -> f64 {
        let sum: f64 = self.curvatures_of_period().map(|k| k * k).sum();
        PI * self.scale * sum / self.grid.points as f64
    }

    /// Centre: the mean of the positions over the arc length.
    pub fn centre(&self) -> [f64; 2] {
        self.centre
    }

    /// Points at equal distances of arc length, over the whole curve.
    pub fn points(&self) -> Vec<[f64; 2]> {
        let (grid, positions) = (&self.grid, self.series().at_nodes(&self.grid));
        let turn = |fold: usize| Complex::cis(TAU * fold as f64 / grid.folds as f64);
        let point = |i: usize| positions[i % grid.points] * turn(i / grid.points);
        collect(grid.folds * grid.points, |i| self.placed(point(i)))
    }

    /// The point at `alpha = 2 pi s / length`.
    pub fn point(&self, alpha: f64) -> [f64; 2] {
        self.placed(self.series().at(alpha))
    }

    fn curvatures_of_period(&self) -> impl Iterator<Item = f64> {
        let derivative = self.grid.values(&self.grid.derivative(&self.angle));
        derivative.into_iter().map(|a| (1.0 + a) / self.scale)
    }

    /// Distance from the centre to the outermost point in a direction, by spectral interpolation. None if there is no such point.
    pub fn distance_along(&self, direction: [f64; 2]) -> Option<f64> {
        let [x, y] = direction.map(|d| d / direction[0].hypot(direction[1]));
        let turned = |z: Complex<f64>| z * Complex::new(x, -y);
        let series = self.series();
        let nodes: Vec<[f64; 2]> = self.points();
        let count = nodes.len();
        let node = |i: usize| {
            let [a, b] = [0, 1].map(|k| nodes[i % count][k] - self.centre[k]);
            turned(Complex::new(a, b))
        };
        let changes = |i: &usize| (node(*i).im <= 0.0) != (node(i + 1).im <= 0.0);
        let crossings = (0..count).filter(|i| changes(i) && node(*i).re > 0.0);
        let refine = |i: usize| {
            // The root of the imaginary part between two nodes, by Newton's method from the secant.
            let (a, b) = (node(i).im, node(i + 1).im);
            let mut alpha = (i as f64 + 0.5 + a / (a - b)) * TAU / count as f64;
            for _ in 0..6 {
                let tangent = turned(Complex::cis(self.angle_at(alpha)));
                alpha -= turned(series.at(alpha)).im / tangent.im;
            }
            turned(series.at(alpha)).re * self.scale
        };
        crossings.map(refine).max_by(f64::total_cmp)
    }

    /// The largest distance of any of the points to the curve.
    pub fn largest_distance_of(&self, points: &[[f64; 2]]) -> f64 {
        let series = self.series();
        let nodes = self.points();
        let distance = |p: &[f64; 2]| {
            let squared = |q: &[f64; 2]| (q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2);
            let closer = |a: &usize, b: &usize| squared(&nodes[*a]).total_cmp(&squared(&nodes[*b]));
            let nearest = (0..nodes.len()).min_by(closer).expect("a curve has points");
            let target = Complex::new(p[0] - self.centre[0], p[1] - self.centre[1]) / self.scale;
            let mut alpha = (nearest as f64 + 0.5) * TAU / nodes.len() as f64;
            let mut best = squared(&nodes[nearest]).sqrt() / self.scale;
            for _ in 0..20 {
                // Where the line to the point is normal to the curve, by Newton's method in the frame of the curve.
                let local = (target - series.at(alpha)) * Complex::cis(-self.angle_at(alpha));
                best = best.min(local.norm());
                let slope = 1.0 - local.im * self.scale * self.curvature_at(alpha);
                alpha += local.re / slope.max(0.1);
                if local.re.abs() < 1e-14 {
                    break;
                }
            }
            best * self.scale
        };
        points.iter().map(distance).fold(0.0, f64::max)
    }

    /// The signed distance to the curve, negative inside, as a function of points: the distance to the osculating circle at the nearest of at
    /// least 4096 points of the curve.
    pub fn signed_distance(&self) -> impl Fn([f64; 2]) -> f64 + Send + Sync + use<> {
        const FEWEST: usize = 4096;
        /// Points that are passed over together where they are far away.
        const BLOCK: usize = 16;
        let points = self.grid.points.max(FEWEST.div_ceil(self.grid.folds));
        let finer = self.with_points(points.next_multiple_of(2));
        let circles = finer.osculating_circles();
        // No point of a block is farther than this from its middle one.
        let reach = (BLOCK / 2) as f64 * self.length() / circles.len() as f64;
        move |x| {
            let middle = |block: &[Circle]| block[block.len() / 2].squared(x);
            let blocks = || circles.chunks(BLOCK);
            let least = blocks().map(middle).fold(f64::INFINITY, f64::min);
            let farthest = (least.sqrt() + reach).powi(2);
            let near = blocks().filter(|block| middle(block) <= farthest);
            let nearer = |a: &&Circle, b: &&Circle| a.squared(x).total_cmp(&b.squared(x));
            let nearest = near.flatten().min_by(nearer);
            nearest.expect("a curve has points").signed_distance(x)
        }
    }

    /// The osculating circles at the nodes of the whole curve.
    fn osculating_circles(&self) -> Vec<Circle> {
        let tangents = Nodes::new(&self.grid, &self.angle, None).tangent;
        let curvatures: Vec<f64> = self.curvatures_of_period().collect();
        let circle = |(i, point): (usize, [f64; 2])| {
            let (fold, i) = (i / self.grid.points, i % self.grid.points);
            let tangent = tangents[i] * Complex::cis(TAU * fold as f64 / self.grid.folds as f64);
            Circle {
                point,
                normal: [tangent.im, -tangent.re],
                curvature: curvatures[i],
            }
        };
        self.points().into_iter().enumerate().map(circle).collect()
    }

    /// `theta(alpha)`, the angle of the tangent against the x axis.
    pub fn angle_at(&self, alpha: f64) -> f64 {
        alpha + self.real_part(&self.angle, alpha)
    }

    /// The curvature at `alpha`.
    pub fn curvature_at(&self, alpha: f64) -> f64 {
        (1.0 + self.real_part(&self.grid.derivative(&self.angle), alpha)) / self.scale
    }

    fn real_part(&self, coefficients: &[Complex<f64>], alpha: f64) -> f64 {
        let sum = power_sum(coefficients, Complex::cis(self.grid.folds as f64 * alpha));
        2.0 * sum.re - coefficients[0].re
    }

    fn series(&self) -> Series {
        Series::positions(&self.grid, &self.grid.values(&self.angle))
    }

    fn placed(&self, z: Complex<f64>) -> [f64; 2] {
        [
            self.centre[0] + self.scale * z.re,
            self.centre[1] + self.scale * z.im,
        ]
    }

    /// The rate `dt / dtau` of the time against that of the curve scaled to length `2 pi`.
    pub(crate) fn clock(&self, flow: Flow) -> f64 {
        self.scale.powi(flow.order())
    }

    /// The same curve on fewer points where it shows the last third of its modes to be negligible, or on more where they are not
    /// small against the tolerance; numbers of points are `2^k` and `3 2^k`.
    pub(crate) fn fitted(&self, tolerance: f64) -> Result<Self, Error> {
        const NEGLIGIBLE: f64 = 1e-4; // of the tolerance
        const FEWEST_POINTS: usize = 32;
        let points = self.grid.points;
        let (fewer, more) = if points.is_power_of_two() {
            (points / 4 * 3, points / 2 * 3)
        } else {
            (points / 3 * 2, points / 3 * 4)
        };
        let tail = |first: usize| largest(&self.angle[first..]);
        if points > FEWEST_POINTS && tail(fewer / 3) < NEGLIGIBLE * tolerance {
            self.with_points(fewer).fitted(tolerance)
        } else if tail(points / 3) <= tolerance {
            Ok(self.clone())
        } else if points * self.grid.folds < MOST_POINTS {
            Ok(self.with_points(more))
        } else {
            Err(Error::Unresolved {
                points: points * self.grid.folds,
                time: self.time,
            })
        }
    }

    /// The same curve on another number of points per period, which must resolve it.
    pub(crate) fn with_points(&self, points: usize) -> Self {
        let mut angle = self.angle.clone();
        angle.resize(points / 2 + 1, Complex::ZERO);
        angle[points / 2] = Complex::ZERO;
        Self {
            grid: Grid::new(self.grid.folds, points),
            angle,
            ..self.clone()
        }
    }

    /// The same curve without the use of its rotational symmetry.
    pub(crate) fn unfolded(&self) -> Self {
        let folds = self.grid.folds;
        let grid = Grid::new(1, self.grid.points * folds);
        let mut angle = vec![Complex::ZERO; grid.points / 2 + 1];
        for (spread, c) in angle.iter_mut().step_by(folds).zip(&self.angle) {
            *spread = *c;
        }
        Self {
            grid,
            angle,
            ..self.clone()
        }
    }

    /// The same curve with as many folds as its series shows, at most so many.
    pub(crate) fn folded(&self, most: usize) -> Self {
        let vanish = |folds: usize| {
            let mut others = self.angle.clone();
            for c in others.iter_mut().step_by(folds) {
                *c = Complex::ZERO;
            }
            largest(&others) < 1e-12
        };
        let divides = |folds: &usize| self.grid.points.is_multiple_of(2 * folds);
        let mut all = (2..=most).rev().filter(divides);
        match all.find(|&folds| vanish(folds)) {
            Some(folds) if self.grid.folds == 1 => Self {
                grid: Grid::new(folds, self.grid.points / folds),
                angle: self.angle.iter().copied().step_by(folds).collect(),
                ..self.clone()
            },
            _ => self.clone(),
        }
    }
}

fn largest(coefficients: &[Complex<f64>]) -> f64 {
    coefficients.iter().map(|c| c.norm()).fold(0.0, f64::max)
}
