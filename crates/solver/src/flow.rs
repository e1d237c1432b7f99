//! Willmore flow, step by step, with a record of each, and mean curvature flow.

use std::sync::Arc;
use std::time::Instant;

use burn::tensor::Tensor;
use geometry::{Field, Grid, NodeSet, PhaseField, Stored};
use mean_curvature::{PhaseInverse, PhaseInverses};
use model::{MeanCurvatureOperator, Network, SeparableOperator};
use operators::{ComputeDevice, inner_product};
use serde::{Deserialize, Serialize};

use crate::active::Active;
use crate::constraints::{Constraints, Held};
use crate::newton::{NewtonInfo, minimize_timed};
use crate::preconditioner::Preconditioner;
use crate::region::Region;
use crate::stored::tensor;
use crate::times::PhaseTimes;
use crate::{
    Accuracy, Error, Exit, FlowParams, Helfrich, HelfrichTerms, MeanCurvatureStep,
    MinimizingMovement,
};

mod bricks;
mod second_order;
mod start;

pub use second_order::StepEstimates;
pub use start::{Start, StartKind};

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
    /// curvature, tension or pressure the [energy](Helfrich) that these make of it.
    pub willmore_energy: f64,
    /// Where the minimization began.
    pub start: Start,
    /// What the minimization did.
    pub newton: NewtonInfo,
    /// The surface tension `sigma` that holds the perimeter: `w + sigma A + p V` is stationary but for the motion, `w` being the Willmore
    /// energy, `A` the perimeter, and `V` the volume. Energy per length (2D) or area (3D); positive where the interface wants to grow. It comes
    /// on top of the tension in [`Helfrich`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tension: Option<f64>,
    /// The pressure `p` that holds the volume, likewise: energy per area (2D) or volume (3D), positive where the inside wants to grow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<f64>,
    /// How long the step was against what limits it, if it was of second order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimates: Option<StepEstimates>,
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

/// Where a flow is, for resuming it.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowState<const D: usize> {
    /// The phase field.
    pub current: Stored<D>,
    /// The phase field one step ago and the size of that step: what the next step extrapolates.
    pub previous: Option<(Stored<D>, f64)>,
    /// The rate of displacement at the end of the last step, in `atanh u` per time: what second-order steps continue.
    pub rate: Option<Stored<D>>,
    /// The last motions on the coarser grids on which steps [begin](WillmoreFlow::begin_on), the finest first.
    pub half_motions: Vec<Field<D>>,
    /// Steps done.
    pub step: usize,
    /// Time reached.
    pub time: f64,
}

/// Willmore flow of a phase field by minimizing movements, with a step of mean curvature flow inside, which can be made alone, too.
pub struct WillmoreFlow<const D: usize> {
    grid: Grid<D>,
    params: FlowParams,
    device: ComputeDevice,
    /// The bricks that are stored, if not the whole grid.
    active: Option<Active<D>>,
    mcf: Arc<dyn MeanCurvatureStep<D>>,
    /// The energy, and the same with weights of the motion, each traced when it is first minimized.
    energies: [Option<MinimizingMovement<D>>; 2],
    /// What it has besides bending.
    terms: Option<HelfrichTerms<D>>,
    /// The inverses in the pure phases, and the one that is used.
    phases: Option<PhaseInverses<D>>,
    phase: Option<(f64, PhaseInverse<D>)>,
    region: Option<Region<D>>,
    constraints: Constraints,
    /// Where steps begin, if on the half grid, and what that moved last.
    half: Option<Box<WillmoreFlow<D>>>,
    half_motion: Option<Field<D>>,
    current: Tensor<D>,
    /// The phase field one step ago and the size of that step.
    previous: Option<(Tensor<D>, f64)>,
    /// The rate of displacement at the end of the last step, if that was of second order.
    rate: Option<Stored<D>>,
    step: usize,
    time: f64,
}

impl<const D: usize> WillmoreFlow<D> {
    /// A flow with a learned operator, whose ratios must be those of the grid.
    ///
    /// # Errors
    /// [`Error::Model`] if the network does not fit the grid, [`Error::NonFinite`] if the initial field is not finite.
    pub fn with_network(
        network: &Network,
        initial: &Field<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let grid = initial.grid();
        network.check_fits(params.ratios(grid, network.ratios().width))?;
        let operator = MeanCurvatureOperator::new(network, device)?;
        operator.check_grid(grid.cells())?;
        Self::new(operator, initial, params, device)
    }

