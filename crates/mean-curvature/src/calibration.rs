//! What a step of mean curvature flow makes of the Willmore energy: its effective factor, from the flat interface.
//!
//! The scheme measures curvature as $`|v[u] - u|^2 / \tilde\tau^2`$, and minimizing its energy also relaxes the interface's
//! profile. To first order in the curvature $`\kappa`$ (sum of the principal ones) the energy that is left per area is
//!
//! ```math
//! \frac{\varepsilon}{2 \tilde\tau^2} \min |v[u] - u|^2 = \frac{c}{2} (\kappa - \kappa_0)^2 + \dots
//! ```
//!
//! and a displacement $`\delta`$ of the interface costs $`\varepsilon |u - u_k|^2 = m \delta^2`$, where for an exact step $`c = m = 1`$ and
//! $`\kappa_0 = 0`$. With the flat interface $`w`$ of the step, its derivative $`J = v'[w]`$, the left null vector $`\psi`$ of
//! $`J - 1`$, the response $`A = \frac{d}{d\kappa} (v[u] - u)`$ to bending the interface, and the optimal profile $`q`$,
//!
//! ```math
//! c = \frac{\langle A, \psi \rangle^2}{|\psi|^2 \, \tilde\tau^2 \, |q'|^2}, \qquad m = \frac{|w'|^2}{|q'|^2}, \qquad
//! \kappa_0 = -\frac{\langle v[w] - w, \psi \rangle}{\langle A, \psi \rangle} .
//! ```
//!
//! `docs/calibration.md` derives this. Flat interfaces with a rational normal are functions on equidistant planes, so that all
//! of it is a small dense problem in one dimension ([`PlanarStep`]), solved for several positions of the interface between the
//! planes and several normals.
//!
//! A step of which only its values are known is [measured](crate::measured) instead.

use serde::{Deserialize, Serialize};

use crate::planar;
pub use crate::planar::{
    PlanarInterface, PlanarScales, PlanarStep, flat_interface, optimal_interface, solve,
};

use crate::Error;

/// The factors of the effective energy and metric; both are 1 for an exact step.
///
/// The calibrated scheme divides by them: it minimizes `eps |u - u_k|^2 / m + tau eps / (c tautilde^2) |v[u] - u|^2` and
/// reports `w = eps / (2 c tautilde^2) |v[u] - u|^2`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Factors {
    /// `c`: the energy that the scheme minimizes over the Willmore energy.
    pub energy: f64,
    /// `m`: the squared norm of a displacement over that of the optimal profile.
    pub metric: f64,
}

impl Factors {
    /// No calibration, `c = m = 1`: the scheme of the paper.
    pub const PAPER: Self = Self {
        energy: 1.0,
        metric: 1.0,
    };

    /// How much faster than Willmore flow the scheme of the paper flows with this step, `c / m`.
    pub fn speed(&self) -> f64 {
        self.energy / self.metric
    }
}

impl Default for Factors {
    fn default() -> Self {
        Self::PAPER
    }
}

/// The calibration of a step: means over positions and normals of the interface, with diagnostics.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Factors of energy and metric.
    pub factors: Factors,
    /// `eps kappa_0`, the curvature that the step takes for flat, positive towards the phase `u = 1`. Zero for a step that
    /// commutes with exchanging the phases.
    pub spontaneous_curvature: f64,
    /// Speed of a shrinking interface over its curvature, `-<A, w'> / (tautilde |w'|^2)`, as `kappa -> 0`: what a single step
    /// of mean curvature flow shows.
    pub displacement: f64,
    /// `cos^2` of the angle between `psi` and `w'`: 1 if `J` is symmetric.
    pub alignment: f64,
    /// The eigenvalue of `J` that belongs to translations, farthest from 1 of all.
    pub eigenvalue: f64,
    /// Largest minus smallest `c` over the positions of the interface between the planes, at the worst normal.
    pub position_spread: f64,
    /// Largest minus smallest `c` over the normals.
    pub normal_spread: f64,
}

impl Calibration {
    /// What a bent interface leaves of the residual `v[u] - u`, over what the displacement `tautilde kappa` of the profile would,
    /// `-<A, psi> / (tautilde <w', psi>)`: a residual `v[u] - u + response tautilde c0 w'` vanishes at the curvature `c0`.
    pub fn response(&self) -> f64 {
        let Factors { energy, metric } = self.factors;
        (energy / (self.alignment * metric)).sqrt()
    }

