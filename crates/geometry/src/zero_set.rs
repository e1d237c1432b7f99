//! Measures of the zero set by coarea sums in the distance variable, to four digits and more at `eps = 2h`.
//!
//! With the distance variable `d = -(4 eps/3) atanh u`, `G = |grad d|` and a smeared delta function `delta` of width `1.25 h` with
//! vanishing second moment, whose integral is `H`,
//!
//! ```text
//! volume = h^D sum H(d)                        perimeter = h^D sum delta(d) G
//! mean curvature = h^D sum kappa delta(d) G    Willmore energy = h^D sum kappa^2/2 delta(d) G,    kappa = div(grad d / G)
//! ```
//!
//! with central differences of sixth order, over the nodes with `|d| < 10h` (`6h` for curvatures). By the coarea formula each is the
//! average over the level sets of `d` of what belongs to one of them, and the sums are those of smooth functions. That the interface has a
//! width does not matter: `d` need not be a distance, only smooth.

use crate::{Error, Grid, PhaseField, parallel, vector};

mod layer;
mod sizes;

use layer::{Layer, SHARE};
pub use sizes::{SizeHessian, Sizes};

/// Nodes farther than this from the zero set, in spacings, do not count in integrals of the curvature: the differences of differences
/// there would leave the layer in which phase fields know the distance.
const CURVATURE_REACH: f64 = 6.0;
/// Thickness of the layers in which the gradient is compared, in spacings.
const BIN: f64 = 0.5;
/// Their number.
const BINS: usize = (2.0 * CURVATURE_REACH / BIN) as usize;

/// What is measured on the zero set of a phase field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroSet {
    /// Length (2D) or area (3D).
    pub perimeter: f64,
    /// Area (2D) or volume (3D) of `{u > 0}`.
    pub volume: f64,
    /// The integral of the mean curvature `kappa`, the sum of the principal curvatures, positive for a ball: `2 pi` for a simple closed
    /// curve, `8 pi R` for a sphere.
    pub mean_curvature: f64,
    /// The integral of `kappa^2/2`: `pi/R` for a circle, `8 pi` for a sphere.
    pub willmore_energy: f64,
    /// Standard deviation of `|grad d|` along level sets near the zero set, relative to its mean. It grows where the zero set bends or
    /// meets itself within a few spacings.
    pub spread: f64,
    /// This mean of `|grad d|`: 1 where the profile across the zero set is the optimal one; not a number without a zero set.
    pub slope: f64,
    /// The smallest radius of curvature at the zero set, in spacings of the grid.
    pub smallest_radius: f64,
}

impl ZeroSet {
    /// Perimeter and volume hold to `1e-4` where the spread is below this. Phase fields that flowed have .002 to .007.
    pub const LARGEST_SPREAD: f64 = 0.01;
    /// The integrals of the curvature hold to `5e-4` where radii of curvature, in spacings, are above this.
    pub const SMALLEST_RADIUS: f64 = 10.0;

    /// Measures the zero set of `u`, a phase field with interface width `eps`.
    ///
    /// # Errors
    /// `eps` must be finite and positive, and the values finite.
    pub fn of<const D: usize>(u: &impl PhaseField<D>, eps: f64) -> Result<Self, Error> {
        Ok(Self::on(&Layer::new(u, eps)?))
    }

    fn on<const D: usize>(layer: &Layer<D>) -> Self {
        let (spacing, cell) = (layer.grid.spacing(), layer.grid.cell_volume());
        // Here and not in the loop, see `Layer::around`.
        let tables = (layer.gradients(), layer.normals());
        let mut sums = Sums::default();
        let near = |place: usize| {
            let distance = layer.near(place)?;
            (distance.abs() < CURVATURE_REACH * spacing)
                .then(|| sample(layer, tables, place, distance))
        };
        parallel::in_order(layer.nodes.len(), SHARE, &near, |sample| {
            sums.add(&sample, spacing);
        });
        Self {
            perimeter: layer.perimeter(),
            volume: layer.volume(),
            mean_curvature: cell * sums.curvature,
            willmore_energy: cell * sums.energy,
            spread: sums.spread(),
            slope: sums.slope(),
            smallest_radius: (sums.sharpest * spacing).recip(),
        }
    }

    /// Whether perimeter and volume hold: false at corners, thin sheets and contacts.
    pub fn sizes_hold(&self) -> bool {
        self.spread <= Self::LARGEST_SPREAD
    }

    /// Whether the integrals of the curvature hold too. Parts of the zero set, or of its periodic images, within 16 spacings of each
    /// other, which spoil them, are not seen where neither bends.
    pub fn curvatures_hold(&self) -> bool {
        self.sizes_hold() && self.smallest_radius >= Self::SMALLEST_RADIUS
    }
}

/// What one node adds.
struct Sample {
    distance: f64,
    /// `delta(d) G`
    element: f64,
    gradient: f64,
    /// A positive weight near the zero set.
    weight: f64,
    curvature: f64,
    /// The larger of the principal curvatures, in absolute value.
    sharpest: f64,
}

