//! A case that is being computed.

use std::sync::OnceLock;
use std::time::Instant;

use fem::FiniteElementStep;
use geometry::measure::l2_distance;
use geometry::{Field, NodeSet, PhaseField, Stored, require};
use operators::ComputeDevice;
use serde_json::Value;
use solver::{Cancel, Candidate, Domain, Problem, Scheme, State, StepSize, TermCheck};

use crate::parts::{self, Parts};
use crate::record::Values;
use crate::step_control::StepControl;
use crate::stop::Progress;
use crate::{
    Attempts, Case, Controller, Current, Error, Flow, Measure, Record, Stop, StopRule, Verdict,
};

/// A case that is being computed: its problem, its state, what makes its steps and takes them, and the records so far.
pub struct Run<const D: usize> {
    pub(crate) case: Case<D>,
    pub(crate) device: ComputeDevice,
    identity: OnceLock<Value>,
    problem: Problem<D>,
    scheme: Box<dyn Scheme<D>>,
    controller: Box<dyn Controller<D>>,
    pub(crate) state: State<D>,
    elements: Option<FiniteElementStep<D>>,
    /// The phase field of the state on the host; nothing before the first step.
    stored: Option<Stored<D>>,
    /// The same on the whole grid, once it was asked for.
    whole: OnceLock<Field<D>>,
    pub(crate) start: Values,
    pub(crate) records: Vec<Record>,
    ended: Option<Stop>,
}

/// The controller of a case as these records leave it.
fn controller_after<const D: usize>(
    case: &Case<D>,
    records: &[Record],
) -> Result<Box<dyn Controller<D>>, Error> {
    let mut controller: Box<dyn Controller<D>> = match &case.own.controller {
        Some(make) => make(case)?,
        None => Box::new(StepControl::new(case)?),
    };
    for record in records {
        controller.accept(record)?;
    }
    Ok(controller)
}

impl<const D: usize> Run<D> {
    /// Starts a case.
    ///
    /// # Errors
    /// If something in the case is not possible: [`Error::Solver`], [`Error::Fem`], [`Error::Geometry`].
    pub fn new(case: Case<D>, device: &ComputeDevice) -> Result<Self, Error> {
        case.initial.check_finite()?;
        let whole = OnceLock::new();
        let initial = case.current(&case.initial, &whole);
        let start = Measure::values(&case.measures, &initial, 0.0)?;
        Self::at(case, device, start, Vec::new())
    }

    /// A case at its start, with the records of what was made of it: the [state](Self::go_to) that belongs to them is restored afterwards.
    pub(crate) fn at(
        case: Case<D>,
        device: &ComputeDevice,
        start: Values,
        records: Vec<Record>,
    ) -> Result<Self, Error> {
        let (mcf_step, first) = (case.scales.mcf_step, case.steps.rule.size(1));
        if case.flow == Flow::MeanCurvature {
            let expected = "the inner step, for mean curvature flow";
            require("tau", first, expected, |tau| {
                tau.to_bits() == mcf_step.to_bits()
            })?;
            let nodes = case.region.as_ref().map_or(0, NodeSet::len) as f64;
            require(
                "nodes of a region",
                nodes,
                "0, for mean curvature flow",
                |n| n < 1.0,
            )?;
        }
        let controller = controller_after(&case, &records)?;
        let Parts {
            problem,
            start: state,
            scheme,
            elements,
        } = parts::of(&case, device)?;
        if controller.needs_estimates() && !scheme.estimates() {
            let scheme = scheme.name().to_owned();
            return Err(Error::NoEstimates { scheme });
        }
        let mut run = Self {
            problem,
            scheme,
            state,
            elements,
            device: device.clone(),
            identity: OnceLock::new(),
            stored: None,
            whole: OnceLock::new(),
            case,
            controller,
            start,
            records,
            ended: None,
        };
        if run.records.is_empty() {
            // Before the first step all of the initial values count, also where they are not stored.
            run.ended = run.stop();
        }
        Ok(run)
    }

