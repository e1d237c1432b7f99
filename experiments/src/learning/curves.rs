//! Plane curves with their exact Willmore flow, and direct steps beside it.

use chacha20::ChaCha8Rng;
use direct::DirectSteps;
use geometry::{Redistanced, parallel};
use rand::{RngExt, SeedableRng};
use reference::{Curve, Flow, Shape, planar};

use crate::networks::STEP;
use crate::prelude::libraries::*;

/// The spacing of grids over the radius of curvature: the grid resolves the kernels of steps of `7e-5 / kappa^4` and longer ones.
const SPACING: f64 = 0.045;
/// Distances to curves are exact up to this, in spacings, and infinite beyond.
const KNOWN: f64 = 14.0;
/// Nodes between a curve and the side of its box: the kernels of the longest steps do not reach the periodic image.
const MARGIN: f64 = 24.0;
/// Sides of grids are multiples of this, the side of the blocks in which distances are found to be far.
const BLOCK: usize = 16;
/// Errors are measured at nodes up to this distance from the interface, in spacings,
const MEASURED: f64 = 1.0;
/// and corrections are taught up to this one, at about so many of the nodes.
const TAUGHT: f64 = 3.0;
const NODES: usize = 150;
/// Smooth curves have flowed for this time, in radii of curvature to the fourth power, since an exact flow does not know its start.
const BEGINNING: f64 = 1e-9;

/// A curve on its grid, and its exact flow.
pub struct Example {
    pub name: String,
    shape: Shape,
    time: f64,
    /// The largest curvature, or more of a curve that stands for a part of a sharper one; all lengths and times are relative to it.
    pub curvature: f64,
    pub grid: Grid<2>,
    /// Signed distances at the nodes, infinite far away.
    pub distances: Vec<f64>,
}

impl Example {
    /// A shape after some time, on a grid for this many times its largest curvature.
    fn new(name: impl Into<String>, shape: Shape, time: f64, sharper: f64) -> Result<Self> {
        const SAMPLES: u32 = 1024;
        let curve = flowed(&shape, &[time])?.remove(0);
        let curvature = |k: u32| curve.curvature_at(2.0 * PI * f64::from(k) / f64::from(SAMPLES));
        let largest = (0..SAMPLES).map(|k| curvature(k).abs());
        let curvature = sharper * largest.fold(0.0, f64::max);
        let h = SPACING / curvature;
        let reached = curve.points().into_iter().flatten();
        let reached = reached.fold(0.0, |most: f64, x| most.max(x.abs()));
        let cells = (2.0 * (reached / h + MARGIN)) as usize;
        let cells = cells.next_multiple_of(BLOCK);
        let grid = Grid::centred(cells, cells as f64 * h)?;
        Ok(Self {
            name: name.into(),
            distances: distances(&curve, &grid),
            shape,
            time,
            curvature,
            grid,
        })
    }

    /// The step of this many radii of curvature to the fourth power.
    pub fn tau(&self, part: f64) -> f64 {
        part / self.curvature.powi(4)
    }

    /// The exact curves after these times.
    pub fn exact(&self, after: &[f64]) -> Result<Vec<Curve>> {
        let times: Vec<f64> = after.iter().map(|after| self.time + after).collect();
        flowed(&self.shape, &times)
    }

    /// A direct step of this many radii of curvature to the fourth power, beside the exact one.
    pub fn pair(&self, part: f64) -> Result<Pair<'_>> {
        let tau = self.tau(part);
        let exact = self.exact(&[tau])?.remove(0).signed_distance();
        let mut steps = DirectSteps::new(self.grid);
        let derived = steps.step(&self.distances, tau);
        let near = |limit: f64| -> Vec<usize> {
            let limit = limit * self.grid.spacing();
            let nodes = 0..self.grid.len();
            nodes
                .filter(|node| derived.distances[*node].abs() <= limit)
                .collect()
        };
        let (taught, measured) = (near(TAUGHT), near(MEASURED));
        let thinned = (taught.len() / NODES).max(1);
        let taught: Vec<usize> = taught.into_iter().step_by(thinned).collect();
        let after =
            |nodes: &[usize]| parallel::values(nodes.len(), |k| exact(self.grid.node(nodes[k])));
        Ok(Pair {
            example: self,
            part,
            tau,
            targets: after(&taught),
            exact: after(&measured),
            taught,
            measured,
            derived,
        })
    }
}

fn flowed(shape: &Shape, times: &[f64]) -> Result<Vec<Curve>> {
    let curves = planar::evolve(shape, Flow::Willmore, times, &planar::ACCURACY)?;
    Ok(curves)
}

/// The distances to a curve, infinite in blocks that are far from it.
fn distances(curve: &Curve, grid: &Grid<2>) -> Vec<f64> {
    let (exact, blocks) = (curve.signed_distance(), grid.cells() / BLOCK);
    let far = KNOWN + 0.5_f64.sqrt() * BLOCK as f64;
    let of_block = parallel::values(blocks * blocks, |block| {
        let middle = |index: usize| BLOCK * index + BLOCK / 2;
        let node = grid.index([middle(block / blocks), middle(block % blocks)]);
        exact(grid.node(node))
    });
    parallel::values(grid.len(), |node| {
        let [i, j] = grid.multi_index(node).map(|index| index / BLOCK);
        let middle = of_block[i * blocks + j];
        if middle.abs() > far * grid.spacing() {
            middle.signum() * f64::INFINITY
        } else {
            exact(grid.node(node))
        }
    })
}

