//! Training data: spheres shrinking by mean curvature to the radius `R(t) = (r^2 - 2 (D - 1) t)^(1/2)`.

use burn::tensor::Tensor;
use chacha20::ChaCha8Rng;
use geometry::exact::mean_curvature_radius;
use geometry::optimal_profile;
use operators::ComputeDevice;
use rand::RngExt;
use rayon::prelude::*;
use serde::Serialize;

use super::Orbits;
use crate::ratios::offsets;
use crate::{Error, Ratios};

/// The paper's data: radii uniform in `[r_min, r_max]` on the unit cube, at the grid the ratios were chosen for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SphereData {
    /// Ratios of the operator to be trained.
    pub ratios: Ratios,
    /// Cells per unit length, `1 / h`.
    pub cells: usize,
    /// Smallest and largest radius, `[0.05, 0.4]` in the paper.
    pub radii: [f64; 2],
    /// Number of radii, 100 in the paper.
    pub count: usize,
}

impl SphereData {
    /// The paper's radii at a reference resolution of `cells` per unit length.
    ///
    /// # Errors
    /// [`Error::Ratios`]; [`Error::Training`] if the smallest sphere would vanish within the step or the largest does
    /// not fit into the unit cube.
    pub fn new(ratios: Ratios, cells: usize) -> Result<Self, Error> {
        let data = Self {
            ratios,
            cells,
            radii: [0.05, 0.4],
            count: 100,
        };
        data.validate()?;
        Ok(data)
    }

    /// The same with few radii, for a smoke test.
    #[must_use]
    pub fn quick(self) -> Self {
        Self { count: 12, ..self }
    }

    /// Checks the settings after a change.
    pub fn validate(&self) -> Result<(), Error> {
        self.ratios.validate()?;
        let [low, high] = self.radii;
        if self.count == 0 || self.cells < self.ratios.width {
            return Err(Error::Training(format!(
                "{} radii on a grid of {} cells cannot train a kernel of width {}",
                self.count, self.cells, self.ratios.width
            )));
        }
        if !(low > 0.0 && low < high && high < 0.5 && self.shrunk(low) > 0.0) {
            return Err(Error::Training(format!(
                "radii [{low}, {high}] must lie in (0, 0.5) and survive a step of {:e}",
                self.step()
            )));
        }
        Ok(())
    }

    /// Grid spacing `h`.
    pub fn spacing(&self) -> f64 {
        1.0 / self.cells as f64
    }

    /// Interface width `eps`.
    pub fn eps(&self) -> f64 {
        self.ratios.eps_over_h * self.spacing()
    }

    /// Time step `tautilde` of the mean curvature flow.
    pub fn step(&self) -> f64 {
        self.ratios.step_over_h2 * self.spacing() * self.spacing()
    }

    /// `count` radii, one uniform in each of as many equal parts of the range: uniform, but with little chance in the
    /// mean, which the few smallest spheres dominate.
    pub fn draw_radii(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let [low, high] = self.radii;
        let part = (high - low) / count as f64;
        (0..count)
            .map(|i| low + part * (i as f64 + rng.random_range(0.0..1.0)))
            .collect()
    }

    /// The radius `sqrt(r^2 - 2 (D - 1) tautilde)` after the step.
    pub fn shrunk(&self, radius: f64) -> f64 {
        mean_curvature_radius(radius, self.step(), self.ratios.dimension)
    }

    /// Nodal values of a sphere about the middle of the unit cube, row-major.
    pub fn sphere(&self, radius: f64) -> Vec<f64> {
        let (n, h, eps) = (self.cells, self.spacing(), self.eps());
        (0..n.pow(self.ratios.dimension as u32))
            .into_par_iter()
            .with_min_len(4096)
            .map(|mut i| {
                let mut squared = 0.0;
                for _ in 0..self.ratios.dimension {
                    let x = (i % n) as f64 - (n / 2) as f64;
                    squared += x * x;
                    i /= n;
                }
                optimal_profile(h * squared.sqrt() - radius, eps)
            })
            .collect()
    }