    /// A flow whose curvature comes from any step of mean curvature flow of size `params.mcf_step`.
    ///
    /// # Errors
    /// [`Error::Geometry`] for parameters, [`Error::NonFinite`].
    pub fn new(
        step: impl MeanCurvatureStep<D> + 'static,
        initial: &Field<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        params.validate()?;
        initial
            .check_finite()
            .map_err(|_| Error::non_finite(0, "phase field"))?;
        let grid = initial.grid();
        let current = device.tensor(initial.values(), grid.shape());
        let step = Arc::new(step);
        Ok(Self::begun(step, None, (grid, current), params, device))
    }

    /// A flow with a learned operator on active bricks, which follow the interface: bricks that are further from it than 8 `eps` are not stored,
    /// and the phase field is constant there. That changes a flow by about a millionth of its motion; work and memory are in proportion to
    /// the length or area of the interface.
    ///
    /// # Errors
    /// As [`Self::with_network`]; [`Error::Model`] for a network whose kernel is not separable, [`Error::Geometry`] if the grid cannot be divided
    /// into bricks, and [`Error::NoInterface`].
    pub fn on_bricks(
        network: &Network,
        initial: &impl PhaseField<D>,
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        params.validate()?;
        let nodes = initial.nodes();
        initial
            .check_finite()
            .map_err(|_| Error::non_finite(0, "phase field"))?;
        let grid = nodes.grid();
        network.check_fits(params.ratios(grid, network.ratios().width))?;
        let operator = SeparableOperator::new(network, device)?;
        let active = Active::new(operator, initial, params.eps)?;
        let bricks = &active.bricks;
        let current = device.tensor(&initial.values_on(bricks), bricks.shape());
        let step = Arc::new(active.step(device));
        let (active, start) = (Some(active), (grid, current));
        Ok(Self::begun(step, active, start, params, device))
    }

    fn begun(
        mcf: Arc<dyn MeanCurvatureStep<D>>,
        active: Option<Active<D>>,
        (grid, current): (&Grid<D>, Tensor<D>),
        params: FlowParams,
        device: &ComputeDevice,
    ) -> Self {
        Self {
            grid: *grid,
            params,
            device: device.clone(),
            active,
            mcf,
            energies: [None, None],
            terms: None,
            phases: None,
            phase: None,
            region: None,
            constraints: Constraints::default(),
            half: None,
            half_motion: None,
            current,
            previous: None,
            rate: None,
            step: 0,
            time: 0.0,
        }
    }

    /// Lets only the values at these nodes move from now on; the others stay, bit for bit where they are stored.
    /// The energy is that of the whole field.
    ///
    /// # Errors
    /// [`Error::Region`] for nodes of another grid, or none.
    pub fn restrict_to(&mut self, nodes: &NodeSet) -> Result<(), Error> {
        let bricks = self.active.as_ref().map(|active| &*active.bricks);
        let region = Region::new(&self.grid, Arc::new(nodes.clone()), bricks, &self.device)?;
        self.restrict_half(nodes)?;
        self.region = Some(region);
        Ok(())
    }

    /// Holds perimeter and volume at these values in all following steps, from the next one on exactly: to a relative `1e-12` in double
    /// precision. A target that is not the present value is reached in the next step, so change it slowly. Nothing is held by default.
    pub fn constrain(&mut self, constraints: Constraints) -> Result<(), Error> {
        constraints.check(&self.grid)?;
        self.constraints = constraints;
        Ok(())
    }

