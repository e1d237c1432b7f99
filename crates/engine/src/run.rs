//! The loop over time steps.

use std::time::Instant;

use geometry::Field;
use geometry::measure::l2_distance;
use operators::ComputeDevice;
use runs::Interrupt;
use solver::{FlowState, StepRecord};

use crate::motion::Motion;
use crate::record::Values;
use crate::steps::StepControl;
use crate::{Case, Error, Event, Flow, Observer, Record, Stop, Store};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// A stop rule holds.
    Stopped(Stop),
    /// It was interrupted, and can be resumed.
    Interrupted,
}

/// A case on its way.
pub struct Run<const D: usize> {
    pub(crate) case: Case<D>,
    pub(crate) device: ComputeDevice,
    motion: Motion<D>,
    control: StepControl,
    field: Field<D>,
    pub(crate) start: Values,
    pub(crate) records: Vec<Record>,
    ended: Option<Stop>,
}

impl<const D: usize> Run<D> {
    /// A case at its start.
    ///
    /// # Errors
    /// What the case's parts refuse: [`Error::Parameter`], [`Error::Solver`], [`Error::Fem`], [`Error::Geometry`].
    pub fn new(case: Case<D>, device: &ComputeDevice) -> Result<Self, Error> {
        let start = values(&case, &case.initial, 0.0)?;
        let state = FlowState::new(case.initial.clone(), 0, 0.0);
        Self::at(case, device, start, Vec::new(), &state)
    }

    /// A case at a state that it had after these records.
    pub(crate) fn at(
        case: Case<D>,
        device: &ComputeDevice,
        start: Values,
        records: Vec<Record>,
        state: &FlowState<D>,
    ) -> Result<Self, Error> {
        let (mcf_step, first) = (case.scales.mcf_step, case.steps.rule.size(1));
        if case.flow == Flow::MeanCurvature && first.to_bits() != mcf_step.to_bits() {
            return Err(Error::Parameter {
                name: "tau",
                value: first,
                expected: "the inner step, for mean curvature flow",
            });
        }
        let scales = (mcf_step, case.largest_step());
        let mut control = StepControl::new(case.steps, scales, case.end())?;
        let mut step_size = control.step_size();
        for record in &records {
            step_size = control.step_size();
            control.accept(record)?;
        }
        let mut run = Self {
            motion: Motion::new(&case, state, device)?,
            device: device.clone(),
            field: state.current.clone(),
            case,
            control,
            start,
            records,
            ended: None,
        };
        run.ended = run.stop(step_size);
        Ok(run)
    }

    /// One step: a minimization of the size that comes next, halved where that is allowed and it fails. Nothing once a stop rule holds.
    ///
    /// # Errors
    /// [`Error::Step`], [`Error::TooStiff`]; the run stays where it was.
    pub fn step(&mut self) -> Result<Option<&Record>, Error> {
        if self.ended.is_some() {
            return Ok(None);
        }
        let clock = Instant::now();
        let (halvings, minimization) = self.attempt()?;
        let field = self.motion.field().map_err(|source| self.failed(source))?;
        let seconds = clock.elapsed().as_secs_f64();
        let step_size = self.control.step_size();
        let mcf_step = self.case.scales.mcf_step;
        let count = self.records.len() + 1;
        let time = minimization.map_or(count as f64 * mcf_step, |made| made.time);
        let mut record = Record {
            step: self.control.step(),
            completes_step: false,
            time,
            tau: minimization.map_or(mcf_step, |made| made.tau),
            halvings,
            moved: l2_distance(&field, &self.field)?,
            travelled: l2_distance(&field, &self.case.initial)?,
            minimization,
            measures: values(&self.case, &field, time)?,
            seconds,
        };
        record.completes_step = self.control.accept(&record)?;
        self.field = field;
        self.records.push(record);
        self.ended = self.stop(step_size);
        Ok(self.records.last())
    }

