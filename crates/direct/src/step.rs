//! One direct step, from distances to distances.

use std::f64::consts::{PI, TAU};

use geometry::{DistanceRange, Grid, LevelPoint, Redistanced, parallel};
use operators::SpectralFilter;

use crate::Kernel;
use crate::profile::Profile;

/// The size of the shortest step in spacings to the fourth power: the heat kernels are three spacings wide.
const SHORTEST: f64 = 17.0;
/// Convolutions of the last sizes of steps, which are prepared.
const PREPARED: usize = 2;

/// How far from the zero level the distances of a step are needed.
#[derive(Clone, Copy)]
pub(crate) enum Needed {
    /// As far as the next step convolves.
    Near,
    /// Everywhere.
    All,
}

/// Single direct steps of first order on a grid, from distances to distances, with what is prepared for their sizes.
///
/// ```
/// use direct::DirectSteps;
/// use geometry::{Grid, exact::willmore_radius};
///
/// let grid = Grid::<2>::centred(64, 1.0)?;
/// let disc: Vec<f64> = (0..grid.len()).map(|i| grid.node(i)).map(|[x, y]| x.hypot(y) - 0.25).collect();
/// let mut steps = DirectSteps::new(grid);
/// let (tau, node) = (steps.shortest(), grid.nearest([0.25, 0.0]));
/// let moved = disc[node] - steps.step(&disc, tau).distances[node];
/// let exact = willmore_radius(0.25, tau, 2) - 0.25;
/// assert!((moved / exact - 1.0).abs() < 1e-2);
/// # Ok::<(), geometry::Error>(())
/// ```
pub struct DirectSteps<const D: usize> {
    grid: Grid<D>,
    /// Convolutions by the size of their step.
    prepared: Vec<(f64, SpectralFilter)>,
}

impl<const D: usize> DirectSteps<D> {
    /// The steps on a grid, before anything is prepared.
    pub fn new(grid: Grid<D>) -> Self {
        Self {
            grid,
            prepared: Vec::new(),
        }
    }

    /// The grid.
    pub fn grid(&self) -> &Grid<D> {
        &self.grid
    }

    /// The distances to the zero level of what is nearly a distance.
    pub fn level(&self, distances: &[f64]) -> Redistanced<D> {
        Redistanced::from_distances(self.grid, distances, self.range(Needed::All))
    }

    fn range(&self, needed: Needed) -> DistanceRange {
        let precise = Profile::PURE * self.grid.spacing();
        let largest = match needed {
            Needed::Near => precise,
            Needed::All => f64::INFINITY,
        };
        DistanceRange { precise, largest }
    }

    /// The size of the shortest step whose kernel the grid resolves.
    pub fn shortest(&self) -> f64 {
        SHORTEST * self.grid.spacing().powi(4)
    }

    /// The kernel of a step of size `tau`.
    pub fn kernel(&self, tau: f64) -> Kernel {
        Kernel::new(self.grid.spacing(), tau)
    }

    /// The distances after a step of size `tau`.
    ///
    /// # Panics
    /// Unless there is a distance for each node; so do the functions below.
    pub fn step(&mut self, distances: &[f64], tau: f64) -> Redistanced<D> {
        self.step_as(distances, tau, Needed::All)
    }

    /// The same as far as distances are needed, and infinite beyond.
    pub(crate) fn step_as(
        &mut self,
        distances: &[f64],
        tau: f64,
        needed: Needed,
    ) -> Redistanced<D> {
        let values = self.convolved(distances, tau);
        self.finished_as(values, tau, needed)
    }

    /// `K * q(s)`, whose gradient at the interface is nearly 2.
    pub fn convolved(&mut self, distances: &[f64], tau: f64) -> Vec<f64> {
        let values = self.profiles(distances);
        self.filter(tau).apply(&values)
    }

    /// The same with each of the [heat kernels](Kernel::heat_kernels) alone, without their weights.
    pub fn smoothed(&self, distances: &[f64], tau: f64) -> [Vec<f64>; 4] {
        let (values, kernel) = (self.profiles(distances), self.kernel(tau));
        let heat_kernels = kernel.heat_kernels();
        heat_kernels.map(|heat| self.spectral(|square| heat.symbol(square)).apply(&values))
    }

