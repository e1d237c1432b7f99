//! What a time step says of itself.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::movement::Minimum;
use crate::newton::NewtonInfo;
use crate::times::PhaseTimes;
use crate::{State, StepEstimates, StepSize};

/// The origin of a start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartKind {
    /// The phase field itself.
    #[default]
    Rest,
    /// The last motion, continued.
    Extrapolated,
    /// The motion that the same step makes on the grid of half as many cells.
    HalfGrid,
}

/// Where the minimization of a time step began, and what that cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Its origin.
    pub kind: StartKind,
    /// Hessian-vector products on coarser grids, each counted by its share of this grid's unknowns.
    pub hvp: f64,
}

/// What a step did that minimizes nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DirectRecord {
    /// The parts into which it was divided.
    pub parts: usize,
    /// Convolutions of the whole grid.
    pub convolutions: usize,
    /// The reach of the interface at its end: the largest radius of balls that touch it wherever they lie on it.
    pub reach: f64,
    /// The distance of the runs of whole and of half parts: about the time error of the latter, and more than that of the result, which is extrapolated
    /// from both.
    pub run_distance: f64,
}

/// One time step of Willmore flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StepRecord {
    /// Number of the step, from 1.
    pub step: usize,
    /// Time at its end.
    pub time: f64,
    /// Its size `tau`.
    pub tau: f64,
    /// `E[u_k, u_k]`: the energy of standing still, true L2 norms; its terms are divided by
    /// the factors of the calibration.
    pub energy_before: f64,
    /// `E[u_k, u_{k+1}]`.
    pub energy: f64,
    /// `eps / (2 c tautilde^2) |V[u] - u|^2`, the approximate Willmore energy of the result; `c = 1` without calibration. With spontaneous
    /// curvature, tension, pressure or other [terms](crate::EnergyTerm) the energy that these make of it.
    pub willmore_energy: f64,
    /// Where the minimization began.
    pub start: Start,
    /// What the minimization did.
    pub newton: NewtonInfo,
    /// The surface tension `sigma` that holds the perimeter: `w + sigma A + p V` is stationary but for the motion, `w` being the Willmore
    /// energy, `A` the perimeter, and `V` the volume. Energy per length (2D) or area (3D); positive where the interface wants to grow. It comes
    /// on top of a [tension](crate::Tension) in the energy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tension: Option<f64>,
    /// The pressure `p` that holds the volume, likewise: energy per area (2D) or volume (3D), positive where the inside wants to grow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<f64>,
    /// How long the step was against what limits it, if it was of second order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimates: Option<StepEstimates>,
    /// What was done in place of a minimization, if the step was direct.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direct: Option<DirectRecord>,
    /// Wall time in seconds, which is not stored: records of the same step are the same bytes.
    #[serde(skip)]
    pub seconds: f64,
    /// Wall time of the phases of the minimization, not stored either.
    #[serde(skip)]
    pub times: PhaseTimes,
}

impl StepRecord {
    /// The Willmore energy before the step, as the scheme measures it: standing still costs `2 tau w`.
    pub fn energy_at_rest(&self) -> f64 {
        self.energy_before / (2.0 * self.tau)
    }

    /// By which part of itself the energy fell, or of `least` where it is smaller, as it can be with spontaneous curvature or pressure.
    pub fn relative_drop(&self, least: f64) -> f64 {
        let before = self.energy_at_rest();
        (before - self.willmore_energy) / before.abs().max(least)
    }

    /// Hessian-vector products of the step; those on coarser grids count by their share of this grid's unknowns.
    pub fn hvp(&self) -> f64 {
        self.newton.hvp as f64 + self.start.hvp
    }
}

/// Where a step begins, and its size.
pub(crate) struct At<'a, const D: usize> {
    pub(crate) from: &'a State<D>,
    pub(crate) size: StepSize,
}

impl<const D: usize> Minimum<D> {
    /// What a step says of itself that ended in this minimum; its energies are those of the minimization, unscaled.
    pub(crate) fn record(&self, at: &At<'_, D>, start: Start, clock: Instant) -> StepRecord {
        let tau = at.size.tau;
        StepRecord {
            step: at.from.step + 1,
            time: at.from.time + tau,
            tau,
            energy_before: self.newton.energy_before,
            energy: self.newton.energy,
            willmore_energy: self.willmore_energy,
            start,
            newton: self.newton,
            tension: self.tension,
            pressure: self.pressure,
            estimates: None,
            direct: None,
            seconds: clock.elapsed().as_secs_f64(),
            times: self.times,
        }
    }
}
