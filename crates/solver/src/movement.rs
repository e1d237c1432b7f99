//! Minimizations of the energy of a movement, wherever values are stored.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{NodeSet, Nodes};

use crate::bounds::{Active, BoundsOn};
use crate::cg::dot;
use crate::constraints::{Constraints, Restoring};
use crate::newton::{NewtonInfo, Restrictions, minimize_timed};
use crate::preconditioner::Preconditioner;
use crate::region::Region;
use crate::times::PhaseTimes;
use crate::{
    Accuracy, Bounds, DeviceField, Domain, EnergyTerms, Error, Exit, FlowParams, MeanCurvatureStep,
    MinimizingMovement, MovementGraph, Objective, PhaseInverse, PhaseInverses, Problem, State,
    bricks,
};

/// The largest part of the energy that may lie in what is missing of the targets.
const TOLD: f64 = 0.1;
/// Rounds in which nodes go to their bounds and from them.
const ROUNDS: usize = 12;

/// One minimization, of `1/2 |s (u - a)|^2` and the weighted energy.
#[derive(Clone, Debug)]
pub struct Movement<const D: usize> {
    /// The anchor `a`.
    pub anchor: DeviceField<D>,
    /// The factors `s` of the motion, if it is weighted.
    pub factors: Option<DeviceField<D>>,
    /// Where the minimization begins.
    pub start: DeviceField<D>,
    /// The time step, which weighs the energy.
    pub tau: f64,
    /// The sizes that are held.
    pub targets: Constraints,
}

impl<const D: usize> Movement<D> {
    /// The same from another start, stored at other nodes.
    fn on(&self, nodes: &Nodes<D>, start: &DeviceField<D>) -> Result<Self, Error> {
        let factors = self.factors.as_ref();
        Ok(Self {
            anchor: self.anchor.on(nodes)?,
            factors: factors.map(|factors| factors.on(nodes)).transpose()?,
            start: start.on(nodes)?,
            ..*self
        })
    }

    /// `1/2 |s (u - a)|^2`, in the inner product of the step inside.
    fn fidelity(&self, inner: &dyn MeanCurvatureStep<D>, u: &Tensor<D>) -> Result<f64, Error> {
        let mut motion = u.clone() - self.anchor.values().clone();
        if let Some(factors) = &self.factors {
            motion = motion * factors.values().clone();
        }
        let square = (motion.clone() * inner.mass(motion)).sum();
        Ok(0.5 * self.anchor.device().scalar(square)?)
    }
}

/// The result of a minimization.
#[derive(Clone, Debug)]
pub struct Minimum<const D: usize> {
    /// The phase field, stored on more bricks than the start where the interface has come near their edge.
    pub u: DeviceField<D>,
    /// Its energy as in [`StepRecord::willmore_energy`](crate::StepRecord::willmore_energy).
    pub willmore_energy: f64,
    /// The multipliers of the sizes that are held, as in [`StepRecord`](crate::StepRecord).
    pub tension: Option<f64>,
    /// Likewise.
    pub pressure: Option<f64>,
    /// What the minimization did.
    pub newton: NewtonInfo,
    /// Wall times.
    pub times: PhaseTimes,
}

/// The minimizations of a problem, with what is traced and uploaded for the nodes at which values are stored. For another problem, or at other nodes, that
/// is made anew.
#[derive(Default)]
pub struct Minimizations<const D: usize> {
    prepared: Option<Prepared<D>>,
}

/// What is prepared for a set of nodes.
struct Prepared<const D: usize> {
    nodes: Nodes<D>,
    /// Of the problem: its parameters, operator, energy and region.
    params: FlowParams,
    operator: Arc<dyn MeanCurvatureStep<D>>,
    terms: EnergyTerms<D>,
    response: u64,
    nodes_that_move: Option<Arc<NodeSet>>,
    step: Arc<dyn MeanCurvatureStep<D>>,
    region: Option<Region<D>>,
    bounds_of: Option<Arc<Bounds<D>>>,
    bounds: Option<Arc<BoundsOn>>,
    domain: Domain<D>,
    /// The energy, and the one with factors of the motion, each traced when it is first minimized.
    energies: [Option<MinimizingMovement<D>>; 2],
    /// The inverses in the pure phases, and the one that is used.
    inverses: PhaseInverses<D>,
    phase: Option<Phase<D>>,
}