    /// Makes this the energy of all following steps, by a step of mean curvature flow whose motion is `response` times that of the calibration
    /// (1 for an exact one; [`mean_curvature::Calibration::response`]). The Willmore energies of the records are then this energy.
    ///
    /// # Errors
    /// [`Error::Geometry`] for values that are not finite.
    pub fn set_energy(&mut self, energy: Helfrich, response: f64) -> Result<(), Error> {
        self.terms = if energy.is_willmore() {
            None
        } else {
            let (grid, device) = (&self.grid, &self.device);
            let terms = HelfrichTerms::new(energy, response, &self.params, grid, device)?;
            Some(match &self.active {
                Some(active) => terms.on(active, device),
                None => terms,
            })
        };
        self.energies = [None, None];
        match &mut self.half {
            Some(half) => half.set_energy(energy, response),
            None => Ok(()),
        }
    }

    fn traced(&self, weighted: bool) -> Result<MinimizingMovement<D>, Error> {
        MinimizingMovement::with_terms(
            self.mcf.clone(),
            self.current.dims(),
            self.params.newton.precision,
            (weighted, self.terms.as_ref()),
            &self.device,
        )
    }

    /// How many cells of the phase field are stored: those of the grid, or of the active bricks.
    pub fn stored_cells(&self) -> usize {
        self.current.shape().num_elements()
    }

    /// The phase field now, on the device: on the whole grid, or on its active [bricks](geometry::Bricks).
    pub fn current(&self) -> &Tensor<D> {
        &self.current
    }

    /// The phase field now.
    pub fn field(&self) -> Result<Field<D>, Error> {
        Ok(self.stored_field()?.field()?)
    }

    /// The phase field now, as it is stored.
    ///
    /// # Errors
    /// [`Error::NonFinite`] naming the step, [`Error::Operators`] if the device fails.
    pub fn stored_field(&self) -> Result<Stored<D>, Error> {
        let now = self.stored(&self.current)?;
        now.check_finite()
            .map_err(|_| Error::non_finite(self.step, "phase field"))?;
        Ok(now)
    }

    /// Everything the following steps depend on: a flow [restored](Self::restore) from it continues with the same bytes.
    pub fn state(&self) -> Result<FlowState<D>, Error> {
        let previous = match &self.previous {
            Some((u, tau)) => Some((self.stored(u)?, *tau)),
            None => None,
        };
        Ok(FlowState {
            current: self.stored(&self.current)?,
            previous,
            rate: self.rate.clone(),
            half_motions: self.half_motions(),
            step: self.step,
            time: self.time,
        })
    }

    /// Goes to a state of a flow with the same grid and parameters.
    ///
    /// # Errors
    /// [`Error::Geometry`] for fields on another grid or on bricks of another size, [`Error::NonFinite`] for values that are not finite.
    pub fn restore(&mut self, state: &FlowState<D>) -> Result<(), Error> {
        let previous = state.previous.as_ref();
        let fields = [
            Some(&state.current),
            previous.map(|(u, _)| u),
            state.rate.as_ref(),
        ];
        for field in fields.into_iter().flatten() {
            self.grid.same_as(field.grid())?;
            let (expected, actual) = (field.nodes().len(), field.values().len());
            if expected != actual {
                return Err(geometry::Error::ValueCount { expected, actual }.into());
            }
            field
                .check_finite()
                .map_err(|_| Error::non_finite(state.step, "phase field"))?;
            if let (Some(active), Some(bricks)) = (&self.active, field.nodes().bricks()) {
                let [cells, side] = [bricks.cells(), bricks.side()];
                if [cells, side] != [self.grid.cells(), active.bricks.side()] {
                    return Err(geometry::Error::Bricks { cells, side }.into());
                }
            }
        }
        self.set_half_motions(&state.half_motions)?;
        if let Some(active) = &self.active {
            let next = match state.current.nodes().bricks() {
                Some(bricks) => active.at(bricks.clone()),
                None => active.following_field(&state.current)?,
            };
            self.go_to(next)?;
        }
        let nodes = self.nodes();
        let on_device = |u: &Stored<D>| tensor(&u.on(&nodes), &self.device);
        self.current = on_device(&state.current);
        self.previous = previous.map(|(u, tau)| (on_device(u), *tau));
        self.rate = state.rate.as_ref().map(|rate| rate.on(&nodes));
        self.step = state.step;
        self.time = state.time;
        Ok(())
    }

    /// Time reached.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Steps done.
    pub fn steps(&self) -> usize {
        self.step
    }

