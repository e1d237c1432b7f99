//! A flow with the defaults that are good for most.

use std::path::Path;
use std::sync::Arc;

use engine::{
    Case, Checkpoints, Controller, ErrorControl, Formulation, Measure, Observer, Operator, Own,
    Run, Scales, Stop, StopRule, Storage, Store, TimeSteps,
};
use geometry::{Grid, NodeSet, SignedDistance, Stored, ZeroSet, stored_phase_field};
use mean_curvature::{MeanCurvatureStep, StepScales};
use model::{NamedNetwork, Network, Networks};
use operators::ComputeDevice;
use runs::{Interrupt, RunDirectory};
use solver::{EnergyTerm, Held, NewtonParams, Scheme, Target};

/// What a flow cannot begin with, or what stopped it.
pub type Error = engine::Error;

/// The steps that a flow may make unless a stop rule ends it.
const STEPS: usize = 1_000_000;
/// Cells of the interface width `eps`.
const EPS_OVER_H: f64 = 2.0;

/// A flow that is put together: on a grid, by methods that change its defaults, to be [started](Self::start) from a shape.
///
/// The defaults: `eps = 2 h`, `tautilde = eps^2 / 4`; the shipped learned operator of the accurate recipe, calibrated; bricks near the interface where they are
/// less than half of the grid; steps of second order whose sizes their errors control; nothing held; perimeter and volume measured.
#[derive(Clone)]
pub struct Willmore<const D: usize> {
    grid: Grid<D>,
    eps_over_h: f64,
    formulation: Formulation,
    network: Option<Network>,
    step: Option<Arc<dyn MeanCurvatureStep<D>>>,
    mcf_step: Option<f64>,
    storage: Storage,
    steps: TimeSteps,
    newton: Option<NewtonParams>,
    keep: Keep,
    held: Option<Held>,
    region: Option<NodeSet>,
    max_distance: Option<f64>,
    stops: Vec<Stop>,
    measures: Vec<Measure<D>>,
    own: Own<D>,
    device: Option<ComputeDevice>,
}

/// The sizes of the start that are held.
#[derive(Clone, Copy, Default)]
struct Keep {
    perimeter: bool,
    volume: bool,
}

impl<const D: usize> Willmore<D> {
    /// A flow on a grid.
    pub fn on(grid: Grid<D>) -> Self {
        Self {
            grid,
            eps_over_h: EPS_OVER_H,
            formulation: Formulation::Accurate,
            network: None,
            step: None,
            mcf_step: None,
            storage: Storage::Auto,
            steps: TimeSteps::controlled(ErrorControl::default()),
            newton: None,
            keep: Keep::default(),
            held: None,
            region: None,
            max_distance: None,
            stops: Vec::new(),
            measures: Vec::new(),
            own: Own::default(),
            device: None,
        }
    }

    /// The interface width `eps` in cells, for which a network has to be shipped.
    #[must_use]
    pub fn eps_over_h(mut self, cells: f64) -> Self {
        self.eps_over_h = cells;
        self
    }

    /// How the energy is weighted, and which of the shipped networks is inside.
    #[must_use]
    pub fn formulation(mut self, formulation: Formulation) -> Self {
        self.formulation = formulation;
        self
    }

    /// A learned operator with this network inside.
    #[must_use]
    pub fn network(mut self, network: Network) -> Self {
        self.network = Some(network);
        self
    }

    /// A step of mean curvature flow of one's own inside, of the size `tautilde` that [`Self::scales`] says. Its calibration is
    /// [measured](MeanCurvatureStep::calibrate) when the flow starts, unless the [formulation](Self::formulation) is the paper's, which has none.
    #[must_use]
    pub fn operator(mut self, step: impl MeanCurvatureStep<D> + 'static) -> Self {
        self.step = Some(Arc::new(step));
        self
    }

    /// The size `tautilde` of the step of mean curvature flow inside.
    #[must_use]
    pub fn mcf_step(mut self, tautilde: f64) -> Self {
        self.mcf_step = Some(tautilde);
        self
    }

    /// Adds a term to the energy.
    #[must_use]
    pub fn with(mut self, term: impl EnergyTerm<D> + 'static) -> Self {
        self.own = self.own.with_term(term);
        self
    }

