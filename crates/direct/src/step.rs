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

/// Direct steps on a grid, with what is prepared for their sizes.
pub(crate) struct DirectSteps<const D: usize> {
    grid: Grid<D>,
    prepared: Vec<(Kernel, f64, SpectralFilter)>,
}

impl<const D: usize> DirectSteps<D> {
    pub(crate) fn new(grid: Grid<D>) -> Self {
        Self {
            grid,
            prepared: Vec::new(),
        }
    }

    /// The distances to the zero level of a function, negative where it is.
    pub(crate) fn redistanced(&self, values: Vec<f64>, needed: Needed) -> Redistanced<D> {
        let precise = Profile::PURE * self.grid.spacing();
        let largest = match needed {
            Needed::Near => precise,
            Needed::All => f64::INFINITY,
        };
        Redistanced::from_values(self.grid, values, DistanceRange { precise, largest })
    }

    /// The size of the shortest step whose kernel the grid resolves.
    pub(crate) fn shortest(&self) -> f64 {
        SHORTEST * self.grid.spacing().powi(4)
    }

    /// The distances after a step of size `tau`; infinite where they are not needed.
    pub(crate) fn step(&mut self, distances: &[f64], tau: f64, needed: Needed) -> Redistanced<D> {
        let profile = Profile {
            width: self.grid.spacing(),
        };
        let values = parallel::values(distances.len(), |node| profile.of(distances[node]));
        let (kernel, filter) = self.filter(tau);
        let mut made = self.redistanced(filter.apply(&values), needed);
        let excess = 0.5 * tau * kernel.excess();
        let shifts: Vec<f64> = made.points.iter().map(|p| excess * nonlinear(p)).collect();
        let (nearest, distances) = (&made.nearest, &made.distances);
        made.distances = parallel::values(distances.len(), |node| {
            let shift = shifts.get(nearest[node] as usize);
            distances[node] + shift.copied().unwrap_or(0.0)
        });
        made
    }

    /// The kernel of a step, and the convolution with it.
    fn filter(&mut self, tau: f64) -> (Kernel, SpectralFilter) {
        let known = |(_, size, _): &&(Kernel, f64, SpectralFilter)| size.to_bits() == tau.to_bits();
        if let Some((kernel, _, filter)) = self.prepared.iter().find(known) {
            return (*kernel, filter.clone());
        }
        let h = self.grid.spacing();
        let kernel = Kernel::new(h, tau);
        let filter = SpectralFilter::from_symbol(&self.grid.shape(), |theta| {
            let wave = |theta: &f64| if *theta > PI { *theta - TAU } else { *theta };
            kernel.symbol(theta.iter().map(|theta| (wave(theta) / h).powi(2)).sum())
        });
        if self.prepared.len() >= PREPARED {
            self.prepared.remove(0);
        }
        self.prepared.push((kernel, tau, filter.clone()));
        (kernel, filter)
    }
}

/// `h (k1 - k2)^2`, which is `kappa^3` in the plane.
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
        let made = DirectSteps::new(grid).step(&distances, tau, Needed::Near);
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