    /// Whether the interface moved by less than half its width, `4 eps/3` in root mean square, since `previous`. After longer
    /// moves an extrapolation can end in the valley of another minimizer, even close a hole.
    fn moved_little(&self, previous: &Tensor<D>) -> Result<bool, Error> {
        const FAR: f64 = 0.5;
        let square = |x: &Tensor<D>| self.device.scalar(inner_product(x, x));
        // A displacement d is the motion (1 - u^2) 3 d / (4 eps).
        let motion = square(&(self.current.clone() - previous.clone()))?;
        let profile = square(&((self.current.clone() * self.current.clone()).neg() + 1.0))?;
        Ok(motion < FAR * FAR * profile)
    }

    /// One step of size `tau`.
    ///
    /// # Errors
    /// [`Error::NonFinite`] naming the field, [`Error::NotConverged`]; the flow stays where it was. In the first step, what tracing the energy
    /// raises.
    pub fn advance(&mut self, tau: f64) -> Result<StepRecord, Error> {
        let half_motions = self.half_motions();
        let made = self.make_step(tau);
        if made.is_err() {
            self.set_half_motions(&half_motions)?;
        }
        made
    }

    /// One step `u <- v[u]` of the mean curvature flow inside, of its own size. A value that is not finite is reported by the next
    /// [`Self::stored_field`].
    ///
    /// # Errors
    /// [`Error::Step`] if the step's own solver fails; the flow stays where it was. [`Error::NeedsGrid`] on active bricks.
    pub fn advance_by_mean_curvature(&mut self) -> Result<(), Error> {
        if self.active.is_some() {
            let what = "mean curvature flows";
            return Err(Error::NeedsGrid { what });
        }
        let next = self.mcf.apply(self.current.clone());
        if let Some(failure) = self.mcf.failure() {
            return Err(Error::Step(failure));
        }
        self.current = Region::hold(self.region.as_ref(), next, &self.current);
        // Steps of Willmore flow do not go on from this one.
        self.set_half_motions(&[])?;
        (self.previous, self.rate) = (None, None);
        self.step += 1;
        self.time += self.params.mcf_step;
        Ok(())
    }

    fn make_step(&mut self, tau: f64) -> Result<StepRecord, Error> {
        let clock = Instant::now();
        self.follow()?;
        let (start, origin) = self.start(tau)?;
        let beginning = clock.elapsed().as_secs_f64();
        let anchor = self.current.clone();
        let minimum = self.minimize(&Movement {
            anchor: &anchor,
            factors: None,
            start: &start,
            tau,
            constraints: self.constraints,
        })?;
        let scale = self.energy_scale();
        let energies = [minimum.newton.energy_before, minimum.newton.energy];
        let energies = energies.map(|energy| scale * energy);
        let mut record = self.record(tau, &minimum, energies, origin, clock);
        record.times.start = beginning;
        self.previous = Some((std::mem::replace(&mut self.current, minimum.u), tau));
        self.rate = None;
        self.step += 1;
        self.time += tau;
        Ok(record)
    }

    /// What a step of size `tau` says of itself that ended in a minimum, with the energies of standing still and of the result.
    fn record(
        &self,
        tau: f64,
        minimum: &Minimum<D>,
        [energy_before, energy]: [f64; 2],
        start: Start,
        clock: Instant,
    ) -> StepRecord {
        StepRecord {
            step: self.step + 1,
            time: self.time + tau,
            tau,
            energy_before,
            energy,
            willmore_energy: minimum.willmore_energy,
            start,
            newton: minimum.newton,
            tension: minimum.tension,
            pressure: minimum.pressure,
            estimates: None,
            seconds: clock.elapsed().as_secs_f64(),
            times: minimum.times,
        }
    }

    /// The scaled energy counts points; this makes it the paper's, with true L2 norms: `2 eps h^D`, over the factor of the metric.
    fn energy_scale(&self) -> f64 {
        2.0 * self.params.eps * self.grid.cell_volume() / self.params.calibration.metric
    }