    /// The scheme that makes steps, in place of that of second order.
    #[must_use]
    pub fn scheme<S: Scheme<D> + 'static>(
        mut self,
        make: impl Fn() -> S + Send + Sync + 'static,
    ) -> Self {
        self.own = self.own.with_scheme(make);
        self
    }

    /// What chooses the size of steps, in place of the control of their errors.
    #[must_use]
    pub fn controller<C: Controller<D> + 'static>(
        mut self,
        make: impl Fn(&Case<D>) -> Result<C, Error> + Send + Sync + 'static,
    ) -> Self {
        self.own = self.own.with_controller(make);
        self
    }

    /// The sizes of the time steps and their order.
    #[must_use]
    pub fn steps(mut self, steps: impl Into<TimeSteps>) -> Self {
        self.steps = steps.into();
        self
    }

    /// Settings of the minimizations.
    #[must_use]
    pub fn newton(mut self, newton: NewtonParams) -> Self {
        self.newton = Some(newton);
        self
    }

    /// Holds the area (2D) or volume (3D) of the inside.
    #[must_use]
    pub fn keep_volume(mut self) -> Self {
        self.keep.volume = true;
        self
    }

    /// Holds the length (2D) or area (3D) of the zero set.
    #[must_use]
    pub fn keep_perimeter(mut self) -> Self {
        self.keep.perimeter = true;
        self
    }

    /// Holds these sizes, or drives them to targets.
    #[must_use]
    pub fn hold(mut self, held: Held) -> Self {
        self.held = Some(held);
        self
    }

    /// Lets only the values at these nodes move.
    #[must_use]
    pub fn region(mut self, nodes: NodeSet) -> Self {
        self.region = Some(nodes);
        self
    }

    /// Keeps the interface within this distance of that of the start.
    #[must_use]
    pub fn max_distance(mut self, length: f64) -> Self {
        self.max_distance = Some(length);
        self
    }

    /// What of the phase field is stored.
    #[must_use]
    pub fn storage(mut self, storage: Storage) -> Self {
        self.storage = storage;
        self
    }

    /// Adds a stop rule.
    #[must_use]
    pub fn until(mut self, stop: Stop) -> Self {
        self.stops.push(stop);
        self
    }

    /// Adds a stop rule of one's own.
    #[must_use]
    pub fn until_rule(mut self, rule: impl StopRule<D> + 'static) -> Self {
        self.own = self.own.with_stop(rule);
        self
    }

    /// Adds a measure, evaluated after every step.
    #[must_use]
    pub fn measure(mut self, measure: Measure<D>) -> Self {
        self.measures.push(measure);
        self
    }

    /// The device, in place of the one that is compiled in by default.
    #[must_use]
    pub fn device(mut self, device: &ComputeDevice) -> Self {
        self.device = Some(device.clone());
        self
    }

    /// The lengths that a step of mean curvature flow inside has to fit: interface width and inner step.
    pub fn scales(&self) -> Scales {
        let mut scales = Scales::of_grid(self.grid.spacing(), self.eps_over_h);
        scales.mcf_step = self.mcf_step.unwrap_or(scales.mcf_step);
        if let Some(newton) = self.newton {
            scales.newton = newton;
        } else if self.steps.order != engine::Order::First {
            scales.newton = NewtonParams::second_order();
        }
        scales
    }

    /// The case of the flow from a shape, for what takes cases.
    ///
    /// # Errors
    /// [`engine::Error::Model`] if no network fits, [`engine::Error::Geometry`], and those of measuring a calibration.
    pub fn case(&self, shape: &impl SignedDistance<D>) -> Result<Case<D>, Error> {
        self.case_from(stored_phase_field(self.grid, shape, self.scales().eps)?)
    }

    /// The case of the flow from a phase field on the grid.
    ///
    /// # Errors
    /// As [`Self::case`].
    pub fn case_from(&self, initial: impl Into<Stored<D>>) -> Result<Case<D>, Error> {
        let (scales, initial) = (self.scales(), initial.into());
        self.grid.same_as(initial.grid())?;
        let mut operator = self.operator_inside(&scales)?;
        operator.storage = self.storage;
        let mut stops = self.stops.clone();
        stops.push(Stop::Steps(STEPS));
        let held = match self.held {
            Some(held) => held,
            None => self.kept(&initial, scales.eps)?,
        };
        let mut case = Case::willmore("shape", initial, operator, scales, self.steps, STEPS);
        case.measures.extend(self.measures.iter().cloned());
        Ok(Case {
            held,
            region: self.region.clone(),
            max_distance: self.max_distance,
            stops,
            own: self.own.clone(),
            ..case
        })
    }

    fn operator_inside(&self, scales: &Scales) -> Result<Operator<D>, Error> {
        if let Some(step) = &self.step {
            if self.formulation == Formulation::Paper {
                return Ok(Operator::shared(step.clone(), None));
            }
            let scales = StepScales::on(&self.grid, scales.eps, scales.mcf_step);
            let calibration = step.calibrate(&scales, &self.chosen_device()?);
            let calibration = calibration.map_err(solver::Error::Operator)?;
            return Ok(Operator::shared(step.clone(), Some(&calibration)));
        }
        let needed = scales.needs(D, self.grid.spacing());
        let named = match &self.network {
            Some(network) => NamedNetwork {
                name: "own".to_owned(),
                network: network.clone(),
            },
            None => Networks::default().find(self.formulation.shipped(), &needed)?,
        };
        Operator::learned(self.formulation, named)
    }

    /// The sizes of the start that are kept.
    fn kept(&self, initial: &Stored<D>, eps: f64) -> Result<Held, Error> {
        let Keep { perimeter, volume } = self.keep;
        if !perimeter && !volume {
            return Ok(Held::default());
        }
        let sizes = ZeroSet::of(initial, eps)?;
        Ok(Held {
            perimeter: perimeter.then(|| Target::keep(sizes.perimeter)),
            volume: volume.then(|| Target::keep(sizes.volume)),
        })
    }

    fn chosen_device(&self) -> Result<ComputeDevice, Error> {
        match &self.device {
            Some(device) => Ok(device.clone()),
            None => Ok(ComputeDevice::default_compiled().map_err(solver::Error::from)?),
        }
    }

    /// Starts the flow from a shape.
    ///
    /// # Errors
    /// As [`Self::case`] and [`Run::new`].
    pub fn start(&self, shape: &impl SignedDistance<D>) -> Result<Run<D>, Error> {
        Run::new(self.case(shape)?, &self.chosen_device()?)
    }

    /// Starts the flow from a phase field on the grid.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_from(&self, initial: impl Into<Stored<D>>) -> Result<Run<D>, Error> {
        Run::new(self.case_from(initial)?, &self.chosen_device()?)
    }

    /// Starts the flow from a shape in a folder, with a checkpoint after every step, or goes on with the flow that is stored there, to the same bytes.
    ///
    /// # Errors
    /// As [`Self::start`]; [`engine::Error::Stored`] for a folder with another flow, [`engine::Error::Runs`].
    pub fn start_in(
        &self,
        folder: impl AsRef<Path>,
        shape: &impl SignedDistance<D>,
    ) -> Result<Kept<D>, Error> {
        let (folder, checkpoints) = (folder.as_ref(), Checkpoints::EverySteps(1));
        let (case, device) = (self.case(shape)?, self.chosen_device()?);
        let (store, run) = match RunDirectory::open(folder) {
            Ok(stored) => Store::resume(stored, case, &device, checkpoints)?,
            Err(runs::Error::NoRun(_)) => {
                let run = Run::new(case, &device)?;
                let notes = serde_json::Value::Null;
                (Store::create(folder, &[], &run, notes, checkpoints)?, run)
            }
            Err(error) => return Err(error.into()),
        };
        Ok(Kept { store, run })
    }
}

/// A flow that is kept in a folder.
pub struct Kept<const D: usize> {
    /// The folder.
    pub store: Store,
    /// The flow.
    pub run: Run<D>,
}

impl<const D: usize> Kept<D> {
    /// Makes steps until a stop rule holds or `interrupt` is set, with a checkpoint after each.
    ///
    /// # Errors
    /// As [`Run::advance`].
    pub fn advance(
        &mut self,
        observers: &mut [&mut dyn Observer<D>],
        interrupt: &Interrupt,
    ) -> Result<Option<Stop>, Error> {
        self.run
            .advance(Some(&mut self.store), observers, interrupt)
    }
}
