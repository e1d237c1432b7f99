//! Jobs whose steps are made one at a time.

use std::sync::Arc;

use crate::input::Opened;
use crate::made::{Made, Results, Shape};
use crate::prelude::*;
use crate::presentation::{Presentation, Topology};
use crate::run::{Plan, seen, touches_box};

/// A job in memory that makes a step when it is asked for one: an iterator over the records of the steps.
///
/// ```
/// use jobs::{FlowOptions, Job, Silent};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut options = FlowOptions::of("builtin:cross");
/// options.input.cells = Some(24);
/// options.run.steps = Some(3);
/// for record in jobs::begin(Job::Flow(options), &Silent)? {
///     println!("t = {:.1e}", record?.time);
/// }
/// # Ok(())
/// # }
/// ```
pub struct Steps {
    stage: Box<dyn Stage>,
    /// Parts and holes when they were last looked at.
    before: Option<Topology>,
}

impl Steps {
    pub(crate) fn new<const D: usize, O>(plan: Plan<'static, D, O>, run: Run<D>) -> Self
    where
        O: Presentation<D> + Send + Sync + 'static,
        Made<D>: Into<Results>,
        Stored<D>: Into<Opened>,
    {
        let start = Arc::new(run.case().initial.clone());
        let plan = Arc::new(plan);
        let stage: Box<dyn Stage> = Box::new(Going { plan, start, run });
        let before = stage.topology();
        Self { stage, before }
    }

    /// The dimension of the shape.
    pub fn dimension(&self) -> usize {
        self.stage.dimension()
    }

    /// The records of the steps so far.
    pub fn records(&self) -> &[Record] {
        self.stage.records()
    }

    /// The measures of the shape at the beginning.
    pub fn start(&self) -> &engine::Values {
        self.stage.start()
    }

    /// [`Note::TopologyChanged`], if parts or holes have come or gone since the last call or the beginning.
    pub fn change(&mut self) -> Option<Note> {
        let now = self.stage.topology()?;
        let before = self.before.replace(now).filter(|before| *before != now)?;
        let last = self.records().last()?;
        Some(Note::TopologyChanged {
            step: last.step,
            time: last.time,
            before,
            now,
        })
    }

    /// Whether the shape touches the side of the box, beyond which its periodic image is.
    pub fn touches_box(&self) -> bool {
        self.stage.touches_box()
    }

    /// The present time.
    pub fn time(&self) -> f64 {
        self.records().last().map_or(0.0, |last| last.time)
    }

    /// The rule that ended the job, if it is over.
    pub fn ended(&self) -> Option<Stop> {
        self.stage.ended()
    }

    /// The shape as it is now.
    pub fn state(&self) -> StepState {
        StepState(self.stage.state())
    }

    /// The results so far. A job that is not over can go on.
    ///
    /// # Errors
    /// A surface that touches itself.
    pub fn results(&self) -> Result<Results> {
        self.stage.results()
    }
}

impl Iterator for Steps {
    type Item = Result<Record>;

    /// Makes a step; none once a stop rule holds.
    fn next(&mut self) -> Option<Self::Item> {
        self.stage.step().transpose()
    }
}

/// The shape after a step, which stays when the job goes on.
#[derive(Clone)]
pub struct StepState(Arc<dyn Snapshot>);

impl StepState {
    /// Its phase field.
    pub fn field(&self) -> Opened {
        self.0.field()
    }

    /// The curve or surface, unless it has vanished.
    ///
    /// # Errors
    /// A surface that touches itself.
    pub fn shape(&self) -> Result<Option<Shape>> {
        self.0.shape()
    }
}

trait Snapshot: Send + Sync {
    fn field(&self) -> Opened;
    fn shape(&self) -> Result<Option<Shape>>;
}

struct Moment<const D: usize, O> {
    plan: Arc<Plan<'static, D, O>>,
    start: Arc<Stored<D>>,
    u: Stored<D>,
    eps: f64,
}

impl<const D: usize, O> Snapshot for Moment<D, O>
where
    O: Presentation<D> + Send + Sync,
    Stored<D>: Into<Opened>,
{
    fn field(&self) -> Opened {
        self.u.clone().into()
    }

    fn shape(&self) -> Result<Option<Shape>> {
        self.plan.shape(&self.start, &self.u, self.eps)
    }
}

/// A job in either dimension.
trait Stage: Send {
    fn dimension(&self) -> usize;
    fn records(&self) -> &[Record];
    fn start(&self) -> &engine::Values;
    fn ended(&self) -> Option<Stop>;
    fn topology(&self) -> Option<Topology>;
    fn touches_box(&self) -> bool;
    fn state(&self) -> Arc<dyn Snapshot>;
    fn results(&self) -> Result<Results>;
    fn step(&mut self) -> Result<Option<Record>>;
}

struct Going<const D: usize, O> {
    plan: Arc<Plan<'static, D, O>>,
    start: Arc<Stored<D>>,
    run: Run<D>,
}

impl<const D: usize, O> Stage for Going<D, O>
where
    O: Presentation<D> + Send + Sync + 'static,
    Made<D>: Into<Results>,
    Stored<D>: Into<Opened>,
{
    fn dimension(&self) -> usize {
        D
    }

    fn records(&self) -> &[Record] {
        self.run.records()
    }

    fn start(&self) -> &engine::Values {
        self.run.start()
    }

    fn ended(&self) -> Option<Stop> {
        self.run.ended()
    }

    fn topology(&self) -> Option<Topology> {
        let u = self.run.stored();
        if !has_interface(u) {
            return None;
        }
        self.plan.presentation.topology(u).ok()
    }

    fn touches_box(&self) -> bool {
        touches_box(&self.run)
    }

    fn state(&self) -> Arc<dyn Snapshot> {
        Arc::new(Moment {
            plan: self.plan.clone(),
            start: self.start.clone(),
            u: seen(&self.run),
            eps: self.run.case().scales.eps,
        })
    }

    fn results(&self) -> Result<Results> {
        Ok(self.plan.made(&self.run)?.into())
    }

    fn step(&mut self) -> Result<Option<Record>> {
        Ok(self.run.step()?.cloned())
    }
}