    /// Goes to the state that belongs to the records.
    pub(crate) fn go_to(&mut self, state: State<D>) -> Result<(), Error> {
        if !self.records.is_empty() {
            self.stored = Some(state.stored()?);
            self.whole.take();
        }
        self.state = state;
        self.ended = self.stop();
        Ok(())
    }

    /// Makes one step: of the next size, or of a smaller one if the controller does not take that. None once a stop rule holds.
    ///
    /// # Errors
    /// [`Error::Step`], [`Error::TooStiff`], [`Error::Cancelled`], and those of measures: the run stays where it was.
    pub fn step(&mut self) -> Result<Option<&Record>, Error> {
        if self.ended.is_some() {
            return Ok(None);
        }
        let clock = Instant::now();
        let (candidate, mut record) = self.candidate()?;
        let now = candidate
            .state
            .stored()
            .map_err(|source| self.failed(source))?;
        record.moved = self.distance(&now, self.stored());
        record.travelled = self.distance(&now, &self.case.initial);
        record.seconds = clock.elapsed().as_secs_f64();
        let whole = OnceLock::new();
        let seen = self.case.current(&now, &whole);
        record.measures = Measure::values(&self.case.measures, &seen, record.time)?;
        record.completes_step = self.controller.accept(&record)?;
        self.state = candidate.state;
        (self.stored, self.whole) = (Some(now), whole);
        self.records.push(record);
        self.ended = self.stop();
        Ok(self.records.last())
    }

    /// Ends the step that is being made, with [`Error::Cancelled`], as soon as it is not wanted any more.
    pub fn set_cancel(&mut self, cancel: Cancel) {
        self.problem.set_cancel(cancel);
    }

    /// Makes so many time steps, or fewer if a stop rule ends them: an iterator over their records, of which those of a step that is made in
    /// parts are several. Steps are made as it goes on.
    pub fn take(&mut self, steps: usize) -> impl Iterator<Item = Result<Record, Error>> {
        let last = self.steps() + steps;
        std::iter::from_fn(move || {
            if self.steps() >= last {
                return None;
            }
            self.step().map(Option::<&Record>::cloned).transpose()
        })
    }

    /// A step that the controller takes, and its record without what the phase field says.
    fn candidate(&mut self) -> Result<(Candidate<D>, Record), Error> {
        loop {
            let size = self.controller.next();
            let made = self.scheme.step(&self.problem, &self.state, size);
            if matches!(made, Err(solver::Error::Cancelled)) {
                // It may have seen attempts that are made again later.
                self.controller = controller_after(&self.case, &self.records)?;
                let case = self.case.title();
                return Err(Error::Cancelled { case });
            }
            let verdict = self.controller.judge(&self.state, made.as_ref());
            match (verdict.map_err(|source| self.failed(source))?, made) {
                (Verdict::Accept(attempts), Ok(candidate)) => {
                    let record = self.record(&candidate, size, attempts);
                    return Ok((candidate, record));
                }
                (Verdict::GiveUp { halvings }, Err(source)) if halvings > 0 => {
                    return Err(Error::TooStiff {
                        case: self.case.title(),
                        step: self.steps() + 1,
                        tau: size.tau,
                        halvings,
                        source: Box::new(source),
                    });
                }
                (Verdict::Accept(_) | Verdict::GiveUp { .. }, Err(source)) => {
                    return Err(self.failed(source));
                }
                (Verdict::GiveUp { .. }, Ok(_)) => {
                    let (case, step) = (self.case.title(), self.steps() + 1);
                    let tau = size.tau;
                    return Err(Error::Refused { case, step, tau });
                }
                (Verdict::Retry, _) => {}
            }
        }
    }

