//! The distance variable near the zero set, and what its sums and differences are made of.

use std::f64::consts::FRAC_2_SQRT_PI;
use std::sync::OnceLock;

use crate::error::positive;
use crate::nodes::check_finite;
use crate::{Error, Grid, Nodes, PhaseField, distance_from_phase_field, parallel, vector};

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
/// How far they are, in spacings, in the order of [`Layer::weights`].
const STEPS: [isize; NEIGHBOURS] = [1, -1, 2, -2, 3, -3];
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

/// The nodes near the zero set, and those that the differences there reach, as far as they are stored.
pub(super) struct Layer<const D: usize> {
    stored: Nodes<D>,
    pub(super) grid: Grid<D>,
    pub(super) kernel: Kernel,
    reach: f64,
    /// The distance variable at all stored nodes,
    distance: Vec<f64>,
    /// and where nothing is stored.
    rests: [f64; 2],
    /// The nodes of the layer in the order of storage.
    pub(super) nodes: Vec<u32>,
    /// Where a stored node is in `nodes`.
    places: Vec<u32>,
    gradients: OnceLock<Vec<[f64; D]>>,
    normals: OnceLock<Vec<[f64; D]>>,
}

impl<const D: usize> Layer<D> {
    pub(super) fn new(u: &impl PhaseField<D>, eps: f64) -> Result<Self, Error> {
        Self::of((u.nodes(), u.values(), u.rests()), eps)
    }

    fn of((stored, values, rests): (Nodes<D>, &[f64], [f64; 2]), eps: f64) -> Result<Self, Error> {
        positive("eps", eps)?;
        check_finite(values)?;
        let grid = *stored.grid();
        if u32::try_from(values.len()).is_err() {
            return Err(Error::GridTooLarge {
                cells: grid.cells(),
                dimension: D,
            });
        }
        let distance = |u: f64| distance_from_phase_field(u, eps);
        let mut layer = Self {
            stored,
            grid,
            kernel: Kernel::new(grid.spacing()),
            reach: REACH * grid.spacing(),
            distance: parallel::values(values.len(), |node| distance(values[node])),
            rests: rests.map(distance),
            nodes: Vec::new(),
            places: vec![NOWHERE; values.len()],
            gradients: OnceLock::new(),
            normals: OnceLock::new(),
        };
        layer.find_nodes();
        Ok(layer)
    }

    /// Gradients of the distance variable at the nodes of the layer, which the volume does not need.
    pub(super) fn gradients(&self) -> &[[f64; D]] {
        self.gradients
            .get_or_init(|| self.map(|place| self.gradient(self.nodes[place] as usize)))
    }

    /// Fills `nodes` and `places`.
    fn find_nodes(&mut self) {
        const FOUND: u32 = 0;
        for node in 0..self.places.len() {
            if self.is_near(node) {
                self.places[node] = FOUND;
                let place = self.stored.place(node);
                for axis in 0..D {
                    let around = self.stored.along(node, place, axis, STEPS);
                    for reached in around.into_iter().flatten() {
                        self.places[reached] = FOUND;
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

    /// How many nodes are stored.
    pub(super) fn stored_len(&self) -> usize {
        self.distance.len()
    }

    /// Whether a node has a weight.
    fn is_near(&self, node: usize) -> bool {
        self.distance[node].abs() < self.reach
    }

    /// The distance variable at a place of the layer, if that has a weight.
    pub(super) fn near(&self, place: usize) -> Option<f64> {
        let node = self.nodes[place] as usize;
        self.is_near(node).then(|| self.distance[node])
    }

    /// Calls `add` with the axis, the weight and the node, or the phase where none is stored, of each term of the differences
    /// `sum_k w_k (f_k - f_-k) / h`.
    fn differences(&self, node: usize, mut add: impl FnMut(usize, f64, Result<usize, bool>)) {
        let place = self.stored.place(node);
        let weights = self.weights();
        for axis in 0..D {
            let around = self.stored.along(node, place, axis, STEPS);
            for (weight, neighbour) in weights.into_iter().zip(around) {
                add(axis, weight, neighbour);
            }
        }
    }

    /// Where a neighbour is among the nodes of the layer; beyond the last where it is not.
    fn place_of(&self, neighbour: Result<usize, bool>) -> u32 {
        neighbour.map_or(NOWHERE, |node| self.places[node])
    }

    /// For each axis the places of the neighbours of a place, in the order of [`Self::weights`]; beyond the last where there is none.
    pub(super) fn places_around(&self, place: usize) -> [[u32; NEIGHBOURS]; D] {
        let (mut places, mut term) = ([[NOWHERE; NEIGHBOURS]; D], 0);
        self.differences(self.nodes[place] as usize, |axis, _, node| {
            places[axis][term % NEIGHBOURS] = self.place_of(node);
            term += 1;
        });
        places
    }

    /// The weights of the neighbours along an axis in a difference.
    pub(super) fn weights(&self) -> [f64; NEIGHBOURS] {
        let [near, middle, far] = WEIGHTS.map(|weight| weight * self.grid.spacing().recip());
        [near, -near, middle, -middle, far, -far]
    }

    /// The gradient of the distance variable.
    fn gradient(&self, node: usize) -> [f64; D] {
        let mut sums = [0.0; D];
        self.differences(node, |axis, weight, neighbour| {
            let distance = match neighbour {
                Ok(node) => self.distance[node],
                Err(phase) => self.rests[usize::from(phase)],
            };
            sums[axis] += weight * distance;
        });
        sums
    }

    /// The derivatives of a vector field on the layer, zero elsewhere; the first index is that of the derivative.
    pub(super) fn jacobian_at(&self, place: usize, field: &[[f64; D]]) -> [[f64; D]; D] {
        let mut sums = [[0.0; D]; D];
        self.differences(self.nodes[place] as usize, |axis, weight, node| {
            if let Some(value) = field.get(self.place_of(node) as usize) {
                sums[axis] = vector::add(sums[axis], vector::scale(*value, weight));
            }
        });
        sums
    }

    /// The divergence of a vector field on the layer, zero elsewhere: minus the adjoint of the gradient.
    pub(super) fn divergence_at(&self, place: usize, field: &[[f64; D]]) -> f64 {
        let mut sum = 0.0;
        self.differences(self.nodes[place] as usize, |axis, weight, node| {
            if let Some(value) = field.get(self.place_of(node) as usize) {
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
        let stored = parallel::sum(self.distance.len(), inside);
        self.grid.cell_volume() * (stored + self.stored.positive_outside() as f64)
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
