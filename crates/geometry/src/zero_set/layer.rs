//! The distance variable near the zero set, and what its sums and differences are made of.

use std::f64::consts::FRAC_2_SQRT_PI;
use std::sync::OnceLock;

use crate::error::positive;
use crate::{Error, Field, Grid, distance_from_phase_field, parallel, vector};

/// Width of the kernel in spacings of the grid.
const WIDTH: f64 = 1.25;
/// The wider of the two Gaussians in widths of the narrower.
const WIDER: f64 = 1.5;
/// Nodes farther than this from the zero set, in spacings, have no weight. Where that jumps to zero it is below rounding, so that the sums are
/// smooth functions of the nodal values.
const REACH: f64 = 10.0;
/// Central difference of sixth order: weights of the neighbours at one, two and three spacings; antisymmetric.
const WEIGHTS: [f64; 3] = [45.0 / 60.0, -9.0 / 60.0, 1.0 / 60.0];
/// Neighbours along an axis in a difference.
pub(super) const NEIGHBOURS: usize = 6;
/// Work on fewer values than this is not worth another thread.
pub(super) const SHARE: usize = 1 << 13;
/// Place of a node that is not in the layer.
const NOWHERE: u32 = u32::MAX;

/// A smeared delta function `c1 a_s + c2 a_r`, `a_s(d) = exp(-d^2/s^2) / (s sqrt pi)`, whose weights make the sum one and the second
/// moment zero: of fourth order.
#[derive(Clone, Copy)]
pub(super) struct Kernel {
    /// Weight and width of the two Gaussians.
    parts: [(f64, f64); 2],
}

impl Kernel {
    fn new(spacing: f64) -> Self {
        let narrow = WIDTH * spacing;
        let wider = -1.0 / (WIDER * WIDER - 1.0);
        Self {
            parts: [(1.0 - wider, narrow), (wider, WIDER * narrow)],
        }
    }

    fn sum(self, part: impl Fn(f64) -> f64) -> f64 {
        let [(a, narrow), (b, wide)] = self.parts;
        a * part(narrow) + b * part(wide)
    }

    /// The kernel.
    pub(super) fn value(self, d: f64) -> f64 {
        self.sum(|width| gaussian(d, width))
    }

    /// Its derivative.
    pub(super) fn slope(self, d: f64) -> f64 {
        self.sum(|width| -2.0 * d / (width * width) * gaussian(d, width))
    }

    /// Its second derivative.
    pub(super) fn curvature(self, d: f64) -> f64 {
        self.sum(|width| {
            let square = width * width;
            (4.0 * d * d / square - 2.0) / square * gaussian(d, width)
        })
    }

    /// Its integral from `d` on: one deep inside, zero outside.
    pub(super) fn inside(self, d: f64) -> f64 {
        // Beyond six widths the rest of the integral is below rounding.
        self.sum(|width| match d / width {
            t if t > 6.0 => 0.0,
            t if t < -6.0 => 1.0,
            t => 0.5 * libm::erfc(t),
        })
    }

    /// The narrower Gaussian, which is positive.
    pub(super) fn positive(self, d: f64) -> f64 {
        gaussian(d, self.parts[0].1)
    }
}

fn gaussian(d: f64, width: f64) -> f64 {
    let t = d / width;
    if t.abs() > 6.5 {
        // Below rounding.
        return 0.0;
    }
    0.5 * FRAC_2_SQRT_PI / width * (-t * t).exp()
}

/// The nodes near the zero set, and those that the differences there reach.
pub(super) struct Layer<const D: usize> {
    pub(super) grid: Grid<D>,
    pub(super) kernel: Kernel,
    reach: f64,
    /// The distance variable at all nodes of the grid.
    distance: Vec<f64>,
    /// The nodes of the layer in the order of the grid.
    pub(super) nodes: Vec<u32>,
    /// Where a node of the grid is in `nodes`.
    places: Vec<u32>,
    /// Along an axis, the nodes one to three spacings below and above.
    neighbours: Vec<[[usize; 2]; 3]>,
    gradients: OnceLock<Vec<[f64; D]>>,
    normals: OnceLock<Vec<[f64; D]>>,
}

impl<const D: usize> Layer<D> {
    pub(super) fn new(u: &Field<D>, eps: f64) -> Result<Self, Error> {
        positive("eps", eps)?;
        u.check_finite()?;
        let grid = *u.grid();
        let n = grid.cells();
        if u32::try_from(grid.len()).is_err() {
            return Err(Error::GridTooLarge {
                cells: n,
                dimension: D,
            });
        }
        let around = |i: usize| [1, 2, 3].map(|step| [(i + 3 * n - step) % n, (i + step) % n]);
        let distance = parallel::values(grid.len(), |node| {
            distance_from_phase_field(u.values()[node], eps)
        });
        let mut layer = Self {
            grid,
            kernel: Kernel::new(grid.spacing()),
            reach: REACH * grid.spacing(),
            distance,
            nodes: Vec::new(),
            places: vec![NOWHERE; grid.len()],
            neighbours: (0..n).map(around).collect(),
            gradients: OnceLock::new(),
            normals: OnceLock::new(),
        };
        layer.find_nodes();
        Ok(layer)
    }

    /// Gradients of the distance variable at the nodes of the layer, which the volume does not need.
    pub(super) fn gradients(&self) -> &[[f64; D]] {
        self.gradients.get_or_init(|| {
            self.map(|place| self.gradient(self.nodes[place] as usize, |i| self.distance[i]))
        })
    }