    /// The place in the time steps of a step that was just made.
    fn record(&self, candidate: &Candidate<D>, size: StepSize, attempts: Attempts) -> Record {
        let Attempts {
            halvings,
            far,
            refused_hvp,
        } = attempts;
        let (record, time) = (candidate.record, candidate.state.time);
        Record {
            step: self.steps() + 1,
            time,
            tau: candidate.tau,
            step_size: size.whole,
            halvings,
            far,
            refused_hvp,
            minimization: record,
            ..Record::default()
        }
    }

    fn failed(&self, source: solver::Error) -> Error {
        Error::Step {
            case: self.case.title(),
            source: Box::new(source),
        }
    }

    /// The first stop rule that holds.
    fn stop(&self) -> Option<Stop> {
        let case = &self.case;
        let progress = Progress {
            records: &self.records,
            initial: &case.initial,
            current: self.current(),
            steps: self.steps(),
            is_willmore: case.energy.is_willmore() && case.own.terms.is_empty(),
        };
        let driven = !self.sizes_are_reached();
        let holds = |rule: &dyn StopRule<D>| !(driven && rule.is_rest()) && rule.holds(&progress);
        if let Some(stop) = case.stops.iter().find(|stop| holds(*stop)) {
            return Some(stop.clone());
        }
        let own = case.own.stops.iter().find(|rule| holds(&***rule))?;
        Some(Stop::Own(own.name()))
    }

    /// Whether the sizes that are held have reached their targets.
    pub fn sizes_are_reached(&self) -> bool {
        self.case.held.is_reached(self.state.progress)
    }

    /// The identity of the case, which takes all of its initial values.
    pub(crate) fn identity(&self) -> &Value {
        (self.identity).get_or_init(|| self.case.identity(&self.device))
    }

    /// The case that is run.
    pub fn case(&self) -> &Case<D> {
        &self.case
    }

    /// The phase field at the present time, on the whole grid.
    pub fn field(&self) -> &Field<D> {
        self.current().field()
    }

    /// The phase field at the present time, as it is stored.
    pub fn current(&self) -> Current<'_, D> {
        self.case.current(self.stored(), &self.whole)
    }

    /// The same without what a region keeps where nothing is stored.
    pub fn stored(&self) -> &Stored<D> {
        self.stored.as_ref().unwrap_or(&self.case.initial)
    }

    /// The `L2` distance of two phase fields of this run.
    fn distance(&self, a: &Stored<D>, b: &Stored<D>) -> f64 {
        let whole = OnceLock::new();
        let [a, b] = [a, b].map(|stored| self.case.current(stored, &whole));
        l2_distance(&a, &b).expect("both are on the grid of the case")
    }

    /// The measures of the initial phase field.
    pub fn start(&self) -> &Values {
        &self.start
    }

    /// All records so far.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The stop rule that ended the run, if it is over.
    pub fn ended(&self) -> Option<Stop> {
        self.ended.clone()
    }

    /// Number of completed time steps.
    pub fn steps(&self) -> usize {
        let last = self.records.last();
        last.map_or(0, |last| last.step - usize::from(!last.completes_step))
    }

    /// The present time.
    pub fn time(&self) -> f64 {
        self.records.last().map_or(0.0, |last| last.time)
    }

    /// The stored nodes now, as the terms of the energy see them.
    pub fn domain(&self) -> Domain<D> {
        self.problem.domain(self.state.field.nodes())
    }

    /// The terms of the energy at the present phase field: their energies, and Taylor tests of their derivatives.
    ///
    /// # Errors
    /// [`Error::Solver`]: what the terms raise.
    pub fn check_terms(&self) -> Result<Vec<TermCheck>, Error> {
        Ok(self.problem.check_derivatives(&self.state.field)?)
    }

    /// How many cells of the phase field are stored now: all of the grid, or those of the bricks near the surface.
    pub fn stored_cells(&self) -> usize {
        self.state.field.nodes().len()
    }

    /// Work of the linear solves inside finite elements so far; none for a learned operator.
    pub fn statistics(&self) -> Option<fem::Statistics> {
        self.elements.as_ref().map(FiniteElementStep::statistics)
    }
}