    /// Spheres of these radii before the step, and what it makes of them, both `[radii, n, .., n]`.
    ///
    /// # Panics
    /// Unless the rank `R` is one more than the dimension.
    pub fn pairs<const R: usize>(
        &self,
        radii: &[f64],
        device: &ComputeDevice,
    ) -> (Tensor<R>, Tensor<R>) {
        let mut shape = [self.cells; R];
        shape[0] = radii.len();
        let stack = |f: &dyn Fn(f64) -> f64| {
            let values: Vec<f64> = radii.iter().flat_map(|&r| self.sphere(f(r))).collect();
            device.tensor::<R>(&values, shape)
        };
        (stack(&|r| r), stack(&|r| self.shrunk(r)))
    }
}

/// Samples of the training problem `F(K * u_r) = u_R` inside the interface band, for symmetric kernels.
///
/// Points need not be grid nodes: a kernel placed on any point of the plane sees a shifted circle, so random positions
/// cover the sub-cell shifts that a centred grid misses. Rows are weighted to sum to the loss over the whole unit cube.
#[derive(Clone, Debug)]
pub struct BandSamples {
    /// `sum` over each orbit of `u_r(x + h b)`: `[rows, orbits]`, row-major.
    pub design: Vec<f64>,
    /// `u_R(x)`.
    pub target: Vec<f64>,
    /// Quadrature weights; `sum weight (F(design k) - target)^2` is the loss.
    pub weight: Vec<f64>,
    /// Loss of the identity map on these samples.
    pub identity_loss: f64,
}

/// Half-width of the band in units of `eps`; beyond it the profile is within `1e-4` of a pure phase.
pub(super) const BAND: f64 = 7.0;

impl BandSamples {
    /// `shells` strata across the band, `directions` random points on each, for every radius.
    ///
    /// Rows of the pure phases and, with weight `flipped`, of the exchanged phases `-u` are appended.
    pub fn draw(
        data: &SphereData,
        orbits: &Orbits,
        shells: usize,
        directions: usize,
        flipped: f64,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let radii = data.draw_radii(data.count, rng);
        let (eps, dimension) = (data.eps(), data.ratios.dimension);
        let mut points = Vec::new();
        let mut outside = 0.0;
        let mut inside = 0.0;
        for &radius in &radii {
            let low = (radius - BAND * eps).max(0.0);
            let high = radius + BAND * eps;
            let thickness = (high - low) / shells as f64;
            for shell in 0..shells {
                for _ in 0..directions {
                    let rho = low + thickness * (shell as f64 + rng.random_range(0.0..1.0));
                    let weight = sphere_area(dimension, rho) * thickness / directions as f64;
                    points.push((radius, direction(dimension, rho, rng), weight));
                }
            }
            inside += ball_volume(dimension, low);
            outside += (1.0 - ball_volume(dimension, high)).max(0.0);
        }
        let count = radii.len() as f64;
        let offsets: Vec<Vec<f64>> = offsets(dimension, data.ratios.width)
            .map(|b| b.into_iter().map(|b| b as f64 * data.spacing()).collect())
            .collect();
        let n = orbits.count();
        let mut design = vec![0.0; points.len() * n];
        design
            .par_chunks_mut(n)
            .zip(&points)
            .for_each(|(row, (radius, x, _))| {
                for (offset, &orbit) in offsets.iter().zip(&orbits.index) {
                    let squared: f64 = x.iter().zip(offset).map(|(x, b)| (x + b) * (x + b)).sum();
                    row[orbit] += optimal_profile(squared.sqrt() - radius, eps);
                }
            });
        let mut target: Vec<f64> = points
            .iter()
            .map(|(radius, x, _)| optimal_profile(norm(x) - data.shrunk(*radius), eps))
            .collect();
        let mut weight: Vec<f64> = points.iter().map(|(_, _, weight)| weight / count).collect();
        let identity_loss = points
            .iter()
            .zip(&target)
            .zip(&weight)
            .map(|(((radius, x, _), target), weight)| {
                let step = optimal_profile(norm(x) - radius, eps) - target;
                weight * step * step
            })
            .sum();
        let sizes: Vec<f64> = orbits.sizes.iter().map(|&s| s as f64).collect();
        for (phase, area) in [(1.0, inside), (-1.0, outside)] {
            design.extend(sizes.iter().map(|s| phase * s));
            target.push(phase);
            weight.push(area / count);
        }
        if flipped > 0.0 {
            let rows = target.len();
            design.extend_from_within(..);
            design[rows * n..].iter_mut().for_each(|v| *v = -*v);
            target.extend_from_within(..);
            target[rows..].iter_mut().for_each(|v| *v = -*v);
            weight.extend_from_within(..);
            weight[rows..].iter_mut().for_each(|w| *w *= flipped);
        }
        Self {
            design,
            target,
            weight,
            identity_loss,
        }
    }
}