    /// Whether all of its numbers are, as those in files must be.
    pub fn is_finite(&self) -> bool {
        let Self {
            factors: Factors { energy, metric },
            spontaneous_curvature,
            displacement,
            alignment,
            eigenvalue,
            position_spread,
            normal_spread,
        } = *self;
        let flow = [energy, metric, spontaneous_curvature, displacement];
        let quality = [alignment, eigenvalue, position_spread, normal_spread];
        flow.iter().chain(&quality).all(|number| number.is_finite())
    }
}

/// Normals and their weights: `c` is averaged over them. In 2D the four integrate `cos 4 theta` exactly, in 3D they are Lebedev's
/// rule of degree 7.
pub fn normals(dimension: usize) -> &'static [(&'static [isize], f64)] {
    match dimension {
        2 => &[
            (&[1, 0], 0.25),
            (&[3, 1], 0.25),
            (&[2, 1], 0.25),
            (&[1, 1], 0.25),
        ],
        _ => &[
            (&[1, 0, 0], 2.0 / 7.0),
            (&[1, 1, 0], 16.0 / 35.0),
            (&[1, 1, 1], 9.0 / 35.0),
        ],
    }
}

/// Positions of the interface between two planes, in fractions of their distance.
pub(crate) const POSITIONS: [f64; 4] = [0.125, 0.375, 0.625, 0.875];

/// Calibrates a step given on planes, by their normals and the weights of these.
///
/// # Errors
/// [`Error::Calibration`] if the step has no flat interface at rest, or if its response to curvature vanishes.
pub fn calibrate<S: PlanarStep>(
    normals: &[(&[isize], f64)],
    step: impl Fn(&[isize]) -> S + Sync,
) -> Result<Calibration, Error> {
    let work = || -> Result<Vec<OfNormal>, Error> {
        let all = normals.iter().map(|(normal, weight)| {
            let step = step(normal);
            let interfaces: Result<Vec<_>, _> =
                POSITIONS.map(|s| solve(&step, s)).into_iter().collect();
            Ok(OfNormal {
                interfaces: interfaces?,
                weight: *weight,
            })
        });
        all.collect()
    };
    Ok(mean(&on_one_thread(work)?))
}

/// The interfaces with one normal, at several positions, and the weight of that normal.
pub(crate) struct OfNormal {
    pub(crate) interfaces: Vec<PlanarInterface>,
    pub(crate) weight: f64,
}

/// The means over positions and normals, and how much is between them.
pub(crate) fn mean(all: &[OfNormal]) -> Calibration {
    let total: f64 = all.iter().map(|normal| normal.weight).sum();
    let over_positions = |normal: &OfNormal, f: fn(&PlanarInterface) -> f64| -> f64 {
        normal.interfaces.iter().map(f).sum::<f64>() / normal.interfaces.len() as f64
    };
    let mean = |f: fn(&PlanarInterface) -> f64| -> f64 {
        let means = all.iter().map(|normal| {
            let sum = normal.interfaces.iter().map(f).sum::<f64>();
            normal.weight * sum / normal.interfaces.len() as f64
        });
        means.sum::<f64>() / total
    };
    let energies: Vec<f64> = (all.iter())
        .map(|normal| over_positions(normal, |i| i.energy))
        .collect();
    let position_spreads =
        (all.iter()).map(|normal| spread(normal.interfaces.iter().map(|i| i.energy)));
    let eigenvalues = all
        .iter()
        .flat_map(|normal| normal.interfaces.iter().map(|i| i.eigenvalue));
    Calibration {
        factors: Factors {
            energy: mean(|i| i.energy),
            metric: mean(|i| i.metric),
        },
        spontaneous_curvature: mean(|i| i.spontaneous_curvature),
        displacement: mean(|i| i.displacement),
        alignment: mean(|i| i.alignment),
        eigenvalue: eigenvalues.fold(1.0, |worst: f64, e| {
            let worse = (e - 1.0).abs() > (worst - 1.0).abs();
            if worse { e } else { worst }
        }),
        position_spread: position_spreads.fold(0.0, f64::max),
        normal_spread: spread(energies.iter().copied()),
    }
}

/// Eigenvalues of `J`, the derivative of a step at its flat interface, as real and imaginary parts, largest real part first.
///
/// # Errors
/// [`Error::Calibration`] if there is no such interface, or the eigenvalues do not converge.
pub fn spectrum(step: &impl PlanarStep) -> Result<Vec<[f64; 2]>, Error> {
    on_one_thread(|| planar::spectrum(step, POSITIONS[0]))
}

/// The order of sums in factorizations depends on the number of threads.
fn on_one_thread<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

fn spread(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    largest - values.fold(f64::INFINITY, f64::min)
}
