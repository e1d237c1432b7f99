//! Fourier series of periodic functions on the nodes of a curve.

use std::f64::consts::{PI, TAU};
use std::sync::{Arc, OnceLock};

use fourier::Planned;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealToComplex};

pub(crate) type Coefficients = Vec<Complex<f64>>;

const I: Complex<f64> = Complex::new(0.0, 1.0);

/// The nodes `alpha_i = (i + 1/2) 2 pi / (folds points)`, `i < points`, of one period of functions with `folds` periods in `2 pi`.
///
/// A function is `sum_j c_j e^{i folds j alpha}`; stored are `c_0 .. c_{points/2}` of real functions. The last one, of which the
/// nodes see the sine only, is always zero. Nodes half a spacing away from zero avoid the axis of a surface of revolution.
pub(crate) struct Grid {
    pub(crate) folds: usize,
    pub(crate) points: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    phases: Coefficients,
    /// `e^{i alpha}` at the nodes.
    pub(crate) turns: Coefficients,
    pole_weights: OnceLock<Vec<f64>>,
}

impl Grid {
    pub(crate) fn new(folds: usize, points: usize) -> Arc<Self> {
        let plans = f64::plans(&[points]);
        Arc::new(Self {
            folds,
            points,
            forward: plans.real,
            inverse: plans.real_inverse,
            phases: collect(points / 2 + 1, |j| {
                Complex::cis(PI * j as f64 / points as f64)
            }),
            turns: collect(points, |i| {
                Complex::cis((i as f64 + 0.5) * TAU / (folds * points) as f64)
            }),
            pole_weights: OnceLock::new(),
        })
    }

    pub(crate) fn node(&self, i: usize) -> f64 {
        (i as f64 + 0.5) * TAU / (self.folds * self.points) as f64
    }

    /// The wave number of mode `j`.
    pub(crate) fn wave(&self, j: usize) -> f64 {
        (self.folds * j) as f64
    }

    /// The coefficients of the function with the given values at the nodes.
    pub(crate) fn expand(&self, value: impl Fn(usize) -> f64) -> Coefficients {
        self.coefficients(collect(self.points, value))
    }

    pub(crate) fn coefficients(&self, mut values: Vec<f64>) -> Coefficients {
        let mut result = self.forward.make_output_vec();
        self.forward
            .process(&mut values, &mut result)
            .expect("lengths are those of the plan");
        let scale = 1.0 / self.points as f64;
        for (c, phase) in result.iter_mut().zip(&self.phases) {
            *c *= phase.conj() * scale;
        }
        result[self.points / 2] = Complex::ZERO;
        result
    }

    pub(crate) fn values(&self, coefficients: &[Complex<f64>]) -> Vec<f64> {
        let mut shifted = collect(self.phases.len(), |j| coefficients[j] * self.phases[j]);
        shifted[0].im = 0.0;
        shifted[self.points / 2] = Complex::ZERO;
        let mut result = self.inverse.make_output_vec();
        self.inverse
            .process(&mut shifted, &mut result)
            .expect("lengths are those of the plan");
        result
    }

    pub(crate) fn derivative(&self, coefficients: &[Complex<f64>]) -> Coefficients {
        collect(coefficients.len(), |j| coefficients[j] * I * self.wave(j))
    }

    /// The antiderivative of mean zero of the function without its mean.
    pub(crate) fn antiderivative(&self, coefficients: &[Complex<f64>]) -> Coefficients {
        let mut result = collect(coefficients.len(), |j| coefficients[j] / (I * self.wave(j)));
        result[0] = Complex::ZERO;
        result
    }

    /// Weights of the integral over `0 < alpha < pi` of a function that is odd about 0 and, with two folds, even about `pi / 2`,
    /// from its values on the first half of the nodes: exact for its sine series.
    pub(crate) fn pole_weights(&self) -> &[f64] {
        self.pole_weights.get_or_init(|| {
            let nodes = self.folds * self.points / 2;
            let scale = (4 * self.folds) as f64 / nodes as f64;
            let odd = || (1..nodes).step_by(2).map(|k| k as f64);
            let weight = |alpha: f64| odd().map(|k| (k * alpha).sin() / k).sum::<f64>();
            collect(self.points / 2, |i| scale * weight(self.node(i)))
        })
    }
}

/// `f(0), f(1), ...`.
pub(crate) fn collect<T>(count: usize, f: impl Fn(usize) -> T) -> Vec<T> {
    (0..count).map(f).collect()
}

/// The function `e^{i alpha} sum_j q_j e^{i folds j alpha}` over positive and negative `j`, that of a curve with `folds`-fold symmetry.
pub(crate) struct Series {
    folds: usize,
    /// `q_0, q_1, ...`
    positive: Coefficients,
    /// `q_0, q_{-1}, ...`
    negative: Coefficients,
}

impl Series {
    /// The positions of the curve of length `2 pi` about its centre, by integration of its unit tangent `e^{i (alpha + angle)}`.
    pub(crate) fn positions(grid: &Grid, angle: &[f64]) -> Self {
        let (cos, sin) = (
            grid.expand(|i| angle[i].cos()),
            grid.expand(|i| angle[i].sin()),
        );
        let integrated = |tangent: Complex<f64>, wave: f64| match wave {
            0.0 => Complex::ZERO, // how far the curve is from being closed
            _ => tangent / (I * wave),
        };
        let positive = |j: usize| integrated(cos[j] + I * sin[j], 1.0 + grid.wave(j));
        let negative = |j: usize| integrated(cos[j].conj() + I * sin[j].conj(), 1.0 - grid.wave(j));
        Self {
            folds: grid.folds,
            positive: collect(cos.len(), positive),
            negative: collect(cos.len(), negative),
        }
    }

    pub(crate) fn at_nodes(&self, grid: &Grid) -> Coefficients {
        let (p, n) = (&self.positive, &self.negative);
        let real = grid.values(&collect(p.len(), |j| (p[j] + n[j].conj()) / 2.0));
        let imaginary = grid.values(&collect(p.len(), |j| (p[j] - n[j].conj()) / (2.0 * I)));
        collect(grid.points, |i| {
            grid.turns[i] * Complex::new(real[i], imaginary[i])
        })
    }

    pub(crate) fn at(&self, alpha: f64) -> Complex<f64> {
        let step = Complex::cis(self.folds as f64 * alpha);
        let negative = power_sum(&self.negative, step.conj()) - self.negative[0];
        (power_sum(&self.positive, step) + negative) * Complex::cis(alpha)
    }
}

/// `sum_j c_j z^j`.
pub(crate) fn power_sum(coefficients: &[Complex<f64>], z: Complex<f64>) -> Complex<f64> {
    let terms = coefficients.iter().rev();
    terms.fold(Complex::ZERO, |sum, c| sum * z + c)
}

/// Coefficients of `sum_j a_j sin(folds j alpha)`, `0 < j < points / 2`.
pub(crate) fn odd(sines: &[f64]) -> Coefficients {
    let ends = [Complex::ZERO];
    let inner = sines.iter().map(|a| Complex::new(0.0, -a / 2.0));
    ends.into_iter().chain(inner).chain(ends).collect()
}

/// The inverse of [`odd`].
pub(crate) fn sines(coefficients: &[Complex<f64>]) -> impl Iterator<Item = f64> {
    let inner = &coefficients[1..coefficients.len() - 1];
    inner.iter().map(|c| -2.0 * c.im)
}