fn sphere_area(dimension: usize, radius: f64) -> f64 {
    let tau = std::f64::consts::TAU;
    if dimension == 2 {
        tau * radius
    } else {
        2.0 * tau * radius * radius
    }
}

fn ball_volume(dimension: usize, radius: f64) -> f64 {
    sphere_area(dimension, radius) * radius / dimension as f64
}

pub(super) fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A random point at distance `rho` from the origin.
pub(super) fn direction(dimension: usize, rho: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    loop {
        let x: Vec<f64> = (0..dimension)
            .map(|_| rng.random_range(-1.0..1.0))
            .collect();
        let length = norm(&x);
        // Rejection makes the direction uniform on the sphere.
        if length <= 1.0 && length > 1e-3 {
            return x.into_iter().map(|x| x * rho / length).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::tests::ratios;
    use rand::SeedableRng;

    fn data(dimension: usize) -> SphereData {
        SphereData::new(ratios(dimension, 17), 128).unwrap()
    }

    #[test]
    fn identity_scores_9_2e_6_at_n_128() {
        let data = data(2);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let radii = data.draw_radii(100, &mut rng);
        let loss: f64 = radii
            .iter()
            .map(|&r| {
                let (u, v) = (data.sphere(r), data.sphere(data.shrunk(r)));
                u.iter()
                    .zip(&v)
                    .map(|(u, v)| (u - v) * (u - v))
                    .sum::<f64>()
                    / u.len() as f64
            })
            .sum::<f64>()
            / 100.0;
        assert!((loss / 9.2e-6 - 1.0).abs() < 0.2, "{loss:e}");
        let samples = BandSamples::draw(&data, &Orbits::new(2, 17), 32, 4, 0.0, &mut rng);
        assert!(
            (samples.identity_loss / loss - 1.0).abs() < 0.15,
            "{:e}",
            samples.identity_loss
        );
    }

    #[test]
    fn weights_add_up_to_the_cube_and_flipped_rows_mirror() {
        for dimension in [2, 3] {
            let data = SphereData {
                count: 5,
                ..data(dimension)
            };
            let mut rng = ChaCha8Rng::seed_from_u64(2);
            let orbits = Orbits::new(dimension, 17);
            let samples = BandSamples::draw(&data, &orbits, 200, 1, 0.5, &mut rng);
            let rows = samples.target.len() / 2;
            let total: f64 = samples.weight[..rows].iter().sum();
            assert!((total - 1.0).abs() < 0.05, "{dimension}D: {total}");
            assert!((samples.target[rows] + samples.target[0]).abs() < f64::EPSILON);
            assert!((samples.weight[rows] - 0.5 * samples.weight[0]).abs() < 1e-15);
        }
    }

    #[test]
    fn refuses_spheres_that_vanish_or_do_not_fit() {
        let mut data = data(2);
        data.radii = [0.001, 0.4];
        assert!(matches!(data.validate(), Err(Error::Training(_))));
        data.radii = [0.05, 0.6];
        assert!(matches!(data.validate(), Err(Error::Training(_))));
    }
}