    /// The end of a step: the distances to the zero level of what the convolution gave, with the correction for the [excess](Kernel::excess).
    pub fn finished(&self, values: Vec<f64>, tau: f64) -> Redistanced<D> {
        self.finished_as(values, tau, Needed::All)
    }

    fn finished_as(&self, values: Vec<f64>, tau: f64, needed: Needed) -> Redistanced<D> {
        let mut made = Redistanced::from_values(self.grid, values, self.range(needed));
        let excess = 0.5 * tau * self.kernel(tau).excess();
        let shifts: Vec<f64> = made.points.iter().map(|p| excess * nonlinear(p)).collect();
        let (nearest, distances) = (&made.nearest, &made.distances);
        made.distances = parallel::values(distances.len(), |node| {
            let shift = shifts.get(nearest[node] as usize);
            distances[node] + shift.copied().unwrap_or(0.0)
        });
        made
    }

    /// The profile at the nodes.
    fn profiles(&self, distances: &[f64]) -> Vec<f64> {
        let profile = Profile {
            width: self.grid.spacing(),
        };
        parallel::values(distances.len(), |node| profile.of(distances[node]))
    }

    /// The convolution with this spectrum, a function of the squared wave number.
    fn spectral(&self, symbol: impl Fn(f64) -> f64) -> SpectralFilter {
        let h = self.grid.spacing();
        SpectralFilter::from_symbol(&self.grid.shape(), |theta| {
            let wave = |theta: &f64| if *theta > PI { *theta - TAU } else { *theta };
            symbol(theta.iter().map(|theta| (wave(theta) / h).powi(2)).sum())
        })
    }

    /// The convolution with the kernel of a step.
    fn filter(&mut self, tau: f64) -> SpectralFilter {
        let known = |(size, _): &&(f64, SpectralFilter)| size.to_bits() == tau.to_bits();
        if let Some((_, filter)) = self.prepared.iter().find(known) {
            return filter.clone();
        }
        let kernel = self.kernel(tau);
        let filter = self.spectral(|square| kernel.symbol(square));
        if self.prepared.len() >= PREPARED {
            self.prepared.remove(0);
        }
        self.prepared.push((tau, filter.clone()));
        filter
    }
}

/// `H (k1 - k2)^2` with the mean curvature `H`, which is `kappa^3` in the plane.
fn nonlinear<const D: usize>(point: &LevelPoint<D>) -> f64 {
    let sum = point.mean_curvature();
    sum * (2.0 * point.squared_curvatures() - sum * sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By which part a step of the size `x R^4` moves a circle of radius `R` too far; if it is a sphere, how far it moves over `x R`.
    fn error_of_step<const D: usize>(cells: usize, x: f64) -> f64 {
        const RADIUS: f64 = 0.5;
        let grid = Grid::<D>::centred(cells, 2.0).unwrap();
        let distance = |node: usize| {
            let square = grid.node(node).iter().map(|x| x * x).sum::<f64>();
            square.sqrt() - RADIUS
        };
        let distances = parallel::values(grid.len(), distance);
        let tau = x * RADIUS.powi(4);
        let made = DirectSteps::new(grid).step(&distances, tau);
        // The mean of the distances at the old level is minus the displacement.
        let (mut sum, mut count) = (0.0, 0.0);
        for (old, new) in distances.iter().zip(&made.distances) {
            if old.abs() < grid.spacing() {
                sum += old - new;
                count += 1.0;
            }
        }
        let moved = sum / count;
        match D {
            2 => moved / ((RADIUS.powi(4) + 2.0 * tau).powf(0.25) - RADIUS) - 1.0,
            _ => moved / (x * RADIUS),
        }
    }

    #[test]
    fn circles_move_too_slowly_by_a_part_that_grows_with_the_step() {
        for (x, error) in [(3e-4, -0.0058), (1e-3, -0.0240), (3e-3, -0.114)] {
            let found = error_of_step::<2>(192, x);
            assert!((found / error - 1.0).abs() < 0.05, "{x}: {found}");
        }
    }

    #[test]
    fn spheres_do_not_move() {
        let found = error_of_step::<3>(64, 1e-3);
        assert!(found.abs() < 1e-4, "{found}");
    }
}