fn sample<const D: usize>(
    layer: &Layer<D>,
    (gradients, normals): (&[[f64; D]], &[[f64; D]]),
    place: usize,
    distance: f64,
) -> Sample {
    let bends = layer.jacobian(&layer.around_place(place), normals);
    let curvature: f64 = (0..D).map(|axis| bends[axis][axis]).sum();
    // Two principal curvatures from their sum and the sum of their squares; in 2D the other is zero.
    let squares: f64 = bends.iter().map(|row| vector::dot(*row, *row)).sum();
    let gap = (2.0 * squares - curvature * curvature).max(0.0).sqrt();
    let sharpest = match D {
        2 => curvature.abs(),
        _ => 0.5 * (curvature.abs() + gap),
    };
    let gradient = vector::norm(gradients[place]);
    Sample {
        distance,
        element: layer.kernel.value(distance) * gradient,
        gradient,
        weight: layer.kernel.positive(distance),
        curvature,
        sharpest,
    }
}

#[derive(Default)]
struct Sums {
    curvature: f64,
    energy: f64,
    sharpest: f64,
    /// Weights, with gradients and with their squares, by distance.
    layers: [[f64; 3]; BINS],
}

impl Sums {
    fn add(&mut self, sample: &Sample, spacing: f64) {
        self.curvature += sample.curvature * sample.element;
        self.energy += 0.5 * sample.curvature * sample.curvature * sample.element;
        let depth = sample.distance / spacing;
        if depth.abs() <= 0.5 {
            self.sharpest = vector::max(self.sharpest, sample.sharpest);
        }
        let bin = ((depth + CURVATURE_REACH) / BIN) as usize;
        let [weights, first, second] = &mut self.layers[bin.min(BINS - 1)];
        *weights += sample.weight;
        *first += sample.weight * sample.gradient;
        *second += sample.weight * sample.gradient * sample.gradient;
    }

    fn slope(&self) -> f64 {
        let sum = |k: usize| self.layers.iter().map(|layer| layer[k]).sum::<f64>();
        sum(1) / sum(0)
    }

    /// What remains after the dependence on the distance, which is that of the profile, is taken out.
    fn spread(&self) -> f64 {
        let [mut weights, mut gradients, mut variances] = [0.0; 3];
        for [weight, first, second] in self.layers.iter().filter(|[weight, ..]| *weight > 0.0) {
            weights += weight;
            gradients += first;
            variances += second - first * first / weight;
        }
        if weights == 0.0 {
            return 0.0;
        }
        (weights * variances.max(0.0)).sqrt() / gradients
    }
}

/// Area (2D) or volume (3D) of the ball of a radius.
///
/// ```
/// use geometry::zero_set::ball_volume;
/// # use std::f64::consts::PI;
/// assert!((ball_volume(2, 3.0) - 9.0 * PI).abs() < 1e-12);
/// assert!((ball_volume(3, 3.0) - 36.0 * PI).abs() < 1e-12);
/// ```
pub fn ball_volume(dimension: usize, radius: f64) -> f64 {
    unit_ball(dimension) * radius.powi(dimension as i32)
}

/// Length (2D) or area (3D) of the ball of a volume, which no set of that volume in space undercuts.
///
/// ```
/// use geometry::zero_set::ball_perimeter;
/// # use std::f64::consts::PI;
/// assert!((ball_perimeter(2, PI) - 2.0 * PI).abs() < 1e-12);
/// assert!((ball_perimeter(3, 4.0 / 3.0 * PI) - 4.0 * PI).abs() < 1e-12);
/// ```
pub fn ball_perimeter(dimension: usize, volume: f64) -> f64 {
    let d = dimension as f64;
    d * unit_ball(dimension).powf(1.0 / d) * volume.powf(1.0 - 1.0 / d)
}

/// The volume as a fraction of that of the ball of the same perimeter: `4 pi A / L^2` in 2D, `6 sqrt(pi) V / A^(3/2)` in 3D; one for
/// balls, less for all else.
pub fn reduced_volume(dimension: usize, perimeter: f64, volume: f64) -> f64 {
    let d = dimension as f64;
    (ball_perimeter(dimension, volume) / perimeter).powf(d / (d - 1.0))
}

/// The least length (2D) or area (3D) of a set of this volume in the periodic box: that of a ball, or of a cylinder or slab across the box where
/// that is less (in 3D a conjecture: Hauswirth, Perez, Romon and Ros, The periodic isoperimetric problem, 2004).
pub fn least_perimeter<const D: usize>(grid: &Grid<D>, volume: f64) -> f64 {
    let side = grid.side();
    // The complement has the same perimeter.
    let volume = volume.min(side.powi(D as i32) - volume);
    let across = (1..=D).map(|ball| {
        let length = side.powi((D - ball) as i32);
        length * ball_perimeter(ball, volume / length)
    });
    across.fold(f64::INFINITY, f64::min)
}

/// Volume of the unit ball.
fn unit_ball(dimension: usize) -> f64 {
    // From w_0 = 1, w_1 = 2 by w_d = 2 pi/d w_(d-2).
    match dimension {
        0 => 1.0,
        1 => 2.0,
        d => std::f64::consts::TAU / d as f64 * unit_ball(d - 2),
    }
}
