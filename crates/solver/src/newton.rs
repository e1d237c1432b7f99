//! Newton's method for one minimizing movement.
//!
//! Two variants share the same inputs and outputs. [`NewtonVariant::Preconditioned`] is the one to use. [`NewtonVariant::Paper`] is the
//! plain Newton-CG with Armijo's rule of the paper, kept for comparison.

use std::cell::Cell;
use std::ops::RangeInclusive;

use burn::tensor::Tensor;
use operators::{ComputeDevice, add_scaled, retract, squared_distance};
use serde::{Deserialize, Serialize};

use crate::cg::{CgLimits, CgSolution, Quadratic, conjugate_gradients, dot};
use crate::constraints::{Place, Restoring, Tangent};
use crate::preconditioner::{Level, Preconditioner};
use crate::region::Region;
use crate::times::{PhaseTimes, timed};
use crate::{Error, NewtonParams, NewtonVariant, Objective};

/// Why a minimization ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Exit {
    /// The stop test holds.
    #[default]
    Converged,
    /// The gradient vanishes to rounding: `u` is a minimizer already.
    Stationary,
    /// No step along a descent direction lowers the energy by more than rounding, or none is expected to.
    Precision,
    /// The limit of Newton steps was reached.
    IterationLimit,
}

/// What a minimization did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NewtonInfo {
    /// Why it ended.
    pub exit: Exit,
    /// Newton steps.
    pub newton: usize,
    /// Hessian-vector products.
    pub hvp: usize,
    /// Energy evaluations without gradient.
    pub values: usize,
    /// Gradient evaluations.
    pub gradients: usize,
    /// Linear solves that met negative curvature.
    pub negative_curvature: usize,
    /// Energy (scaled as in [`crate::MinimizingMovement`]) at the previous phase field.
    pub energy_before: f64,
    /// Energy at the result.
    pub energy: f64,
    /// Estimated distance to the minimizer, relative to the motion: the quantity of the stop test.
    pub estimate: f64,
}

impl NewtonInfo {
    /// With the work of a minimization before it.
    pub(crate) fn after(self, first: &Self) -> Self {
        Self {
            newton: first.newton + self.newton,
            hvp: first.hvp + self.hvp,
            values: first.values + self.values,
            gradients: first.gradients + self.gradients,
            negative_curvature: first.negative_curvature + self.negative_curvature,
            ..self
        }
    }
}

/// A phase field with its energy.
struct Point<const D: usize> {
    u: Tensor<D>,
    energy: f64,
    tangent: Option<Tangent<D>>,
}

/// A point with its gradient; the objective's own point is this one.
struct Evaluated<const D: usize> {
    point: Point<D>,
    gradient: Tensor<D>,
}

/// A point and the direction down from it. The gradient is gone: the points that are tried next need its memory.
struct Descent<const D: usize> {
    from: Point<D>,
    solution: CgSolution<D>,
}

/// A Newton step that lowers the energy by a smaller part of its slope gains next to nothing; one to the minimum of the quadratic model gains half.
const POOR: f64 = 0.01;
/// So many of them in a row end a minimization that holds sizes.
const MOST_POOR: usize = 2;
/// A single one ends it where the estimated distance to the minimum is larger than this part of the motion. Then a shorter time step is cheaper than to go
/// on. A tolerance that is a hundred times smaller asks for many Newton steps anyway, and there two are needed.
const FAR: f64 = 0.1;
/// Parts of a Newton step that are tried on a straight line.
const STRAIGHT: RangeInclusive<f64> = 1e-6..=1.0;

/// How the Newton steps of a minimization that holds sizes get on.
#[derive(Default)]
struct Progress {
    /// The smallest estimate so far.
    smallest: Option<f64>,
    /// How many Newton steps ago it was half as small as before.
    since: usize,
    /// Where the last Newton step began.
    last: Option<Outlook>,
    /// How many of the last steps were poor.
    poor: usize,
}