/// The inverse in the pure phases for a stiffness.
struct Phase<const D: usize> {
    stiffness: f64,
    inverse: PhaseInverse<D>,
}

impl<const D: usize> Minimizations<D> {
    /// Minimizes the energy of a movement; the tolerance is meant with respect to the motion from the phase field of the state. If the interface comes near
    /// the edge of the bricks, these are made more, and the minimization goes on from there.
    ///
    /// # Errors
    /// [`Error::NonFinite`] naming the field, [`Error::NotConverged`], [`Error::NotHeld`], [`Error::Rushed`]; those of tracing the energy.
    pub fn minimize(
        &mut self,
        problem: &Problem<D>,
        from: &State<D>,
        mut movement: Movement<D>,
    ) -> Result<Minimum<D>, Error> {
        let mut current = from.field.on(movement.anchor.nodes())?;
        let step = from.step + 1;
        let mut minimum = self.minimize_here(problem, &current, &movement, step)?;
        while let Some(nodes) = bricks::enlarged(&minimum.u, problem.params.eps)? {
            movement = movement.on(&nodes, &minimum.u)?;
            current = current.on(&nodes)?;
            let again = self.minimize_here(problem, &current, &movement, step)?;
            minimum = Minimum {
                newton: again.newton.after(&minimum.newton),
                times: minimum.times + again.times,
                ..again
            };
        }
        Ok(minimum)
    }

    /// What is prepared for these nodes.
    fn prepared(
        &mut self,
        problem: &Problem<D>,
        nodes: &Nodes<D>,
    ) -> Result<&mut Prepared<D>, Error> {
        let is_there = |prepared: &Prepared<D>| prepared.serves(problem, nodes);
        let prepared = match self.prepared.take().filter(is_there) {
            Some(prepared) => prepared,
            None => Prepared::new(problem, nodes)?,
        };
        Ok(self.prepared.insert(prepared))
    }

    /// The minimization on the values that are stored now, in the step of this number.
    fn minimize_here(
        &mut self,
        problem: &Problem<D>,
        current: &DeviceField<D>,
        movement: &Movement<D>,
        step: usize,
    ) -> Result<Minimum<D>, Error> {
        let (params, device) = (&problem.params, &problem.device);
        let prepared = self.prepared(problem, movement.anchor.nodes())?;
        let stiffness = params.stiffness(movement.tau);
        let phase = prepared.fit(problem, stiffness);
        let nodes = prepared.nodes.clone();
        let inner = prepared.step.clone();
        let bounds = prepared.bounds.clone();
        let (energy, region) = prepared.energy(movement, stiffness)?;
        energy.set_cancel(problem.cancel.clone());
        let mut minimizing = Minimizing {
            energy,
            region,
            phase,
            nodes,
            stiffness,
            params,
            current,
            movement,
        };
        let found = match bounds {
            Some(bounds) => minimizing.within(bounds),
            None => minimizing.run(region, None, movement.start.values()),
        };
        let Found {
            u,
            newton,
            times,
            multipliers,
        } = found.map_err(|error| error.at(step))?;
        if newton.exit == Exit::IterationLimit {
            return Err(Error::NotConverged {
                step,
                estimate: newton.estimate,
                tolerance: params.newton.tolerance,
            });
        }
        // Far from overflow, the sum of their squares is finite if the values are.
        if !dot(&u, &u, device)?.is_finite() {
            return Err(Error::non_finite(step, "phase field"));
        }
        let fidelity = movement.fidelity(&*inner, &u)?;
        let rest = newton.energy - fidelity;
        let energy = rest.abs().max(newton.energy_before.abs());
        if let Some(multipliers) = multipliers
            && movement.targets.energy_error(multipliers) > TOLD * energy
        {
            return Err(Error::Rushed { step });
        }
        // The energy of standing still is 2 tau w.
        let unit = problem.energy_scale() / (2.0 * movement.tau);
        let multipliers = multipliers.map(|values| values.map(|value| unit * value));
        let [tension, pressure] = multipliers.unwrap_or_default();
        let targets = movement.targets;
        Ok(Minimum {
            u: current.with(u),
            tension: targets.perimeter.map(|_| tension),
            pressure: targets.volume.map(|_| pressure),
            willmore_energy: problem.energy_scale() * rest / (2.0 * movement.tau),
            newton,
            times,
        })
    }
}

