//! The distance variable near the zero set, and what its sums and differences are made of.

use std::f64::consts::FRAC_2_SQRT_PI;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::positive;
use crate::nodes::check_finite;
use crate::{Error, Grid, Lookup, Nodes, PhaseField, distance_from_phase_field, parallel, vector};

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

/// The norm `G` of a gradient of the distance variable as the perimeter has it, with its first two derivatives by `G`.
///
/// Below [`Self::FLAT`], where the norm has a cone, it is the even polynomial of fourth degree that joins it with two derivatives:
/// `a (3 + 6 (G/a)^2 - (G/a)^4) / 8`. That is the middle of holes and gaps no wider than the kernel, which come and go in a flow; with the cone, the perimeter
/// would have no second derivative there.
#[derive(Clone, Copy)]
pub(super) struct Steepness {
    pub(super) value: f64,
    pub(super) slope: f64,
    pub(super) curvature: f64,
    /// The slope over the norm.
    pub(super) ratio: f64,
}

impl Steepness {
    /// Near resolved zero sets the norm is within a few hundredths of one.
    const FLAT: f64 = 0.5;

    pub(super) fn of<const D: usize>(gradient: [f64; D]) -> Self {
        let norm = vector::norm(gradient);
        if norm >= Self::FLAT {
            return Self {
                value: norm,
                slope: 1.0,
                curvature: 0.0,
                ratio: norm.recip(),
            };
        }
        let (a, t) = (Self::FLAT, norm / Self::FLAT);
        let square = t * t;
        Self {
            value: a * (3.0 + 6.0 * square - square * square) / 8.0,
            slope: t * (3.0 - square) / 2.0,
            curvature: 1.5 * (1.0 - square) / a,
            ratio: (3.0 - square) / (2.0 * a),
        }
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

/// For each axis the places of the neighbours of a node, in the order of the weights; beyond the last where there is none.
pub(super) type Around<const D: usize> = [[u32; NEIGHBOURS]; D];

/// The nodes near the zero set, and those that the differences there reach, as far as they are stored.
pub(super) struct Layer<const D: usize> {
    stored: Nodes<D>,
    pub(super) grid: Grid<D>,
    pub(super) kernel: Kernel,
    reach: f64,
    /// The distance variable at all stored nodes,
    distance: Vec<f64>,
    /// and in the two pure phases.
    pure_distances: [f64; 2],
    /// The nodes of the layer in the order of storage.
    pub(super) nodes: Vec<u32>,
    /// Where a stored node is in `nodes`.
    places: Vec<u32>,
    around: OnceLock<Vec<Around<D>>>,
    gradients: OnceLock<Vec<[f64; D]>>,
    normals: OnceLock<Vec<[f64; D]>>,
}

impl<const D: usize> Layer<D> {
    pub(super) fn new(u: &impl PhaseField<D>, eps: f64) -> Result<Self, Error> {
        Self::of(u.nodes().clone(), u.values(), u.phase_values(), eps)
    }

    fn of(
        stored: Nodes<D>,
        values: &[f64],
        phase_values: [f64; 2],
        eps: f64,
    ) -> Result<Self, Error> {
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
            pure_distances: phase_values.map(distance),
            nodes: Vec::new(),
            places: vec![NOWHERE; values.len()],
            around: OnceLock::new(),
            gradients: OnceLock::new(),
            normals: OnceLock::new(),
        };
        layer.find_nodes();
        Ok(layer)
    }

    /// Gradients of the distance variable at the nodes of the layer, which the volume does not need.
    pub(super) fn gradients(&self) -> &[[f64; D]] {
        self.gradients
            .get_or_init(|| self.table([0.0; D], |place| self.gradient(place)))
    }

    /// Fills `nodes` and `places`.
    fn find_nodes(&mut self) {
        let found: Vec<AtomicBool> = self.distance.iter().map(|_| false.into()).collect();
        let find = |node: usize| found[node].store(true, Ordering::Relaxed);
        parallel::over(self.distance.len(), SHARE, &|node| {
            if self.is_near(node) {
                find(node);
                let place = self.stored.multi_index(node);
                for axis in 0..D {
                    let around = self.stored.along(node, place, axis, STEPS);
                    around.into_iter().filter_map(Lookup::stored).for_each(find);
                }
            }
        });
        for (node, found) in found.into_iter().enumerate() {
            if found.into_inner() {
                self.places[node] = self.nodes.len() as u32;
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

    /// The neighbours of the nodes of the layer. Not to be called first in a loop on all cores: all of them make
    /// the table, and one that waits for another inside the loop may take up work that waits for the table.
    pub(super) fn around(&self) -> &[Around<D>] {
        let nowhere = [[NOWHERE; NEIGHBOURS]; D];
        self.around
            .get_or_init(|| self.table(nowhere, |place| self.around_place(place)))
    }

    /// The neighbours of one of them, for those who need them once.
    pub(super) fn around_place(&self, place: usize) -> Around<D> {
        self.by_axis(place, |along| {
            along.map(|neighbour| match neighbour {
                Lookup::Stored(node) => self.places[node],
                Lookup::Pure { .. } => NOWHERE,
            })
        })
    }

    /// The gradient of the distance variable: `sum_k w_k (d_k - d_-k) / h` along each axis.
    fn gradient(&self, place: usize) -> [f64; D] {
        let weights = self.weights();
        self.by_axis(place, |along| {
            let distances = along.map(|neighbour| match neighbour {
                Lookup::Stored(node) => self.distance[node],
                Lookup::Pure { positive } => self.pure_distances[usize::from(positive)],
            });
            let terms = weights.iter().zip(distances);
            terms.fold(0.0, |sum, (weight, d)| sum + weight * d)
        })
    }

    /// A function of the stored neighbours of a place along each axis, or of their phases where nothing is stored.
    fn by_axis<T>(&self, place: usize, of: impl Fn([Lookup; NEIGHBOURS]) -> T) -> [T; D] {
        let node = self.nodes[place] as usize;
        let at = self.stored.multi_index(node);
        std::array::from_fn(|axis| of(self.stored.along(node, at, axis, STEPS)))
    }

    /// The weights of the neighbours along an axis in a difference.
    pub(super) fn weights(&self) -> [f64; NEIGHBOURS] {
        let [near, middle, far] = WEIGHTS.map(|weight| weight * self.grid.spacing().recip());
        [near, -near, middle, -middle, far, -far]
    }

    /// The derivatives of a vector field on the layer, zero elsewhere, at a place with these [neighbours](Self::around); the first index is
    /// that of the derivative.
    pub(super) fn jacobian(&self, around: &Around<D>, field: &[[f64; D]]) -> [[f64; D]; D] {
        let weights = self.weights();
        around.map(|around| {
            let mut sum = [0.0; D];
            for (weight, other) in weights.iter().zip(around) {
                if let Some(value) = field.get(other as usize) {
                    sum = vector::add(sum, vector::scale(*value, *weight));
                }
            }
            sum
        })
    }

    /// The divergence of such a field: minus the adjoint of the gradient.
    pub(super) fn divergence(&self, around: &Around<D>, field: &[[f64; D]]) -> f64 {
        let (weights, mut sum) = (self.weights(), 0.0);
        for (axis, around) in around.iter().enumerate() {
            for (weight, other) in weights.iter().zip(around) {
                if let Some(value) = field.get(*other as usize) {
                    sum += weight * value[axis];
                }
            }
        }
        sum
    }

    /// A function of the places of the layer, in parallel.
    pub(super) fn map<T: Send>(&self, f: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
        parallel::map(self.nodes.len(), SHARE, &f)
    }

    fn table<T: Copy + Send + Sync>(
        &self,
        first: T,
        f: impl Fn(usize) -> T + Send + Sync,
    ) -> Vec<T> {
        parallel::table(self.nodes.len(), SHARE, first, &f)
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
        let outside = self.stored.outside().into_iter().zip(self.pure_distances);
        let outside = outside.map(|(nodes, d)| if d < 0.0 { nodes as f64 } else { 0.0 });
        let stored = parallel::sum(self.distance.len(), inside);
        self.grid.cell_volume() * (stored + outside.sum::<f64>())
    }

    /// Length or area of the zero set.
    pub(super) fn perimeter(&self) -> f64 {
        let gradients = self.gradients();
        let element = |place: usize| match self.near(place) {
            Some(d) => self.kernel.value(d) * Steepness::of(gradients[place]).value,
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
        self.normals.get_or_init(|| self.table([0.0; D], unit))
    }
}