/// The energy where a Newton step begins, and its slope along the direction there.
#[derive(Clone, Copy)]
struct Outlook {
    energy: f64,
    slope: f64,
}

impl Progress {
    /// Whether for a while no estimate has been half of the smallest one, or the last steps were [poor](POOR): there the measures bend
    /// so much that only the shortest steps can be brought back to their targets, and many of them would follow.
    fn has_stalled(&mut self, estimate: f64, tolerance: f64, now: Outlook) -> bool {
        /// Newton steps; those that converge take fewer for a digit.
        const PATIENCE: usize = 10;
        if self
            .smallest
            .is_none_or(|smallest| estimate <= 0.5 * smallest)
        {
            (self.smallest, self.since) = (Some(estimate), 0);
        } else {
            self.since += 1;
        }
        let is_poor = (self.last).is_some_and(|last| last.energy - now.energy < POOR * last.slope);
        self.last = Some(now);
        self.poor = if is_poor { self.poor + 1 } else { 0 };
        let is_far = estimate > FAR && tolerance > 0.01 * FAR;
        let most = if is_far { 1 } else { MOST_POOR };
        self.poor >= most || self.since >= PATIENCE
    }
}

/// Why a minimization ended, and where: the phase field and its energy.
type End<const D: usize> = (Exit, (Tensor<D>, f64));

struct Minimizer<'a, 'h, const D: usize, O> {
    objective: &'a mut O,
    region: Option<&'a Region<D>>,
    /// The values outside of it.
    fixed: &'a Tensor<D>,
    held: Option<&'a mut Restoring<'h, D>>,
    params: NewtonParams,
    device: &'a ComputeDevice,
    preconditioner: Option<Preconditioner<D>>,
    previous: &'a Tensor<D>,
    unknowns: f64,
    info: NewtonInfo,
    times: Cell<PhaseTimes>,
}

/// Minimizes `objective` from `start`, or from `previous`, the phase field before the step, if its energy is lower. Motions are differences to `previous`.
///
/// # Errors
/// [`Error::Geometry`]; [`Error::NonFinite`] (with step 0: the caller knows the number) if the start has no finite energy;
/// device errors.
pub fn minimize<const D: usize>(
    objective: &mut impl Objective<D>,
    previous: &Tensor<D>,
    start: &Tensor<D>,
    params: NewtonParams,
    device: &ComputeDevice,
) -> Result<(Tensor<D>, NewtonInfo), Error> {
    let (u, info, _) = minimize_timed(
        objective,
        Restrictions::default(),
        previous,
        start,
        None,
        params,
        device,
    )?;
    Ok((u, info))
}

/// What restricts the values of a minimization.
#[derive(Default)]
pub(crate) struct Restrictions<'a, 'b, const D: usize> {
    /// Where values change; everywhere if there is none.
    pub region: Option<&'a Region<D>>,
    /// The values elsewhere, if they are not those from before the step.
    pub fixed: Option<&'a Tensor<D>>,
    /// What brings perimeter and volume back to their targets.
    pub held: Option<&'a mut Restoring<'b, D>>,
}