    /// All steps up to the end, or until `interrupt` asks for an end; observers are told after each. With a store there are
    /// checkpoints, the last one where a step failed, too; the store is not finished, so that more can be added to it.
    ///
    /// # Errors
    /// As [`Self::step`], and what observers and the store raise.
    pub fn advance(
        &mut self,
        mut store: Option<&mut Store>,
        observers: &mut [&mut dyn Observer<D>],
        interrupt: &Interrupt,
    ) -> Result<Ending, Error> {
        if self.records.is_empty() {
            self.tell(store.as_deref_mut(), observers)?;
        }
        loop {
            if let Some(stop) = self.ended {
                return Ok(Ending::Stopped(stop));
            }
            if let Err(error) = self.step() {
                if let Some(store) = &mut store {
                    store.commit(self)?;
                }
                return Err(error);
            }
            self.tell(store.as_deref_mut(), observers)?;
            let interrupted = interrupt.requested();
            if let Some(store) = &mut store {
                store.commit_if_due(self, interrupted)?;
            }
            if interrupted && self.ended.is_none() {
                return Ok(Ending::Interrupted);
            }
        }
    }

    fn tell(
        &self,
        store: Option<&mut Store>,
        observers: &mut [&mut dyn Observer<D>],
    ) -> Result<(), Error> {
        let mut event = Event {
            case: &self.case,
            field: &self.field,
            records: &self.records,
            ended: self.ended,
            directory: store.map(Store::directory),
        };
        observers
            .iter_mut()
            .try_for_each(|observer| observer.observe(&mut event))
    }

    /// A minimization that succeeds, and how often its size was halved.
    fn attempt(&mut self) -> Result<(u32, Option<StepRecord>), Error> {
        use solver::Error::{NonFinite, NotConverged, NotHeld};
        let (mut size, most) = (self.control.next_size(), self.control.halvings());
        let mut halvings = 0;
        loop {
            match self.motion.advance(size) {
                Ok(made) => return Ok((halvings, made)),
                Err(NotConverged { .. } | NonFinite { .. } | NotHeld { .. }) if halvings < most => {
                    size *= 0.5;
                    halvings += 1;
                }
                Err(source @ (NotConverged { .. } | NonFinite { .. } | NotHeld { .. }))
                    if most > 0 =>
                {
                    return Err(Error::TooStiff {
                        case: self.case.title(),
                        step: self.control.step(),
                        tau: size,
                        halvings,
                        source: Box::new(source),
                    });
                }
                Err(source) => return Err(self.failed(source)),
            }
        }
    }

    fn failed(&self, source: solver::Error) -> Error {
        Error::Step {
            case: self.case.title(),
            source: Box::new(source),
        }
    }

    /// The first stop rule that holds, where the last record belongs to a time step of this size.
    fn stop(&self, step_size: f64) -> Option<Stop> {
        let mut stops = self.case.stops.iter();
        stops.find(|stop| stop.holds(self, step_size)).copied()
    }

    /// What is run.
    pub fn case(&self) -> &Case<D> {
        &self.case
    }

    /// The phase field.
    pub fn field(&self) -> &Field<D> {
        &self.field
    }

    /// The measures of the initial phase field.
    pub fn start(&self) -> &Values {
        &self.start
    }

    /// All records so far.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Why the run is over, if it is.
    pub fn ended(&self) -> Option<Stop> {
        self.ended
    }

    /// Time steps completed.
    pub fn steps(&self) -> usize {
        self.control.step() - 1
    }

    /// Time reached.
    pub fn time(&self) -> f64 {
        self.records.last().map_or(0.0, |last| last.time)
    }

    /// Work of the linear solves inside finite elements so far; none for a learned operator.
    pub fn statistics(&self) -> Option<fem::Statistics> {
        self.motion.statistics()
    }

    pub(crate) fn state(&self) -> Result<FlowState<D>, Error> {
        Ok(self.motion.state(self.records.len(), self.time())?)
    }
}

fn values<const D: usize>(case: &Case<D>, field: &Field<D>, time: f64) -> Result<Values, Error> {
    let mut values = Values::new();
    for measure in &case.measures {
        if let Some(value) = measure.of(field, time)? {
            values.insert(measure.name().to_owned(), value);
        }
    }
    Ok(values)
}