/// A direct step of an example, and the exact distances after it.
pub struct Pair<'a> {
    pub example: &'a Example,
    /// `tau` times the fourth power of the curvature of the example.
    pub part: f64,
    pub tau: f64,
    pub derived: Redistanced<2>,
    /// Nodes near the interface, at which corrections are taught, and the exact distances there.
    pub taught: Vec<usize>,
    pub targets: Vec<f64>,
    /// Nodes next to the interface, at which errors are measured, and the exact distances there.
    measured: Vec<usize>,
    exact: Vec<f64>,
}

impl Pair<'_> {
    /// The root of the mean square of the exact motion, and the largest motion, next to the interface.
    pub fn motion(&self) -> [f64; 2] {
        self.apart(&self.example.distances)
    }

    /// The errors of distances after the step over the motion: the root of the mean square, and the largest one over the largest motion.
    pub fn errors(&self, distances: &[f64]) -> [f64; 2] {
        let ([mean, largest], motion) = (self.apart(distances), self.motion());
        [mean / motion[0], largest / motion[1]]
    }

    fn apart(&self, distances: &[f64]) -> [f64; 2] {
        let nodes = self.measured.iter().zip(&self.exact);
        let gaps = nodes.map(|(node, exact)| (distances[*node] - exact).abs());
        let (sum, largest) = gaps.fold((0.0, 0.0_f64), |(sum, largest), gap| {
            (sum + gap * gap, largest.max(gap))
        });
        [(sum / self.measured.len() as f64).sqrt(), largest]
    }
}

/// Random curves: the same seed gives the same ones.
pub struct Curves(ChaCha8Rng);

impl Curves {
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self(rng)
    }

    /// A circle about any place, on a grid for one up to 1.5 times as sharp: so `tau kappa^4` is down to a fifth of that of the step.
    pub fn circle(&mut self, name: impl Into<String>) -> Result<Example> {
        let centre = [0, 1].map(|_| self.0.random_range(-0.05..0.05));
        let sharper = self.0.random_range(1.0..1.5);
        Example::new(name, Shape::circle(centre, 1.0)?, BEGINNING, sharper)
    }

    pub fn ellipse(&mut self, name: impl Into<String>) -> Result<Example> {
        let shape = Shape::ellipse(1.0, self.0.random_range(0.5..0.9))?;
        Example::new(name, shape, BEGINNING, 1.0)
    }

    /// A circle with random waves: large ones of the numbers 2 to 5, and small ones of the numbers 6 to 20. By its fourth derivatives a small wave moves
    /// a third as fast as the circle.
    pub fn waves(&mut self, name: impl Into<String>) -> Result<Example> {
        const POINTS: usize = 256;
        let wave = |m: u32| {
            let number = f64::from(m);
            let size = if m <= 5 { 0.12 } else { 0.3 };
            let amplitude =
                size * self.0.random_range(-1.0..1.0) / number.powi(if m <= 5 { 2 } else { 4 });
            [number, amplitude, self.0.random_range(0.0..2.0 * PI)]
        };
        let waves: Vec<[f64; 3]> = (2..=5)
            .chain([6, 8, 10, 12, 14, 16, 18, 20])
            .map(wave)
            .collect();
        let point = |k: usize| {
            let angle = 2.0 * PI * k as f64 / POINTS as f64;
            let wave = |[number, size, phase]: &[f64; 3]| size * (number * angle + phase).cos();
            let radius = 1.0 + waves.iter().map(wave).sum::<f64>();
            [radius * angle.cos(), radius * angle.sin()]
        };
        let points: Vec<[f64; 2]> = (0..POINTS).map(point).collect();
        Example::new(name, Shape::smooth(&points)?, BEGINNING, 1.0)
    }
}

impl Example {
    /// An ellipse of the half axes 3 and 2.
    pub fn held_out_ellipse() -> Result<Self> {
        Self::new("ellipse", Shape::ellipse(3.0, 2.0)?, BEGINNING, 1.0)
    }

    /// The cross of the other experiments, after 32 of their steps.
    pub fn cross() -> Result<Self> {
        Self::new("cross", Shape::cross(0.8, 0.27)?, 32.0 * STEP, 1.0)
    }

    /// Their rectangle, likewise.
    pub fn rectangle() -> Result<Self> {
        Self::new("rectangle", Shape::rectangle(0.2, 0.1)?, 32.0 * STEP, 1.0)
    }

    /// A circle of radius 1.
    pub fn unit_circle() -> Result<Self> {
        Self::new("circle", Shape::circle([0.0, 0.0], 1.0)?, BEGINNING, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motion_of_a_circle_is_that_of_its_radius() {
        let circle = Curves::new(3, 0).circle("circle").unwrap();
        let tau = circle.tau(1e-3);
        let pair = circle.pair(1e-3).unwrap();
        let moved = (1.0 + 2.0 * tau).powf(0.25) - 1.0;
        for motion in pair.motion() {
            assert!((motion / moved - 1.0).abs() < 1e-4, "{motion} {moved}");
        }
        let [mean, largest] = pair.errors(&pair.derived.distances);
        assert!(mean > 0.0 && largest < 3e-2, "{mean} {largest}");
    }

    #[test]
    fn random_curves_differ_and_come_back_with_their_seed() {
        let draw = |seed| Curves::new(seed, 1).waves("waves").unwrap().distances;
        assert_eq!(draw(5), draw(5));
        assert_ne!(draw(5), draw(6));
    }
}
