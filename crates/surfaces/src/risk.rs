//! Which of several smoothings of a noisy mesh is nearest to the mesh without noise.

use std::collections::BTreeMap;
use std::ops::{Add, Div, Mul, Sub};

use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use crate::TriangleMesh;
use crate::smoothing::{Smoothed, TAUBIN, Umbrellas};
use crate::vector::Vector;

/// Fields of random signs by which degrees of freedom are estimated.
const PROBES: usize = 8;
const SEED: u64 = 1;

/// The values of all fields of signs, or of what becomes of them, at a vertex: neighbours are looked up once for all of them.
#[derive(Clone, Copy, Default)]
struct Probes([f64; PROBES]);

impl Probes {
    fn with(self, other: Self, combined: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|k| combined(self.0[k], other.0[k])))
    }

    fn mean_product(self, other: Self) -> f64 {
        let products = self
            .0
            .iter()
            .zip(other.0)
            .map(|(a, b)| a * b / PROBES as f64);
        products.sum()
    }
}

impl Add for Probes {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Probes {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl Mul<f64> for Probes {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|value| value * factor))
    }
}

impl Div<f64> for Probes {
    type Output = Self;

    fn div(self, divisor: f64) -> Self {
        Self(self.0.map(|value| value / divisor))
    }
}

impl Smoothed for Probes {}

/// A noisy mesh, by which smoothings of it are judged.
///
/// Let `y` be the heights of its vertices along the normals, wrong by independent noise with the standard deviation `s`, and `f(y)` a smoothing. Stein's
/// unbiased estimate of its risk, the mean of `(f(y) - x)^2` for the heights `x` without noise, is the mean of
///
/// ```text
/// (f_i(y) - y_i)^2 - s^2 + 2 s^2 df_i/dy_i .
/// ```
///
/// The derivatives are the degrees of freedom that a smoothing leaves to each vertex. Let `b` be random signs; then `b_i (f_i(y + h b) - f_i(y)) / h` has
/// them as its mean. Risks are in units of `s^2` here, and means are over neighbours.
///
/// C. M. Stein: Estimation of the mean of a multivariate normal distribution. Ann. Statist. 9 (1981). S. Ramani, T. Blu, M. Unser: Monte-Carlo SURE. IEEE
/// Trans. Image Process. 17 (2008).
pub(crate) struct Judge<'a> {
    rough: &'a TriangleMesh,
    umbrellas: &'a Umbrellas,
    /// The normals along which heights are measured.
    normals: Vec<Vector>,
    noise: f64,
}

impl<'a> Judge<'a> {
    /// Of smoothings near a smooth mesh.
    pub(crate) fn new(
        rough: &'a TriangleMesh,
        umbrellas: &'a Umbrellas,
        smooth: &TriangleMesh,
        noise: f64,
    ) -> Self {
        let normals = smooth.vertex_normals().into_iter().map(Vector::from_array);
        Self {
            rough,
            umbrellas,
            normals: normals.collect(),
            noise,
        }
    }

    /// `(f_i(y) - y_i)^2` in units of the variance of the noise.
    pub(crate) fn squared_residuals(&self, smoothed: &TriangleMesh) -> Vec<f64> {
        let heights = self.heights(self.rough, smoothed).into_iter();
        heights
            .map(|height| (height / self.noise).powi(2))
            .collect()
    }

    /// The degrees of freedom that numbers of rounds of Taubin's smoothing leave to each vertex, by these numbers.
    pub(crate) fn freedoms_of_taubin(
        &self,
        rounds: impl IntoIterator<Item = usize>,
    ) -> BTreeMap<usize, Vec<f64>> {
        let mut freedoms: BTreeMap<_, _> = rounds.into_iter().map(|r| (r, Vec::new())).collect();
        let mut probes = vec![Probes::default(); self.normals.len()];
        for (number, probe) in self.probes().enumerate() {
            for (probes, sign) in probes.iter_mut().zip(probe) {
                probes.0[number] = sign;
            }
        }
        let (mut responses, mut done) = (probes.clone(), 0);
        for (&rounds, freedom) in &mut freedoms {
            // The rounds go on from those before.
            self.umbrellas.smooth(&mut responses, rounds - done, TAUBIN);
            done = rounds;
            let pairs = responses.iter().zip(&probes);
            *freedom = pairs
                .map(|(response, probe)| response.mean_product(*probe))
                .collect();
        }
        freedoms
    }

    /// Those that a smoothing leaves which makes `smoothed` of the rough mesh. One field of signs is enough for means over many vertices.
    pub(crate) fn freedom_of(
        &self,
        smoothed: &TriangleMesh,
        smoothing: impl Fn(&TriangleMesh) -> TriangleMesh,
    ) -> Vec<f64> {
        /// Of the noise: small enough for a derivative, and large beside rounding.
        const STEP: f64 = 0.1;
        let step = STEP * self.noise;
        let probe = self.probes().next().unwrap_or_default();
        let offset = probe.iter().zip(&self.normals).map(|(b, n)| step * b * *n);
        let moved = smoothing(&self.rough.moved_by(&offset.collect::<Vec<_>>()));
        let responses = self.heights(smoothed, &moved).into_iter();
        responses
            .zip(probe)
            .map(|(response, b)| b * response / step)
            .collect()
    }

    /// Means over some neighbours: so many rounds in which each value goes halfway to the mean of its neighbours.
    pub(crate) fn averaged(&self, mut values: Vec<f64>, rounds: usize) -> Vec<f64> {
        self.umbrellas.smooth(&mut values, rounds, [0.5, 0.0]);
        values
    }

    fn heights(&self, from: &TriangleMesh, to: &TriangleMesh) -> Vec<f64> {
        let pairs = from.points().into_iter().zip(to.points());
        let heights = pairs.zip(&self.normals).map(|((a, b), n)| (b - a).dot(*n));
        heights.collect()
    }

    /// The same ones each time.
    fn probes(&self) -> impl Iterator<Item = Vec<f64>> {
        let count = self.normals.len();
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut sign = move || if rng.random::<bool>() { 1.0 } else { -1.0 };
        (0..PROBES).map(move |_| (0..count).map(|_| sign()).collect())
    }
}
