//! Time steps of second order, as two minimizations.
//!
//! The diagonally implicit Runge-Kutta method SDIRK2 (Alexander 1977; `gamma = 1 - 1/sqrt 2`, L-stable) is, written in the states
//! themselves, two implicit Euler steps of size `gamma tau`: from `u_k` to `U`, and from the anchor `u_k + (1 + sqrt 2)(U - u_k)` to
//! `u_{k+1}`. Both are minimizing movements. The anchor is formed by displacement, in `atanh u`, so that it is a phase field with the
//! optimal profile again; and motions are weighted by the factors by which the `L2` metric is too weak for [long](crate::displacement::metric_weight)
//! displacements and those of [curved](crate::displacement::curvature_weight) surfaces. See `docs/time-steps.md`.

use std::time::Instant;

use geometry::Stored;
use serde::{Deserialize, Serialize};

use super::{Minimum, Movement, StepRecord, WillmoreFlow};
use crate::constraints::Constraints;
use crate::displacement::{
    curvature_weight, depth, displaced, displacement, metric_weight, on_interface, widths_between,
    window,
};
use crate::stored::tensor;
use crate::{Error, Start, StartKind};

/// `gamma = 1 - 1/sqrt 2`: the size of a stage over that of the step.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// `1 + sqrt 2 = (1 - gamma) / gamma`: how much further than the first stage the anchor of the second is displaced.
const FURTHER: f64 = 1.0 + std::f64::consts::SQRT_2;
/// The longest displacement that a start anticipates, in units of `4 eps / 3`.
const FARTHEST: f64 = 1.5;

/// Lengths that say how good a step of second order is, largest over the interface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepEstimates {
    /// The estimated local time error, from the rates of the two stages and of the step before: of third order in the step. None in the
    /// first three steps, which lack that rate, or have that of a corner.
    pub error: Option<f64>,
    /// How far the interface moved.
    pub motion: f64,
    /// The longer of the displacements of the two stages, from `u_k` to `U` and from there to `u_{k+1}`; also how far away interface is that
    /// has vanished or appeared in one of them ([`widths_between`](crate::widths_between)).
    pub displacement: f64,
}

impl<const D: usize> WillmoreFlow<D> {
    /// One step of second order of size `tau`, in two minimizations, if `accept` takes it: it is shown the record with its
    /// [estimates](StepEstimates). Otherwise the flow stays where it was. Starts on half grids are not used.
    ///
    /// In the record, `energy_before` and `energy` are `2 tau w` of the Willmore energies before and after the step, as the scheme measures them.
    ///
    /// # Errors
    /// As [`Self::advance`]; the flow stays where it was.
    pub fn advance_second_order(
        &mut self,
        tau: f64,
        accept: impl FnOnce(&StepRecord) -> bool,
    ) -> Result<(StepRecord, bool), Error> {
        let clock = Instant::now();
        self.follow()?;
        let before = self.stored(&self.current)?;
        let stage = GAMMA * tau;

        let anticipated = self.anticipated(&before, stage);
        let start = before.zip_map(&limited(&anticipated), displaced);
        // Targets are approached evenly, so that both stages go the same way to them.
        let part_way = self.constraints.after(GAMMA, &before, self.params.eps)?;
        let first = self.stage(&before, &anticipated, &start, (stage, part_way))?;
        let middle = self.stored(&first.u)?;

        let moved = middle.zip_map(&before, displacement);
        let further = moved.map(|y| FURTHER * y);
        let anchor = anchor(&before, &middle, &further);
        let start = middle.zip_map(&further, displaced);
        let second = self.stage(&anchor, &moved, &start, (stage, self.constraints))?;
        let after = self.stored(&second.u)?;

        let rate = |to: &Stored<D>, from| to.zip_map(from, |u, v| displacement(u, v) / stage);
        let rates = [rate(&middle, &before), rate(&after, &anchor)];
        let estimates = self.estimates([&before, &middle, &after], &rates, tau);
        // At u_k nothing has moved, and the energy is that of the curvature.
        let at_rest = self.energy_scale() * first.newton.energy_before / (2.0 * stage);
        let energies = [at_rest, second.willmore_energy].map(|w| 2.0 * tau * w);
        let kind = match self.rate {
            Some(_) => StartKind::Extrapolated,
            None => StartKind::Rest,
        };
        let record = StepRecord {
            newton: second.newton.after(&first.newton),
            estimates: Some(estimates),
            times: first.times + second.times,
            ..self.record(tau, &second, energies, Start { kind, hvp: 0.0 }, clock)
        };
        let accepted = accept(&record);
        if accepted {
            self.current = second.u;
            self.previous = None;
            let [_, last] = rates;
            self.rate = Some(last);
            self.step += 1;
            self.time += tau;
        }
        Ok((record, accepted))
    }

    /// One stage: the minimization from an anchor, weighted for the displacement that is expected of it, of this size and under these constraints.
    fn stage(
        &mut self,
        anchor: &Stored<D>,
        expected: &Stored<D>,
        start: &Stored<D>,
        (tau, constraints): (f64, Constraints),
    ) -> Result<Minimum<D>, Error> {
        let long = displaced_part(&expected.map(|y| FURTHER * y), start);
        let factors = tensor(&self.factors(expected, start, long), &self.device);
        self.minimize(&Movement {
            anchor: &tensor(anchor, &self.device),
            factors: Some(&factors),
            start: &tensor(start, &self.device),
            tau,
            constraints,
        })
    }

