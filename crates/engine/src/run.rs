//! A case that is being computed.

use std::sync::OnceLock;
use std::time::Instant;

use fem::FiniteElementStep;
use geometry::measure::{has_interface, l2_distance};
use geometry::{Field, NodeSet, PhaseField, Stored, require};
use operators::ComputeDevice;
use serde_json::Value;
use solver::{FlowState, StepRecord, widths_between};

use crate::motion::{self, Motion};
use crate::record::Values;
use crate::step_control::StepControl;
use crate::stop::Progress;
use crate::{Case, Current, Error, Flow, Measure, Record, Stop};

/// A case that is being computed: its flow, its place in the time steps, and the records so far.
pub struct Run<const D: usize> {
    pub(crate) case: Case<D>,
    pub(crate) device: ComputeDevice,
    identity: OnceLock<Value>,
    motion: Box<dyn Motion<D>>,
    elements: Option<FiniteElementStep<D>>,
    control: StepControl,
    /// What is stored of the phase field after the last step; nothing before the first one.
    stored: Option<Stored<D>>,
    /// The same on the whole grid, once it was asked for.
    whole: OnceLock<Field<D>>,
    pub(crate) start: Values,
    pub(crate) records: Vec<Record>,
    /// Whether a step failed after the flow had moved, so that it is not where the last record says.
    pub(crate) torn: bool,
    ended: Option<Stop>,
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
        Self::at(case, device, start, Vec::new(), None)
    }

    /// A case at the state that it had after these records, or at its start.
    pub(crate) fn at(
        case: Case<D>,
        device: &ComputeDevice,
        start: Values,
        records: Vec<Record>,
        state: Option<&FlowState<D>>,
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
        let mut control = StepControl::new(&case)?;
        for record in &records {
            control.accept(record)?;
        }
        let (motion, elements) = motion::of(&case, state, device)?;
        // Before the first step all of the initial values count, also where they are not stored.
        let begun = !records.is_empty();
        let stored = begun.then(|| motion.stored()).transpose()?;
        let mut run = Self {
            motion,
            elements,
            device: device.clone(),
            identity: OnceLock::new(),
            stored,
            whole: OnceLock::new(),
            case,
            control,
            start,
            records,
            torn: false,
            ended: None,
        };
        run.ended = run.stop();
        Ok(run)
    }

    /// Makes one step: a minimization of the next size, halved if it fails and the rule allows that. None once a stop rule holds.
    ///
    /// # Errors
    /// [`Error::Step`], [`Error::TooStiff`]: the run stays where it was. After errors of measures, or if what a step has made is not finite, it
    /// goes on from its last checkpoint only, and further steps are [`Error::Torn`].
    pub fn step(&mut self) -> Result<Option<&Record>, Error> {
        if self.ended.is_some() {
            return Ok(None);
        }
        if self.torn {
            let case = self.case.title();
            return Err(Error::Torn { case });
        }
        let clock = Instant::now();
        self.whole.take();
        let mut record = self.attempt()?;
        let now = self.motion.stored().map_err(|source| self.failed(source))?;
        record.moved = self.distance(&now, self.stored());
        record.travelled = self.distance(&now, &self.case.initial);
        self.stored = Some(now);
        record.seconds = clock.elapsed().as_secs_f64();
        record.measures = Measure::values(&self.case.measures, &self.current(), record.time)?;
        record.completes_step = self.control.accept(&record)?;
        self.records.push(record);
        self.torn = false;
        self.ended = self.stop();
        Ok(self.records.last())
    }

    /// A step that succeeds and is short enough. Its record lacks what the phase field says: measures, distances and whether a step is complete.
    fn attempt(&mut self) -> Result<Record, Error> {
        let (mut size, mut halvings) = self.first_size();
        let halvings_of_motion = self.control.halvings_of_motion();
        let mut most = self.control.halvings();
        if !self.case.held.is_empty() {
            most = most.max(halvings_of_motion);
        }
        // Where it is before the step, for trying that again.
        let before = match self.case.steps.longest_move {
            Some(longest) => Some((longest, self.state()?)),
            None => None,
        };
        let mut refused_hvp = 0.0;
        loop {
            let mut shorter = None;
            let accept = &mut |made: &StepRecord| {
                shorter = self.control.shorter(made).filter(|_| halvings < most);
                shorter.is_none()
            };
            // A shorter step changes what is held by less, too.
            let gone = self.control.steps_gone + size / self.control.step_size();
            let (order, constraints) = (self.case.steps.order, self.case.held.at(gone));
            let refused = match self.motion.advance(size, order, constraints, accept) {
                Ok((minimization, true)) => {
                    self.torn = true;
                    // How far it has gone over how far it may go.
                    let part = match &before {
                        Some((longest, before)) => self.has_gone(&before.current)? / longest,
                        None => 0.0,
                    };
                    let too_far = part > 1.0 && halvings < halvings_of_motion;
                    let Some((_, before)) = before.as_ref().filter(|_| too_far) else {
                        return Ok(Record {
                            halvings,
                            far: part > FAR,
                            refused_hvp,
                            ..self.record(minimization)
                        });
                    };
                    let restored = self.motion.restore(before);
                    restored.map_err(|source| self.failed(source))?;
                    self.torn = false;
                    minimization
                }
                Ok((minimization, false)) => minimization,
                Err(source) if most == 0 || !source.shorter_step_may_succeed() => {
                    return Err(self.failed(source));
                }
                Err(_) if halvings < most => None,
                Err(source) => {
                    return Err(Error::TooStiff {
                        case: self.case.title(),
                        step: self.control.step(),
                        tau: size,
                        halvings,
                        source: Box::new(source),
                    });
                }
            };
            refused_hvp += refused.map_or(0.0, |made| made.hvp());
            size = shorter.unwrap_or(0.5 * size);
            halvings += 1;
        }
    }

    /// The size with which a step is tried first, and how often it is halved: what was too long for the last step is not tried again at once.
    fn first_size(&self) -> (f64, u32) {
        let (mut size, mut halvings) = (self.control.next_size(), 0);
        let is_limited = self.case.steps.longest_move.is_some();
        let last = self
            .records
            .last()
            .filter(|last| is_limited && last.halvings > 0);
        if let Some(last) = last {
            let longer = if last.far { 1.5 } else { 2.0 };
            while size > longer * last.tau && halvings < self.control.halvings_of_motion() {
                size *= 0.5;
                halvings += 1;
            }
        }
        (size, halvings)
    }

    /// The place in the time steps of a minimization that was just made, or of a step of mean curvature flow.
    fn record(&self, minimization: Option<StepRecord>) -> Record {
        let (mcf_step, count) = (self.case.scales.mcf_step, self.records.len() + 1);
        Record {
            step: self.control.step(),
            time: minimization.map_or(count as f64 * mcf_step, |made| made.time),
            tau: minimization.map_or(mcf_step, |made| made.tau),
            minimization,
            ..Record::default()
        }
    }

    /// How many of its widths the interface has moved in the step that was just made, also to where there was none ([`widths_between`]); infinitely
    /// many if it is away altogether.
    fn has_gone(&self, before: &Stored<D>) -> Result<f64, Error> {
        let now = self.motion.stored().map_err(|source| self.failed(source))?;
        if !has_interface(&now) {
            return Ok(f64::INFINITY);
        }
        Ok(widths_between(before, &now).max(widths_between(&now, before)))
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
            step_size: self.control.last_size,
            is_willmore: case.energy.is_willmore(),
        };
        let driven = !case.held.is_reached(self.control.steps_gone);
        let mut stops = (case.stops.iter()).filter(|stop| !(driven && stop.is_rest()));
        stops.find(|stop| stop.holds(&progress)).copied()
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
        self.ended
    }

    /// Number of completed time steps.
    pub fn steps(&self) -> usize {
        self.control.step() - 1
    }

    /// The present time.
    pub fn time(&self) -> f64 {
        self.records.last().map_or(0.0, |last| last.time)
    }

    /// How many cells of the phase field are stored now: all of the grid, or those of the bricks near the surface.
    pub fn stored_cells(&self) -> usize {
        self.motion.stored_cells()
    }

    /// Work of the linear solves inside finite elements so far; none for a learned operator.
    pub fn statistics(&self) -> Option<fem::Statistics> {
        self.elements.as_ref().map(FiniteElementStep::statistics)
    }

    pub(crate) fn state(&self) -> Result<FlowState<D>, Error> {
        Ok(self.motion.state()?)
    }
}

/// A step that moves the interface this part of what it may is not followed by one of twice its size, which would be refused.
const FAR: f64 = 0.6;
