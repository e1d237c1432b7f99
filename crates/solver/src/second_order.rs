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

use crate::constraints::Constraints;
use crate::displacement::{
    curvature_weight, depth, displaced, displacement, metric_weight, on_interface, widths_between,
    window,
};
use crate::movement::{Minimizations, Minimum, Movement};
use crate::record::At;
use crate::{
    Candidate, DeviceField, Error, Memory, Problem, Scheme, Start, StartKind, State, StepRecord,
    StepSize,
};

/// `gamma = 1 - 1/sqrt 2`: the size of a stage over that of the step.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// `1 + sqrt 2 = (1 - gamma) / gamma`: how much further than the first stage the anchor of the second is displaced.
const FURTHER: f64 = 1.0 + std::f64::consts::SQRT_2;
/// The rate of displacement at the end of the last step, in `atanh u` per time, in the [memory](Memory) of a state.
const RATE: &str = "rate";
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

/// Steps of second order, in two minimizations each. Starts on half grids are not used.
///
/// In the record, `energy_before` and `energy` are `2 tau w` of the Willmore energies before and after the step, as the scheme measures them, and
/// there are [estimates](StepEstimates).
#[derive(Default)]
pub struct SecondOrder<const D: usize> {
    minimizations: Minimizations<D>,
}

impl<const D: usize> SecondOrder<D> {
    /// The scheme, before it has prepared anything.
    pub fn new() -> Self {
        Self::default()
    }

    /// One stage: the minimization from an anchor, weighted for the displacement that is expected of it.
    fn minimum(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        stage: &Stage<'_, D>,
    ) -> Result<Minimum<D>, Error> {
        let long = displaced_part(&stage.expected.map(|y| FURTHER * y), stage.start);
        let factors = factors(stage, long, problem.params.eps);
        self.minimizations.minimize(
            problem,
            from,
            Movement {
                anchor: problem.upload(stage.anchor),
                factors: Some(DeviceField::upload(&factors, &problem.device)),
                start: problem.upload(stage.start),
                tau: stage.tau,
                targets: stage.targets,
            },
        )
    }
}

impl<const D: usize> SecondOrder<D> {
    /// Both stages of a step from a state that is on the bricks near its interface.
    fn stages(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        size: StepSize,
    ) -> Result<Stages<D>, Error> {
        let targets = problem.held.at(from.progress + size.part());
        let (before, tau) = (from.field.stored()?, GAMMA * size.tau);
        let rate = from.memory.fields.get(RATE);
        let rate = rate.map(DeviceField::stored).transpose()?;

        let anticipated = anticipated(rate.as_ref(), &before, tau);
        let stage = Stage {
            anchor: &before,
            expected: &anticipated,
            start: &before.zip_map(&limited(&anticipated), displaced),
            tau,
            // Targets are approached evenly, so that both stages go the same way to them.
            targets: targets.after(GAMMA, &before, problem.params.eps)?,
        };
        let first = self.minimum(problem, from, &stage)?;
        let middle = first.u.stored()?;

        let moved = middle.zip_map(&before, displacement);
        let further = moved.map(|y| FURTHER * y);
        let anchor = anchor(&before, &middle, &further);
        let stage = Stage {
            anchor: &anchor,
            expected: &moved,
            start: &middle.zip_map(&further, displaced),
            tau,
            targets,
        };
        let second = self.minimum(problem, from, &stage)?;
        let after = second.u.stored()?;

        let of_stage = |to: &Stored<D>, from| to.zip_map(from, |u, v| displacement(u, v) / tau);
        Ok(Stages {
            rates: [of_stage(&middle, &before), of_stage(&after, &anchor)],
            rate_before: rate,
            states: [before, middle, after],
            minima: [first, second],
        })
    }
}

impl<const D: usize> Scheme<D> for SecondOrder<D> {
    fn step(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        size: StepSize,
    ) -> Result<Candidate<D>, Error> {
        let clock = Instant::now();
        let from = problem.followed(from)?;
        let stages = self.stages(problem, &from, size)?;
        let record = stages.record(problem, &At { from: &from, size }, clock);
        let ([_, rate], [_, second]) = (stages.rates, stages.minima);
        let mut memory = Memory::default();
        let rate = DeviceField::upload(&rate, &problem.device);
        memory.fields.insert(RATE.to_owned(), rate);
        Ok(Candidate {
            state: from.after(size, second.u, memory),
            tau: size.tau,
            record: Some(record),
        })
    }

    fn name(&self) -> &'static str {
        "second_order"
    }

    fn estimates(&self) -> bool {
        true
    }
}