    /// Square roots of the weights with which the `L2` metric measures displacements, where `end` is about where these `expected` ones lead, and
    /// anchors are displaced by the part `long`.
    fn factors(&self, expected: &Stored<D>, end: &Stored<D>, long: f64) -> Stored<D> {
        // The mean curvature is minus the Laplacian of the depth.
        let unit = 4.0 * self.params.eps / 3.0;
        let curvature = end.map(|u| unit * depth(u)).laplacian();
        let curvature = curvature.zip_map(end, |laplacian, u| -window(u) * laplacian);
        expected.zip_map(&curvature, |y, h| {
            (metric_weight(y) * curvature_weight(long * h * unit * y)).sqrt()
        })
    }

    /// The displacement in the time `tau` at the rate of the last step, on the interface of the present phase field.
    fn anticipated(&self, now: &Stored<D>, tau: f64) -> Stored<D> {
        match &self.rate {
            Some(rate) => rate.zip_map(now, |rate, u| rate * window(u) * tau),
            None => now.map(|_| 0.0),
        }
    }

    /// The lengths that a step is judged by, `[u_k, U, u_{k+1}]` being its states.
    ///
    /// The rates at the times `0`, `gamma tau` and `tau` of the step are `F_0`, that of the second stage of the step before, `F_1` and `F_2`.
    /// The quadrature with weights `b` that is exact for quadratic rates differs from the step's own, `1 - gamma` and `gamma`, by the local error:
    /// `tau |b_0 F_0 + (b_1 - 1 + gamma) F_1 + (b_2 - gamma) F_2|`.
    fn estimates(
        &self,
        [before, middle, after]: [&Stored<D>; 3],
        [first, second]: &[Stored<D>; 2],
        tau: f64,
    ) -> StepEstimates {
        const FIRST: f64 = 1.0 / (6.0 * GAMMA * (1.0 - GAMMA));
        const SECOND: f64 = (2.0 - 3.0 * GAMMA) / (6.0 * (1.0 - GAMMA));
        /// Steps that have no estimate.
        const WITHOUT: usize = 3;
        /// Interface that is so many widths from any other has none to which it could have moved.
        const AWAY: f64 = 2.0;
        let unit = 4.0 * self.params.eps / 3.0;
        let between =
            |to: &Stored<D>, from| unit * largest(&to.zip_map(from, displacement), middle);
        // Interface of u_k that is gone in U, and of u_{k+1} that is not yet there, is no part of that in the middle: it is seen from those ends.
        let away = |end| {
            let widths = widths_between(end, middle);
            if widths > AWAY {
                widths * self.params.eps
            } else {
                0.0
            }
        };
        let [gone, new] = [before, after].map(away);
        let error = match &self.rate {
            Some(start) if self.step >= WITHOUT => {
                let stages = first.zip_map(second, |first, second| {
                    (FIRST - 1.0 + GAMMA) * first + (SECOND - GAMMA) * second
                });
                let error = stages.zip_map(start, |stages, start| {
                    tau * (stages + (1.0 - FIRST - SECOND) * start)
                });
                Some(unit * largest(&error, middle))
            }
            _ => None,
        };
        StepEstimates {
            error,
            motion: between(after, before),
            displacement: (between(middle, before).max(between(after, middle)))
                .max(gone)
                .max(new),
        }
    }
}

/// `u_k + (1 + sqrt 2)(U - u_k)`: for long steps as a displacement, for short ones as a linear combination.
///
/// A linear combination is no profile: beyond one `eps` it overshoots the pure phases without being further away, and the step lags. With a
/// displaced phase field the scheme is of second order as far as the metric's weights are exact, with a linear one it is where profiles do not
/// matter. Either is used where its error is the smaller one, and the order stays two.
fn anchor<const D: usize>(
    before: &Stored<D>,
    middle: &Stored<D>,
    further: &Stored<D>,
) -> Stored<D> {
    let part = displaced_part(further, middle);
    let along = before.zip_map(further, displaced);
    let straight = before.zip_map(middle, |u, v| u + FURTHER * (v - u));
    along.zip_map(&straight, |along, straight| {
        straight + part * (along - straight)
    })
}

/// The part of a displacement in anchors that are displaced by `further` on the interface of `u`.
fn displaced_part<const D: usize>(further: &Stored<D>, u: &Stored<D>) -> f64 {
    /// The displacement of the anchor, in units of `4 eps / 3`, at which both count alike.
    const ALIKE: f64 = 0.02;
    let longest = largest(further, u);
    longest * longest / (longest * longest + ALIKE * ALIKE)
}

/// The largest size of a displacement on the interface of `u`.
fn largest<const D: usize>(displacement: &Stored<D>, u: &Stored<D>) -> f64 {
    let on = displacement.zip_map(u, |y, u| if on_interface(u) > 0.5 { y } else { 0.0 });
    on.largest()
}

/// The displacements, scaled down so that none is longer than a start may anticipate.
fn limited<const D: usize>(displacement: &Stored<D>) -> Stored<D> {
    let factor = FARTHEST / displacement.largest().max(FARTHEST);
    displacement.map(|y| factor * y)
}