/// [`minimize`] under constraints, with a preconditioner and the time of its parts.
pub(crate) fn minimize_timed<const D: usize>(
    objective: &mut impl Objective<D>,
    Restrictions {
        region,
        fixed,
        held,
    }: Restrictions<'_, '_, D>,
    previous: &Tensor<D>,
    start: &Tensor<D>,
    preconditioner: Option<Preconditioner<D>>,
    params: NewtonParams,
    device: &ComputeDevice,
) -> Result<(Tensor<D>, NewtonInfo, PhaseTimes), Error> {
    params.validate()?;
    let times = Cell::<PhaseTimes>::default();
    let energy_before = timed(&times, |t| &mut t.energies, || objective.value(previous))?;
    if !energy_before.is_finite() {
        return Err(Error::non_finite(0, "energy"));
    }
    let mut minimizer = Minimizer {
        objective,
        region,
        fixed: fixed.unwrap_or(previous),
        held,
        params,
        device,
        preconditioner: preconditioner.filter(|_| params.variant == NewtonVariant::Preconditioned),
        previous,
        unknowns: previous.shape().num_elements() as f64,
        info: NewtonInfo {
            exit: Exit::IterationLimit,
            values: 1,
            energy_before,
            energy: energy_before,
            estimate: f64::INFINITY,
            ..NewtonInfo::default()
        },
        times,
    };
    let (exit, (u, energy)) = match params.variant {
        NewtonVariant::Preconditioned => minimizer.preconditioned(start)?,
        NewtonVariant::Paper => minimizer.paper()?,
    };
    (minimizer.info.exit, minimizer.info.energy) = (exit, energy);
    // Restoring adds nothing to values outside of the region, which makes 0.0 of -0.0: they are put back.
    let u = minimizer.keep_outside(minimizer.found(&u, true)?.u);
    Ok((u, minimizer.info, minimizer.times.get()))
}

impl<const D: usize, O: Objective<D>> Minimizer<'_, '_, D, O> {
    /// `u` with the values that may not change put back, where there are such.
    fn keep_outside(&self, u: Tensor<D>) -> Tensor<D> {
        Region::hold(self.region, u, self.fixed)
    }

    /// The phase field near `u` at which the energy counts; none if nothing near it fulfils the constraints.
    fn place(&self, u: Tensor<D>) -> Result<Option<Place<D>>, Error> {
        match &self.held {
            Some(held) => held.restored(u, false, |u| self.keep_outside(u)),
            None => Ok(Some(Place { u, tangent: None })),
        }
    }

    /// The same, exactly if so said, and where there is none, the error that says so.
    fn found(&self, u: &Tensor<D>, exactly: bool) -> Result<Place<D>, Error> {
        let (u, tangent) = (self.keep_outside(u.clone()), None);
        let Some(held) = &self.held else {
            return Ok(Place { u, tangent });
        };
        match held.restored(u.clone(), exactly, |u| self.keep_outside(u))? {
            Some(place) => Ok(place),
            None => Err(held.lost(&u)?),
        }
    }

    fn evaluate(&mut self, Place { u, tangent }: Place<D>) -> Result<Evaluated<D>, Error> {
        let (energy, gradient) = timed(
            &self.times,
            |t| &mut t.energies,
            || self.objective.evaluate(&u),
        )?;
        self.info.gradients += 1;
        Ok(Evaluated {
            point: Point {
                u,
                energy: energy + self.excess(tangent.as_ref()),
                tangent,
            },
            gradient: Region::project(self.region, gradient),
        })
    }

    /// A point again: the objective's own point is another by now.
    fn return_to(&mut self, Point { u, tangent, .. }: Point<D>) -> Result<Evaluated<D>, Error> {
        self.evaluate(Place { u, tangent })
    }