    /// Fills `nodes` and `places`.
    fn find_nodes(&mut self) {
        const FOUND: u32 = 0;
        for node in 0..self.grid.len() {
            if self.is_near(node) {
                self.places[node] = FOUND;
                let position = self.grid.multi_index(node);
                for axis in 0..D {
                    for [below, above] in self.neighbours[position[axis]] {
                        for other in [below, above] {
                            let reached = self.moved(node, position, axis, other);
                            self.places[reached] = FOUND;
                        }
                    }
                }
            }
        }
        for (node, place) in self.places.iter_mut().enumerate() {
            if *place == FOUND {
                *place = self.nodes.len() as u32;
                self.nodes.push(node as u32);
            }
        }
    }

    /// Whether a node of the grid has a weight.
    fn is_near(&self, node: usize) -> bool {
        self.distance[node].abs() < self.reach
    }

    /// The distance variable at a place of the layer, if that has a weight.
    pub(super) fn near(&self, place: usize) -> Option<f64> {
        let node = self.nodes[place] as usize;
        self.is_near(node).then(|| self.distance[node])
    }

    /// The node with another index along one axis.
    fn moved(&self, node: usize, position: [usize; D], axis: usize, other: usize) -> usize {
        let stride = self.grid.stride(axis);
        node - position[axis] * stride + other * stride
    }

    /// Calls `add` with the axis, the weight and the node of each term of the differences `sum_k w_k (f_k - f_-k) / h`.
    fn differences(&self, node: usize, mut add: impl FnMut(usize, f64, usize)) {
        let position = self.grid.multi_index(node);
        let inverse = self.grid.spacing().recip();
        for axis in 0..D {
            for (weight, [below, above]) in WEIGHTS.iter().zip(self.neighbours[position[axis]]) {
                let weight = weight * inverse;
                add(axis, weight, self.moved(node, position, axis, above));
                add(axis, -weight, self.moved(node, position, axis, below));
            }
        }
    }

    /// For each axis the places of the neighbours of a place, in the order of [`Self::weights`]; beyond the last where there is none.
    pub(super) fn places_around(&self, place: usize) -> [[u32; NEIGHBOURS]; D] {
        let (mut places, mut term) = ([[NOWHERE; NEIGHBOURS]; D], 0);
        self.differences(self.nodes[place] as usize, |axis, _, node| {
            places[axis][term % NEIGHBOURS] = self.places[node];
            term += 1;
        });
        places
    }

    /// The weights of the neighbours along an axis in a difference.
    pub(super) fn weights(&self) -> [f64; NEIGHBOURS] {
        let [near, middle, far] = WEIGHTS.map(|weight| weight / self.grid.spacing());
        [near, -near, middle, -middle, far, -far]
    }

    /// The gradient of a function of the nodes of the grid.
    fn gradient(&self, node: usize, of: impl Fn(usize) -> f64) -> [f64; D] {
        let mut sums = [0.0; D];
        self.differences(node, |axis, weight, node| sums[axis] += weight * of(node));
        sums
    }

    /// The derivatives of a vector field on the layer, zero elsewhere; the first index is that of the derivative.
    pub(super) fn jacobian_at(&self, place: usize, field: &[[f64; D]]) -> [[f64; D]; D] {
        let mut sums = [[0.0; D]; D];
        self.differences(self.nodes[place] as usize, |axis, weight, node| {
            if let Some(value) = field.get(self.places[node] as usize) {
                sums[axis] = vector::add(sums[axis], vector::scale(*value, weight));
            }
        });
        sums
    }

    /// The divergence of a vector field on the layer, zero elsewhere: minus the adjoint of the gradient.
    pub(super) fn divergence_at(&self, place: usize, field: &[[f64; D]]) -> f64 {
        let mut sum = 0.0;
        self.differences(self.nodes[place] as usize, |axis, weight, node| {
            if let Some(value) = field.get(self.places[node] as usize) {
                sum += weight * value[axis];
            }
        });
        sum
    }

    /// A function of the places of the layer, in parallel.
    pub(super) fn map<T: Send>(&self, f: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        parallel::map(self.nodes.len(), SHARE, &f)
    }

    /// Area or volume of the inside.
    pub(super) fn volume(&self) -> f64 {
        let inside = |node: usize| {
            let d = self.distance[node];
            if self.is_near(node) {
                self.kernel.inside(d)
            } else {
                f64::from(d < 0.0)
            }
        };
        self.grid.cell_volume() * parallel::sum(self.grid.len(), inside)
    }

    /// Length or area of the zero set.
    pub(super) fn perimeter(&self) -> f64 {
        let gradients = self.gradients();
        let element = |place: usize| match self.near(place) {
            Some(d) => self.kernel.value(d) * vector::norm(gradients[place]),
            None => 0.0,
        };
        self.grid.cell_volume() * parallel::sum(self.nodes.len(), element)
    }

    /// Unit vectors along the gradients; zero where there is none.
    pub(super) fn normals(&self) -> &[[f64; D]] {
        let gradients = self.gradients();
        let unit = |place: usize| {
            let length = vector::norm(gradients[place]).max(f64::MIN_POSITIVE);
            vector::scale(gradients[place], length.recip())
        };
        self.normals.get_or_init(|| self.map(unit))
    }
}