    /// Minimizes the energy of a movement from the present phase field, with respect to which the tolerance is meant, on the values that are
    /// stored now.
    fn minimize_here(&mut self, movement: &Movement<'_, D>) -> Result<Minimum<D>, Error> {
        let Movement {
            anchor,
            factors,
            start,
            tau,
            constraints,
        } = *movement;
        let step = self.step + 1;
        let stiffness = self.params.stiffness(tau);
        self.prepare(stiffness)?;
        let weighted = usize::from(factors.is_some());
        let energy = match self.energies[weighted].take() {
            Some(energy) => energy,
            None => self.traced(factors.is_some())?,
        };
        let preconditioner = self.phase.as_ref().map(|(_, phase)| Preconditioner {
            phase: phase.clone(),
            nodes: self.nodes(),
            eps: self.params.eps,
            step: (tau, stiffness),
            region: self.region.clone(),
            interface: None,
        });
        let (params, device, current) = (self.params.newton, &self.device, &self.current);
        let energy = self.energies[weighted].insert(energy);
        if let Some(factors) = factors {
            energy.set_factors(factors);
        }
        energy.set(anchor, stiffness)?;
        let (stored, eps) = ((self.grid, self.active.as_ref()), self.params.eps);
        let mut held = Held::new(&constraints, stored, eps, self.region.as_ref(), device);
        let (u, newton, times) = minimize_timed(
            energy,
            (self.region.as_ref(), held.as_mut()),
            current,
            start,
            preconditioner,
            params,
            device,
        )
        .map_err(|error| error.at(step))?;
        if newton.exit == Exit::IterationLimit {
            return Err(Error::NotConverged {
                step,
                estimate: newton.estimate,
                tolerance: self.params.newton.tolerance,
            });
        }
        if !self.device.values(u.clone())?.iter().all(|u| u.is_finite()) {
            return Err(Error::non_finite(step, "phase field"));
        }
        let mut motion = u.clone() - anchor.clone();
        if let Some(factors) = factors {
            motion = motion * factors.clone();
        }
        let fidelity = 0.5
            * self
                .device
                .scalar((motion.clone() * self.mcf.mass(motion)).sum())?;
        // The energy of standing still is 2 tau w.
        let unit = self.energy_scale() / (2.0 * tau);
        let multipliers = held.map(|held| held.multipliers.map(|value| unit * value));
        let [tension, pressure] = multipliers.unwrap_or_default();
        Ok(Minimum {
            u,
            tension: constraints.perimeter.map(|_| tension),
            pressure: constraints.volume.map(|_| pressure),
            willmore_energy: self.energy_scale() * (newton.energy - fidelity) / (2.0 * tau),
            newton,
            times,
        })
    }

    /// Fits preconditioner and accuracy to a weight of the curvature.
    fn prepare(&mut self, stiffness: f64) -> Result<(), Error> {
        let prepared = self.phase.as_ref().map(|(c, _)| c.to_bits());
        if prepared == Some(stiffness.to_bits()) {
            return Ok(());
        }
        let phases = match self.phases.take() {
            Some(phases) => phases,
            None => {
                let inverses = self.mcf.phase_inverses(&self.nodes(), &self.device);
                inverses.map_err(Error::Step)?
            }
        };
        self.phase = Some((stiffness, phases(stiffness)));
        self.phases = Some(phases);
        self.mcf.set_accuracy(&Accuracy {
            stiffness,
            tolerance: self.params.newton.tolerance,
            cg_tolerance: self.params.newton.cg_tolerance,
        });
        Ok(())
    }
}

/// One minimization: what it is centred at, the factors of the motion if it is weighted, where it begins, its time step, and what is held.
struct Movement<'a, const D: usize> {
    anchor: &'a Tensor<D>,
    factors: Option<&'a Tensor<D>>,
    start: &'a Tensor<D>,
    tau: f64,
    constraints: Constraints,
}

/// The result of one minimization.
struct Minimum<const D: usize> {
    u: Tensor<D>,
    willmore_energy: f64,
    tension: Option<f64>,
    pressure: Option<f64>,
    newton: NewtonInfo,
    times: PhaseTimes,
}

fn download<const D: usize>(
    grid: &Grid<D>,
    u: &Tensor<D>,
    device: &ComputeDevice,
) -> Result<Field<D>, Error> {
    Ok(Field::from_values(*grid, device.values(u.clone())?)?)
}