    /// A point that may turn out to be too far: none where the mean curvature step fails, or the constraints are out of reach.
    fn trial(&mut self, u: Tensor<D>) -> Result<Option<Evaluated<D>>, Error> {
        let Some(place) = self.place(u)? else {
            return Ok(None);
        };
        match self.evaluate(place) {
            Ok(trial) => Ok(Some(trial).filter(|trial| trial.point.energy.is_finite())),
            Err(Error::Step(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn energy(&mut self, place: &Place<D>) -> Result<f64, Error> {
        self.info.values += 1;
        let energy = timed(
            &self.times,
            |t| &mut t.energies,
            || self.objective.value(&place.u),
        )?;
        Ok(energy + self.excess(place.tangent.as_ref()))
    }

    /// What the energy counts for constraints that are not met to rounding.
    fn excess(&self, tangent: Option<&Tangent<D>>) -> f64 {
        match (&self.held, tangent) {
            (Some(held), Some(tangent)) => held.excess(tangent),
            _ => 0.0,
        }
    }

    fn solve(
        &mut self,
        Evaluated { point, gradient }: Evaluated<D>,
        limits: CgLimits,
        level: Level,
    ) -> Result<Descent<D>, Error> {
        let (preconditioner, device) = (self.preconditioner.as_ref(), self.device);
        let times = &self.times;
        let precondition = |r: &Tensor<D>| {
            let apply = || match preconditioner {
                Some(preconditioner) => preconditioner.apply(r, level, times),
                None => r.clone(),
            };
            timed(times, |t| &mut t.preconditioner, apply)
        };
        let quadratic = Quadratic {
            gradient: &gradient,
            dtype: (self.objective.product_dtype()).unwrap_or(gradient.dtype()),
            unit: self.objective.unit(),
            product: &mut |p| {
                let product = || self.objective.hessian_vector_product(p);
                let product = timed(times, |t| &mut t.products, product)?;
                Ok(Region::project(self.region, product))
            },
        };
        let solution = match (&mut self.held, &point.tangent) {
            (Some(held), Some(tangent)) => {
                let keep = level == Level::Both;
                held.solve(quadratic, tangent, &precondition, limits, keep)?
            }
            _ => conjugate_gradients(quadratic, &precondition, limits, device)?.solution,
        };
        self.info.hvp += solution.iterations;
        self.info.negative_curvature += usize::from(solution.negative_curvature);
        if !solution.slope.is_finite() {
            return Err(Error::non_finite(0, "search direction"));
        }
        Ok(Descent {
            from: point,
            solution,
        })
    }

    /// The smallest difference of energies that means anything.
    fn noise(&self, energy: f64) -> f64 {
        8.0 * self.device.epsilon() * energy.abs()
    }

    /// The sum of the squares of the motion so far.
    fn motion(&self, point: &Point<D>) -> Result<f64, Error> {
        let square = squared_distance(&point.u, self.previous);
        Ok(self.device.scalar(square)?)
    }

    /// The stop test: `sqrt(-g . p / N)` against the root mean square of the motion. Invariant under scaling of the
    /// energy, and never satisfied by standing still unless the gradient vanishes.
    fn converged(&mut self, motion: f64, slope: f64) -> Option<Exit> {
        let decrement = slope.abs() / self.objective.unit();
        self.info.estimate = (decrement / motion.max(f64::MIN_POSITIVE)).sqrt();
        let smallest = match &self.held {
            Some(held) => held.noise(),
            None => self.device.epsilon(),
        };
        if decrement <= smallest * smallest * self.unknowns {
            Some(Exit::Stationary)
        } else if self.info.estimate <= self.params.tolerance {
            Some(Exit::Converged)
        } else {
            None
        }
    }

    /// A few preconditioned iterations on the new Hessian: they remove the stiff error that a long step leaves in the
    /// profile, before the energy is compared.
    fn clean(&mut self, mut evaluated: Evaluated<D>) -> Result<Evaluated<D>, Error> {
        const ROUNDS: usize = 3;
        const WORTHWHILE: f64 = 0.05;
        let limits = CgLimits {
            tolerance: 0.2,
            least: 0.0,
            iterations: self.params.cleanup_iterations,
        };
        if limits.iterations == 0 {
            return Ok(evaluated);
        }
        for _ in 0..ROUNDS {
            let Descent { from, solution } = self.solve(evaluated, limits, Level::Phase)?;
            // The full step nearly always lowers the energy: it is evaluated with its gradient at once.
            let sign = -solution.slope.signum();
            let full = add_scaled(from.u.clone(), &solution.direction, sign);
            let next = match self.trial(full)? {
                Some(next) if next.point.energy < from.energy => next,
                _ => match self.straight(&from, &solution, 0.05..=0.5, 0.0)? {
                    Some((place, _)) => self.evaluate(place)?,
                    None => return self.return_to(from),
                },
            };
            let gain = from.energy - next.point.energy;
            evaluated = next;
            if gain <= WORTHWHILE * from.energy.abs() {
                break;
            }
        }
        Ok(evaluated)
    }

    /// Backtracks from the longest of these parts of a step along the straight line until the energy falls by `sufficient * t * slope`.
    fn straight(
        &mut self,
        point: &Point<D>,
        solution: &CgSolution<D>,
        parts: RangeInclusive<f64>,
        sufficient: f64,
    ) -> Result<Option<(Place<D>, f64)>, Error> {
        let (mut t, sign) = (*parts.end(), -solution.slope.signum());
        while t >= *parts.start() {
            let u = add_scaled(point.u.clone(), &solution.direction, sign * t);
            if let Some(place) = self.place(u)? {
                let energy = self.energy(&place)?;
                if energy < point.energy - sufficient * t * solution.slope.abs() {
                    return Ok(Some((place, energy)));
                }
            }
            t *= 0.5;
        }
        Ok(None)
    }

    /// Newton's method with the preconditioner, from the better of `start` and the previous phase field.
    fn preconditioned(&mut self, start: &Tensor<D>) -> Result<End<D>, Error> {
        let mut evaluated = self.better_start(start)?;
        let mut progress = Progress::default();
        while self.info.newton < self.params.newton_iterations {
            let motion = self.motion(&evaluated.point)?;
            let accuracy = self.params.linear_accuracy.unwrap_or(0.0);
            let limits = CgLimits {
                tolerance: self.params.cg_tolerance,
                least: accuracy.powi(2) * motion * self.objective.unit(),
                iterations: self.params.cg_iterations,
            };
            if let Some(preconditioner) = &mut self.preconditioner {
                let follow = || preconditioner.follow(&evaluated.point.u, self.device, &self.times);
                timed(&self.times, |t| &mut t.assembly, follow)?;
            }
            let Descent { from, solution } = self.solve(evaluated, limits, Level::Both)?;
            let decrease = solution.slope.abs();
            // No search finds a decrease below the rounding of the energy.
            let lost = !solution.negative_curvature && decrease <= self.noise(from.energy);
            let done = self.converged(motion, solution.slope);
            self.info.newton += 1;
            if let Some(exit) = done.or(lost.then_some(Exit::Precision)) {
                return Ok((exit, self.last_step(from, &solution, lost)?));
            }
            // Sizes that a step of this length cannot hold: a shorter one is tried instead.
            let outlook = Outlook {
                energy: from.energy,
                slope: decrease,
            };
            if self.held.is_some()
                && !self.is_rounding(decrease, from.energy)
                && progress.has_stalled(self.info.estimate, self.params.tolerance, outlook)
            {
                return Ok((Exit::IterationLimit, (from.u, from.energy)));
            }
            evaluated = match self.along_the_profile(&from, &solution)? {
                Some(next) => next,
                None => match self.straight(&from, &solution, STRAIGHT, 1e-4)? {
                    Some((place, _)) => self.evaluate(place)?,
                    None => {
                        let exit = self.stuck(decrease, from.energy);
                        return Ok((exit, (from.u, from.energy)));
                    }
                },
            };
        }
        let Point { u, energy, .. } = evaluated.point;
        Ok((Exit::IterationLimit, (u, energy)))
    }

    /// The start with a clean profile, or the previous phase field if the energy is lower there.
    fn better_start(&mut self, start: &Tensor<D>) -> Result<Evaluated<D>, Error> {
        let place = match self.place(self.keep_outside(start.clone()))? {
            Some(place) => place,
            None => self.found(self.previous, false)?,
        };
        let evaluated = self.evaluate(place)?;
        if !evaluated.point.energy.is_finite() {
            return Err(Error::non_finite(0, "energy of the start"));
        }
        let cleaned = self.clean(evaluated)?;
        if cleaned.point.energy <= self.info.energy_before {
            return Ok(cleaned);
        }
        let point = cleaned.point;
        // Where a target moves, so does the energy of standing still.
        let previous = self.evaluate(self.found(self.previous, false)?)?;
        if previous.point.energy < point.energy {
            return Ok(previous);
        }
        self.return_to(point)
    }

    /// The result of the whole last Newton step, or the point before it if the step raises the energy. A rise by rounding does not count where the expected
    /// decrease is `lost` in rounding.
    fn last_step(
        &mut self,
        point: Point<D>,
        solution: &CgSolution<D>,
        lost: bool,
    ) -> Result<(Tensor<D>, f64), Error> {
        let u = retract(&point.u, &solution.direction, -solution.slope.signum());
        if let Some(place) = self.place(self.keep_outside(u))? {
            let energy = self.energy(&place)?;
            let rounding = if lost { self.noise(point.energy) } else { 0.0 };
            if energy <= point.energy + rounding {
                return Ok((place.u, energy));
            }
        }
        Ok((point.u, point.energy))
    }

    /// Backtracks along motions that keep the profile, each of which is cleaned before its energy counts.
    fn along_the_profile(
        &mut self,
        point: &Point<D>,
        solution: &CgSolution<D>,
    ) -> Result<Option<Evaluated<D>>, Error> {
        const HOPELESS: f64 = 50.0;
        const SHORTEST: f64 = 0.02;
        let (sign, decrease) = (-solution.slope.signum(), solution.slope.abs());
        let mut t = 1.0;
        while t >= SHORTEST {
            let u = retract(&point.u, &solution.direction, sign * t);
            let trial = self.trial(self.keep_outside(u))?;
            let hopeless = HOPELESS * point.energy.abs();
            if let Some(trial) = trial.filter(|trial| trial.point.energy < hopeless) {
                let cleaned = self.clean(trial)?;
                if cleaned.point.energy <= point.energy - 1e-3 * t * decrease {
                    return Ok(Some(cleaned));
                }
            }
            t *= 0.4;
        }
        Ok(None)
    }

    /// Whether an expected decrease drowns in rounding.
    fn is_rounding(&self, decrease: f64, energy: f64) -> bool {
        decrease <= self.noise(energy) * self.unknowns.sqrt()
    }

    /// No step lowered the energy: either the expected decrease drowns in rounding, or the method failed.
    fn stuck(&self, decrease: f64, energy: f64) -> Exit {
        if self.is_rounding(decrease, energy) {
            Exit::Precision
        } else {
            Exit::IterationLimit
        }
    }

    /// The method of the paper: from `u_k`, conjugate gradients with a forcing sequence, Armijo backtracking on a straight line.
    fn paper(&mut self) -> Result<End<D>, Error> {
        let mut evaluated = self.evaluate(self.found(self.previous, false)?)?;
        let first = self.norm(&evaluated.gradient)?;
        while self.info.newton < self.params.newton_iterations {
            let norm = self.norm(&evaluated.gradient)?;
            let forcing = (norm / first.max(f64::MIN_POSITIVE)).sqrt().min(0.5);
            let limits = CgLimits {
                tolerance: forcing.min(self.params.cg_tolerance),
                least: 0.0,
                iterations: self.params.cg_iterations,
            };
            let Descent { from, solution } = self.solve(evaluated, limits, Level::Both)?;
            let done = self.converged(self.motion(&from)?, solution.slope);
            self.info.newton += 1;
            let next = self.straight(&from, &solution, STRAIGHT, 1e-4)?;
            evaluated = match (done, next) {
                (None, Some((place, _))) => self.evaluate(place)?,
                (Some(exit), Some((place, energy))) => return Ok((exit, (place.u, energy))),
                (done, None) => {
                    let stuck = self.stuck(solution.slope.abs(), from.energy);
                    return Ok((done.unwrap_or(stuck), (from.u, from.energy)));
                }
            };
        }
        let Point { u, energy, .. } = evaluated.point;
        Ok((Exit::IterationLimit, (u, energy)))
    }

    fn norm(&self, vector: &Tensor<D>) -> Result<f64, Error> {
        Ok(dot(vector, vector, self.device)?.sqrt())
    }
}