/// A minimization that may be made several times, with other nodes held.
struct Minimizing<'a, const D: usize> {
    energy: &'a mut MinimizingMovement<D>,
    region: Option<&'a Region<D>>,
    phase: PhaseInverse<D>,
    nodes: Nodes<D>,
    stiffness: f64,
    params: &'a FlowParams,
    current: &'a DeviceField<D>,
    movement: &'a Movement<D>,
}

/// What it ends in.
struct Found<const D: usize> {
    u: Tensor<D>,
    newton: NewtonInfo,
    times: PhaseTimes,
    multipliers: Option<[f64; 2]>,
}

impl<const D: usize> Minimizing<'_, D> {
    /// In a region, with fixed values elsewhere, or those of the current phase field.
    fn run(
        &mut self,
        region: Option<&Region<D>>,
        fixed: Option<&Tensor<D>>,
        start: &Tensor<D>,
    ) -> Result<Found<D>, Error> {
        let (current, params) = (self.current, self.params);
        let preconditioner = Preconditioner {
            phase: self.phase.clone(),
            nodes: self.nodes.clone(),
            eps: params.eps,
            tau: self.movement.tau,
            stiffness: self.stiffness,
            region: region.cloned(),
            interface: None,
        };
        let mut held = Restoring::new(&self.movement.targets, current, params.eps, region);
        let (u, newton, times) = minimize_timed(
            self.energy,
            Restrictions {
                region,
                fixed,
                held: held.as_mut(),
            },
            current.values(),
            start,
            Some(preconditioner),
            params.newton,
            current.device(),
        )?;
        Ok(Found {
            u,
            newton,
            times,
            multipliers: held.map(|held| held.multipliers),
        })
    }

    /// Under bounds.
    fn within(&mut self, bounds: Arc<BoundsOn>) -> Result<Found<D>, Error> {
        let (device, shape) = (self.current.device(), self.current.values().dims());
        let base = self.region;
        let mut found = self.run(base, None, self.movement.start.values())?;
        let mut active = Active::none(bounds);
        for _ in 0..ROUNDS {
            let values = device.values(found.u.clone())?;
            let gradient = if active.is_empty() {
                None
            } else {
                Some(self.gradient(&found)?)
            };
            if !active.update(&values, gradient.as_deref()) {
                return Ok(found);
            }
            let region = active.region(base, shape, device);
            let clamped = active.clamped(&values, shape, device);
            let fixed = Region::hold(base, clamped, self.current.values());
            let next = self.run(Some(&region), Some(&fixed), &fixed)?;
            found = Found {
                newton: next.newton.after(&found.newton),
                times: found.times + next.times,
                ..next
            };
        }
        // Few nodes are left, which are beyond their bounds by little.
        let values = device.values(found.u)?;
        let clamped = active.clamped(&values, shape, device);
        found.u = Region::hold(base, clamped, self.current.values());
        Ok(found)
    }

    /// The gradient of the energy with what is held, also at nodes that are.
    fn gradient(&mut self, found: &Found<D>) -> Result<Vec<f64>, Error> {
        let (_, gradient) = self.energy.evaluate(&found.u)?;
        let mut gradient = self.current.device().values(gradient)?;
        let targets = &self.movement.targets;
        let held = Restoring::new(targets, self.current, self.params.eps, None);
        if let (Some(held), Some(multipliers)) = (held, found.multipliers) {
            for (slope, pull) in gradient.iter_mut().zip(held.pull(&found.u, multipliers)?) {
                *slope += pull;
            }
        }
        Ok(gradient)
    }
}