/// A stage of a step.
struct Stage<'a, const D: usize> {
    anchor: &'a Stored<D>,
    /// The displacement that is expected of it.
    expected: &'a Stored<D>,
    /// Where its minimization begins, and about where it leads.
    start: &'a Stored<D>,
    tau: f64,
    targets: Constraints,
}

/// Square roots of the weights with which the `L2` metric measures displacements in a stage, where anchors are displaced by the part `long`.
fn factors<const D: usize>(stage: &Stage<'_, D>, long: f64, eps: f64) -> Stored<D> {
    // The mean curvature is minus the Laplacian of the depth.
    let unit = 4.0 * eps / 3.0;
    let curvature = stage.start.map(|u| unit * depth(u)).laplacian();
    let curvature = curvature.zip_map(stage.start, |laplacian, u| -window(u) * laplacian);
    stage.expected.zip_map(&curvature, |y, h| {
        (metric_weight(y) * curvature_weight(long * h * unit * y)).sqrt()
    })
}

/// The displacement in the time `tau` at the rate of the last step, on the interface of the present phase field.
fn anticipated<const D: usize>(rate: Option<&Stored<D>>, now: &Stored<D>, tau: f64) -> Stored<D> {
    match rate {
        Some(rate) => rate.zip_map(now, |rate, u| rate * window(u) * tau),
        None => now.map(|_| 0.0),
    }
}

/// Steps that have no estimate.
const WITHOUT: usize = 3;

/// Both stages of a step.
struct Stages<const D: usize> {
    /// `u_k`, `U` and `u_{k+1}`.
    states: [Stored<D>; 3],
    /// What the minimizations ended in.
    minima: [Minimum<D>; 2],
    /// The rate of the second stage of the step before, if that was of second order.
    rate_before: Option<Stored<D>>,
    /// The rates of both stages.
    rates: [Stored<D>; 2],
}

impl<const D: usize> Stages<D> {
    /// What the step says of itself.
    fn record(&self, problem: &Problem<D>, at: &At<'_, D>, clock: Instant) -> StepRecord {
        let ([first, second], tau) = (&self.minima, at.size.tau);
        let kind = match self.rate_before {
            Some(_) => StartKind::Extrapolated,
            None => StartKind::Rest,
        };
        // At u_k nothing has moved, and the energy is that of the curvature.
        let at_rest = problem.energy_scale() * first.newton.energy_before / (2.0 * GAMMA * tau);
        StepRecord {
            newton: second.newton.after(&first.newton),
            times: first.times + second.times,
            estimates: Some(self.estimates(at, problem.params.eps)),
            energy_before: 2.0 * tau * at_rest,
            energy: 2.0 * tau * second.willmore_energy,
            ..second.record(at, Start { kind, hvp: 0.0 }, clock)
        }
    }

    /// The lengths that the step is judged by.
    ///
    /// The rates at the times `0`, `gamma tau` and `tau` of the step are `F_0`, that of the second stage of the step before, `F_1` and `F_2`.
    /// The quadrature with weights `b` that is exact for quadratic rates differs from the step's own, `1 - gamma` and `gamma`, by the local error:
    /// `tau |b_0 F_0 + (b_1 - 1 + gamma) F_1 + (b_2 - gamma) F_2|`.
    fn estimates(&self, at: &At<'_, D>, eps: f64) -> StepEstimates {
        const FIRST: f64 = 1.0 / (6.0 * GAMMA * (1.0 - GAMMA));
        const SECOND: f64 = (2.0 - 3.0 * GAMMA) / (6.0 * (1.0 - GAMMA));
        /// Interface that is so many widths from any other has none to which it could have moved.
        const AWAY: f64 = 2.0;
        let ([before, middle, after], [first, second]) = (&self.states, &self.rates);
        let start = self.rate_before.as_ref();
        let unit = 4.0 * eps / 3.0;
        let between =
            |to: &Stored<D>, from| unit * largest(&to.zip_map(from, displacement), middle);
        // Interface of u_k that is gone in U, and of u_{k+1} that is not yet there, is no part of that in the middle: it is seen from those ends.
        let away = |end| {
            let widths = widths_between(end, middle);
            if widths > AWAY { widths * eps } else { 0.0 }
        };
        let [gone, new] = [before, after].map(away);
        let error = start.filter(|_| at.from.step >= WITHOUT).map(|start| {
            let stages = first.zip_map(second, |first, second| {
                (FIRST - 1.0 + GAMMA) * first + (SECOND - GAMMA) * second
            });
            let error = stages.zip_map(start, |stages, start| {
                at.size.tau * (stages + (1.0 - FIRST - SECOND) * start)
            });
            unit * largest(&error, middle)
        });
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