impl<const D: usize> Prepared<D> {
    fn new(problem: &Problem<D>, nodes: &Nodes<D>) -> Result<Self, Error> {
        let step = problem.operator_on(nodes)?;
        let inverses = step.phase_inverses(nodes, &problem.device);
        let region = problem.region.as_ref();
        let region = region.map(|region| Region::new(nodes, region, &problem.device));
        Ok(Self {
            nodes: nodes.clone(),
            params: problem.params,
            operator: problem.operator.clone(),
            terms: problem.terms.clone(),
            response: problem.response.to_bits(),
            nodes_that_move: problem.region.clone(),
            step,
            region,
            bounds: problem.bounds.as_ref().map(|bounds| bounds.on(nodes)),
            bounds_of: problem.bounds.clone(),
            domain: problem.domain(nodes),
            energies: [None, None],
            inverses: inverses.map_err(Error::Operator)?,
            phase: None,
        })
    }

    /// Whether it is what such a minimization needs.
    fn serves(&self, problem: &Problem<D>, nodes: &Nodes<D>) -> bool {
        let same_region = are_same(self.nodes_that_move.as_ref(), problem.region.as_ref());
        let same_bounds = are_same(self.bounds_of.as_ref(), problem.bounds.as_ref());
        let terms = self.terms.iter().zip(&problem.terms);
        let same_terms = self.terms.len() == problem.terms.len()
            && terms
                .into_iter()
                .all(|(own, other)| Arc::ptr_eq(own, other));
        same_region
            && same_bounds
            && self.params == problem.params
            && Arc::ptr_eq(&self.operator, &problem.operator)
            && self.response == problem.response.to_bits()
            && same_terms
            && self.nodes == *nodes
    }

    /// Fits preconditioner and accuracy to a weight of the curvature.
    fn fit(&mut self, problem: &Problem<D>, stiffness: f64) -> PhaseInverse<D> {
        match &self.phase {
            Some(phase) if phase.stiffness.to_bits() == stiffness.to_bits() => {
                phase.inverse.clone()
            }
            _ => {
                let inverse = (self.inverses)(stiffness);
                self.phase = Some(Phase {
                    stiffness,
                    inverse: inverse.clone(),
                });
                self.step.set_accuracy(&Accuracy {
                    stiffness,
                    tolerance: problem.params.newton.tolerance,
                    cg_tolerance: problem.params.newton.cg_tolerance,
                });
                inverse
            }
        }
    }

    /// The energy of a movement, and the region in which values move.
    fn energy(
        &mut self,
        movement: &Movement<D>,
        stiffness: f64,
    ) -> Result<(&mut MinimizingMovement<D>, Option<&Region<D>>), Error> {
        let (anchor, factors) = (movement.anchor.values(), movement.factors.as_ref());
        let energy = &mut self.energies[usize::from(factors.is_some())];
        let traced = match energy.take() {
            Some(traced) => traced,
            None => MinimizingMovement::traced(MovementGraph {
                step: self.step.clone(),
                domain: &self.domain,
                terms: &self.terms,
                unit: self.params.energy_unit(),
                products: self.params.newton.precision,
                weighted: factors.is_some(),
            })?,
        };
        let energy = energy.insert(traced);
        if let Some(factors) = factors {
            energy.set_factors(factors.values());
        }
        energy.set(anchor, stiffness)?;
        Ok((energy, self.region.as_ref()))
    }
}

/// Whether both are one, or neither is there.
fn are_same<T>(own: Option<&Arc<T>>, other: Option<&Arc<T>>) -> bool {
    match (own, other) {
        (Some(own), Some(other)) => Arc::ptr_eq(own, other),
        (own, other) => own.is_none() && other.is_none(),
    }
}
