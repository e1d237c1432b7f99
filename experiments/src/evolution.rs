//! One shape evolving by one method, kept on disk sample by sample, so that it can be compared with any other run.

use std::ops::Add;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use fem::LinearSolver;
use geometry::contour::ray_crossing;
use geometry::measure::{l2_distance, perimeter, zero_set_volume};
use geometry::{Field, Grid, npy};
use indicatif::ProgressBar;
use model::Network;
use operators::ComputeDevice;
use report::OutputDir;
use serde::{Deserialize, Serialize};
use solver::{Factors, FlowParams, FlowState, Parts, StepRecord};

use crate::Error;
use crate::circles::Flow;
use crate::method::{Method, Scheme};
use crate::networks::checksum;

/// Least time between two checkpoints of a run.
const CHECKPOINT_INTERVAL: Duration = Duration::from_mins(1);

/// Sizes of the time steps of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeSteps {
    /// All alike.
    Constant(f64),
    /// The first one; each of the others is twice as long as the one before.
    Doubling(f64),
    /// The first ones alike; each of the others is twice as long as the one before.
    Growing {
        /// Size of the first ones.
        tau: f64,
        /// How many of them there are.
        alike: usize,
    },
}

impl TimeSteps {
    /// Size of a step, counted from 1.
    pub fn size(self, step: usize) -> f64 {
        match self {
            Self::Constant(tau) => tau,
            Self::Doubling(first) => first * 2.0_f64.powi(step as i32 - 1),
            Self::Growing { tau, alike } => tau * 2.0_f64.powi(step.saturating_sub(alike) as i32),
        }
    }

    /// Time after so many steps.
    pub fn time(self, steps: usize) -> f64 {
        match self {
            Self::Constant(tau) => steps as f64 * tau,
            Self::Doubling(first) => first * (2.0_f64.powi(steps as i32) - 1.0),
            // An empty sum is -0.
            Self::Growing { .. } => (1..=steps).map(|step| self.size(step)).fold(0.0, f64::add),
        }
    }

    /// Name in folders.
    fn key(self) -> String {
        match self {
            Self::Constant(tau) => format!("t{:.4}", -tau.log2()),
            Self::Doubling(first) => format!("doubling{:.4}", -first.log2()),
            Self::Growing { tau, alike } => format!("t{:.4}-growing{alike}", -tau.log2()),
        }
    }
}

/// Steps of Willmore flow in parts of adaptive size ([`solver::Parts`]).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Division {
    /// The first part of the first step is at most of this size; each other step begins with parts like the last ones before it.
    pub first: f64,
    /// The phase field is also kept after `tau / 2^k` of the first step, for these `k`, as far as a part ends there.
    pub kept: Vec<u32>,
}

/// A part is halved at most this often with respect to the first part.
const HALVINGS: i32 = 12;

/// The nodes that may move, under a name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NamedRegion {
    /// What the nodes depend on, besides the grid.
    pub name: String,
    /// A mark for every node, in the order of the grid.
    #[serde(skip)]
    pub nodes: Arc<[bool]>,
}

/// A run in `D` dimensions, with everything its result depends on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evolution<const D: usize> {
    /// Name of the initial shape with its measures.
    pub shape: String,
    /// Which flow.
    pub flow: Flow,
    /// Which method.
    pub method: Method,
    /// Which scheme.
    pub scheme: Scheme,
    /// Cells per unit length.
    pub n: usize,
    /// Side of the periodic box.
    pub side: f64,
    /// Centre of the box, on every axis.
    pub centre: f64,
    /// Scales and settings.
    pub params: FlowParams,
    /// Sizes of the (outer) time steps.
    pub tau: TimeSteps,
    /// Whether and how steps of Willmore flow are made in parts. Records and measures are then those of the parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub division: Option<Division>,
    /// A run of Willmore flow ends when the phase field moves by less than this fraction of the way that it has come (`L2`) per step; a
    /// part of a step counts as much as it would if the whole step were like it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub still: Option<f64>,
    /// The region in which Willmore flow moves values, if not everywhere.
    pub region: Option<NamedRegion>,
    /// Steps between two samples.
    pub sample_every: usize,
    /// Further steps to sample.
    pub also_sample: Vec<usize>,
    /// Number of steps.
    pub steps: usize,
    /// Pause after this many steps (or parts of steps), with a checkpoint. Does not change the result of the run that continues.
    #[serde(skip)]
    pub pause_after: Option<usize>,
}

/// What else the result depends on.
#[derive(Serialize)]
struct Key<'a, const D: usize> {
    evolution: &'a Evolution<D>,
    device: String,
    network: Option<String>,
    version: &'static str,
}

/// Index of a stored run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Stored {
    key: serde_json::Value,
    records: Vec<StepRecord>,
    measures: Vec<Measures>,
    seconds: f64,
    checkpoint: Option<Checkpoint>,
    /// The last step, of which perhaps not all parts were made, of a run that ended because it stood still.
    #[serde(default)]
    still: Option<usize>,
}

/// Where a run of Willmore flow is.
struct Position {
    /// How many records there were at the end of each complete step,
    ends: Vec<usize>,
    /// and the parts of the step that is being made.
    parts: Parts,
}

impl Position {
    /// Number of the step that is being made.
    fn step(&self) -> usize {
        self.ends.len() + 1
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Checkpoint {
    step: usize,
    time: f64,
    previous_tau: Option<f64>,
    /// Kept motions on coarser grids.
    #[serde(default)]
    half_motions: usize,
}

/// Measures of a shape around the centre of the box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Perimeter `P_eps`.
    pub perimeter: f64,
    /// Area or volume of `{u > 0}`.
    pub volume: f64,
    /// Distance from the centre to the zero crossing on the positive x axis.
    pub tip: Option<f64>,
    /// Distance from the centre to the zero crossing on the diagonal `x = y (= z) > 0`.
    pub diagonal: Option<f64>,
}

impl Measures {
    fn of<const D: usize>(field: &Field<D>, centre: f64, eps: f64) -> Result<Self, Error> {
        let along = |direction| ray_crossing(field, [centre; D], direction);
        let first = std::array::from_fn(|axis| if axis == 0 { 1.0 } else { 0.0 });
        Ok(Self {
            perimeter: perimeter(field, eps)?,
            volume: zero_set_volume(field),
            tip: along(first)?,
            diagonal: along([1.0; D])?,
        })
    }
}

/// A finished run.
pub struct Trajectory<const D: usize> {
    /// What was run.
    pub evolution: Evolution<D>,
    /// Records of the steps (or their parts) of Willmore flow; empty for mean curvature flow.
    pub records: Vec<StepRecord>,
    /// Measures of the shape after every step (or part), the initial ones first.
    pub measures: Vec<Measures>,
    /// The last step, if the run ended early because it hardly moved any more. It may have ended before this step was complete; the
    /// field there is kept as that of the step.
    pub still: Option<usize>,
    /// Wall time of all steps, interruptions left out.
    pub seconds: f64,
    /// How many records there were at the end of each step of Willmore flow.
    ends: Vec<usize>,
    grid: Grid<D>,
    folder: OutputDir,
}

impl<const D: usize> Evolution<D> {
    /// Name of the run's folder.
    pub fn name(&self) -> String {
        format!(
            "{}-{}-n{}-{}",
            self.flow.key(),
            self.method.key_in(self.scheme),
            self.n,
            self.tau.key()
                + if self.division.is_some() {
                    "-parts"
                } else {
                    ""
                }
        )
    }

    /// The grid.
    ///
    /// # Errors
    /// [`Error::Geometry`] if the side is no multiple of `1/n`.
    pub fn grid(&self) -> Result<Grid<D>, Error> {
        let corner = [self.centre - 0.5 * self.side; D];
        Ok(Grid::per_unit(self.n, self.side)?.with_origin(corner)?)
    }

    /// The last step of a flow that is not divided, before the end or the pause.
    fn last(&self) -> usize {
        self.pause_after.unwrap_or(self.steps).min(self.steps)
    }

    /// Where the flow is in which step, from the parts that were made.
    fn position(&self, Stored { records, still, .. }: &Stored) -> Result<Position, Error> {
        let mut position = Position {
            ends: Vec::new(),
            parts: self.parts(1, f64::INFINITY)?,
        };
        for (k, record) in records.iter().enumerate() {
            position.parts.made(record);
            self.proceed(&mut position, k + 1)?;
        }
        if still.is_some_and(|last| position.ends.len() < last) {
            position.ends.push(records.len());
        }
        Ok(position)
    }

    /// Goes to the next step if one is complete, after so many records, and says so.
    fn proceed(&self, position: &mut Position, records: usize) -> Result<bool, Error> {
        let complete = position.parts.next_size().is_none();
        if complete {
            let (step, size) = (position.step(), position.parts.size());
            // Steps that double begin with twice the size, too.
            let growth = self.tau.size(step + 1) / self.tau.size(step);
            position.ends.push(records);
            position.parts = self.parts(step + 1, growth * size)?;
        }
        Ok(complete)
    }

    /// The parts of a step that begins with parts of at most this size.
    fn parts(&self, step: usize, first: f64) -> Result<Parts, Error> {
        let tau = self.tau.size(step);
        Ok(match &self.division {
            None => Parts::new(tau, tau, tau)?,
            Some(division) => {
                let first = first.min(if step == 1 { division.first } else { tau });
                let least = first.min(division.first).min(tau) * 2.0_f64.powi(-HALVINGS);
                Parts::new(tau, first, least)?
            }
        })
    }

    /// `tau` of the first step over the time since the beginning, where that is a power of two whose field is to be kept.
    fn kept_halvings(&self, position: &Position) -> Option<u32> {
        let kept = self.division.as_ref().map_or(&[][..], |d| &d.kept);
        let reached =
            |k: &&u32| position.parts.progress().to_bits() == 0.5_f64.powi(**k as i32).to_bits();
        kept.iter()
            .filter(|_| position.step() == 1)
            .find(reached)
            .copied()
    }

    /// Whether the phase field after `step` steps is kept.
    pub fn samples(&self, step: usize) -> bool {
        step.is_multiple_of(self.sample_every)
            || step == self.steps
            || self.also_sample.contains(&step)
    }

    /// The steps whose phase fields are kept.
    pub fn sampled_steps(&self) -> Vec<usize> {
        (0..=self.steps).filter(|&k| self.samples(k)).collect()
    }

    /// Runs, or continues, or only looks up what is stored in `store`.
    ///
    /// # Errors
    /// What the flow raises, and [`Error::Report`] or [`Error::Geometry`] if something cannot be stored.
    pub fn run(
        &self,
        initial: &dyn Fn(Grid<D>, f64) -> Result<Field<D>, Error>,
        network: Option<&Network>,
        device: &ComputeDevice,
        store: &OutputDir,
        bar: &ProgressBar,
    ) -> Result<Trajectory<D>, Error> {
        let folder = store.subfolder(&self.name())?;
        let key = serde_json::to_string(&Key {
            evolution: self,
            device: format!("{} {:?}", device.kind(), device.dtype()),
            network: network.filter(|_| self.method.is_learned()).map(checksum),
            version: env!("CARGO_PKG_VERSION"),
        })
        .and_then(|text| serde_json::from_str::<serde_json::Value>(&text))
        .map_err(|error| Error::Options(format!("a run cannot be described: {error}")))?;
        let grid = self.grid()?;
        let (prepared, calibration) =
            (self.method).prepare(self.scheme, network, &grid, &self.params)?;
        let network = prepared.as_ref();
        let mut trajectory = Trajectory {
            evolution: self.clone(),
            records: Vec::new(),
            measures: Vec::new(),
            still: None,
            seconds: 0.0,
            ends: Vec::new(),
            grid,
            folder,
        };
        let mut stored = trajectory.stored().filter(|stored| stored.key == key);
        let state = stored
            .as_ref()
            .and_then(|s| trajectory.checkpoint(s.checkpoint?).ok());
        if state.is_none() {
            stored = None;
        }
        let mut stored = stored.unwrap_or_else(|| Stored {
            key,
            ..Stored::default()
        });
        let state = match state {
            Some(state) => state,
            None => {
                trajectory.forget_parts()?;
                let field = initial(grid, self.params.eps)?;
                stored
                    .measures
                    .push(Measures::of(&field, self.centre, self.params.eps)?);
                trajectory.keep(0, &field)?;
                FlowState {
                    current: field,
                    previous: None,
                    half_motions: Vec::new(),
                    step: 0,
                    time: 0.0,
                }
            }
        };
        match self.flow {
            Flow::Willmore => {
                let mut position = self.position(&stored)?;
                bar.set_position(position.ends.len() as u64);
                if !self.is_over(&position, &stored) {
                    let from = (&state, &mut position);
                    let step = (network, calibration);
                    self.willmore(&mut trajectory, &mut stored, from, step, device, bar)?;
                }
                trajectory.ends = position.ends;
            }
            Flow::MeanCurvature => {
                bar.set_position(state.step as u64);
                if state.step < self.last() {
                    self.mean_curvature(
                        &mut trajectory,
                        &mut stored,
                        &state,
                        network,
                        device,
                        bar,
                    )?;
                }
            }
        }
        trajectory.records = stored.records;
        trajectory.measures = stored.measures;
        trajectory.still = stored.still;
        trajectory.seconds = stored.seconds;
        Ok(trajectory)
    }

    fn failed(&self, source: Error) -> Error {
        let Error::Solver(source) = source else {
            return source;
        };
        Error::Run {
            run: format!(
                "{} of the {} by {} at n = {}",
                self.flow.title(),
                self.shape,
                self.method.label_in(self.scheme),
                self.n
            ),
            source: Box::new(source),
        }
    }

    fn willmore(
        &self,
        trajectory: &mut Trajectory<D>,
        stored: &mut Stored,
        (state, position): (&FlowState<D>, &mut Position),
        (network, calibration): (Option<&Network>, Factors),
        device: &ComputeDevice,
        bar: &ProgressBar,
    ) -> Result<(), Error> {
        let linear = LinearSolver::default();
        let params = FlowParams {
            calibration,
            ..self.params
        };
        let mut flow =
            self.method
                .willmore_flow(network, &state.current, params, linear, device)?;
        if let Some(region) = &self.region {
            flow.restrict_to(&region.nodes)?;
        }
        flow.restore(state)?;
        let initial = trajectory.field(0)?;
        let mut before = state.current.clone();
        let mut last = Instant::now();
        while !self.is_over(position, stored) {
            let clock = Instant::now();
            let advanced = flow.advance_part(&mut position.parts);
            let Some(record) = advanced.map_err(|error| self.failed(error.into()))? else {
                break;
            };
            // Attempts that failed count, too.
            stored.seconds += clock.elapsed().as_secs_f64();
            stored.records.push(record);
            let field = flow.field()?;
            stored
                .measures
                .push(Measures::of(&field, self.centre, self.params.eps)?);
            if let Some(halvings) = self.kept_halvings(position) {
                npy::write(trajectory.path(&part_name(halvings))?, &field)?;
            }
            let step = position.step();
            let complete = self.proceed(position, stored.records.len())?;
            if self.stands_still([&initial, &before, &field], &record, step)? {
                stored.still = Some(step);
                if !complete {
                    position.ends.push(stored.records.len());
                }
            }
            if stored.still.is_some() || complete && self.samples(step) {
                trajectory.keep(step, &field)?;
            }
            before = field;
            bar.set_position(position.ends.len() as u64);
            if self.is_over(position, stored) || last.elapsed() >= CHECKPOINT_INTERVAL {
                trajectory.store(stored, &flow.state()?)?;
                last = Instant::now();
            }
        }
        Ok(())
    }

    /// Whether the run is at its end or at a pause.
    fn is_over(&self, position: &Position, stored: &Stored) -> bool {
        let parts = stored.records.len();
        position.step() > self.steps
            || stored.still.is_some()
            || self.pause_after.is_some_and(|pause| parts >= pause)
    }

    /// Whether a step of which this is a part moves the phase field by next to nothing; `fields` are the first one, that before the
    /// part and that after it.
    fn stands_still(
        &self,
        [first, before, after]: [&Field<D>; 3],
        record: &StepRecord,
        step: usize,
    ) -> Result<bool, Error> {
        let Some(limit) = self.still else {
            return Ok(false);
        };
        let moved = l2_distance(after, before)? * self.tau.size(step) / record.tau;
        Ok(moved <= limit * l2_distance(after, first)?)
    }

    fn mean_curvature(
        &self,
        trajectory: &mut Trajectory<D>,
        stored: &mut Stored,
        state: &FlowState<D>,
        network: Option<&Network>,
        device: &ComputeDevice,
        bar: &ProgressBar,
    ) -> Result<(), Error> {
        let mut flow =
            self.method
                .mean_curvature_flow(network, &state.current, &self.params, device)?;
        let mut last = Instant::now();
        for step in state.step + 1..=self.last() {
            let clock = Instant::now();
            flow.advance().map_err(|error| self.failed(error.into()))?;
            let field = flow.field().map_err(|error| self.failed(error.into()))?;
            stored.seconds += clock.elapsed().as_secs_f64();
            stored
                .measures
                .push(Measures::of(&field, self.centre, self.params.eps)?);
            if self.samples(step) {
                trajectory.keep(step, &field)?;
            }
            bar.inc(1);
            if step == self.last() || last.elapsed() >= CHECKPOINT_INTERVAL {
                let state = FlowState {
                    current: field,
                    previous: None,
                    half_motions: Vec::new(),
                    step,
                    time: self.tau.time(step),
                };
                trajectory.store(stored, &state)?;
                last = Instant::now();
            }
        }
        Ok(())
    }
}

impl<const D: usize> Trajectory<D> {
    /// The phase field after `step` steps, which must be a sampled one.
    ///
    /// # Errors
    /// [`Error::Geometry`] if it is not there.
    pub fn field(&self, step: usize) -> Result<Field<D>, Error> {
        self.read(&sample_name(step))
    }

    /// The phase field at the time `tau / 2^halvings` inside the first step, if it was [to be kept](Division::kept) and a part ended
    /// there.
    ///
    /// # Errors
    /// [`Error::Geometry`] if it cannot be read.
    pub fn part_field(&self, halvings: u32) -> Result<Option<Field<D>>, Error> {
        let name = part_name(halvings);
        if !self.path(&name)?.exists() {
            return Ok(None);
        }
        self.read(&name).map(Some)
    }

    /// The whole steps of Willmore flow that are done.
    pub fn steps(&self) -> usize {
        self.ends.len()
    }

    /// The records of the parts of a step of Willmore flow, counted from 1; none if it was not made.
    pub fn parts(&self, step: usize) -> &[StepRecord] {
        let end = |step: usize| self.ends.get(step.wrapping_sub(1)).copied();
        let Some(last) = end(step) else { return &[] };
        &self.records[end(step - 1).unwrap_or(0)..last]
    }

    /// The record at the end of a step of Willmore flow, counted from 1.
    pub fn record(&self, step: usize) -> Option<&StepRecord> {
        self.parts(step).last()
    }

    /// The measures after so many steps of Willmore flow.
    ///
    /// # Errors
    /// [`Error::Options`] if there were fewer steps.
    pub fn measures_after(&self, step: usize) -> Result<&Measures, Error> {
        let records = match step {
            0 => Some(0),
            step => self.ends.get(step - 1).copied(),
        };
        (records.and_then(|k| self.measures.get(k))).ok_or_else(|| {
            let steps = self.steps();
            Error::Options(format!("there is no step {step} in a run of {steps} steps"))
        })
    }

    /// `L2` distance to a run at a multiple of the resolution (and of the time resolution) at the same time, in the nodes of
    /// this grid: the finer phase field is sampled there.
    ///
    /// # Errors
    /// [`Error::Options`] if the nodes of this grid are not among those of the other.
    pub fn distance(&self, reference: &Self, step: usize) -> Result<f64, Error> {
        let (own, other) = (&self.evolution, &reference.evolution);
        let there = match (own.tau, other.tau) {
            (TimeSteps::Constant(own), TimeSteps::Constant(other)) => {
                (step as f64 * own / other).round() as usize
            }
            _ => step,
        };
        if !other.n.is_multiple_of(own.n) || own.side.to_bits() != other.side.to_bits() {
            return Err(Error::Options(format!(
                "a run at n = {} cannot be compared with a reference at n = {}: the latter must be a multiple",
                own.n, other.n
            )));
        }
        let fine = reference.field(there)?;
        let stride = other.n / own.n;
        let sampled = (0..self.grid.len()).map(|node| {
            let index = self.grid.multi_index(node).map(|i| i * stride);
            fine.values()[fine.grid().index(index)]
        });
        let sampled = Field::from_values(self.grid, sampled.collect())?;
        Ok(l2_distance(&self.field(step)?, &sampled)?)
    }

    fn path(&self, name: &str) -> Result<PathBuf, Error> {
        Ok(self.folder.path(&format!("{name}.npy"))?)
    }

    fn read(&self, name: &str) -> Result<Field<D>, Error> {
        let grid = self.grid;
        Ok(npy::read(self.path(name)?, |_| Ok(grid))?)
    }

    fn keep(&self, step: usize, field: &Field<D>) -> Result<(), Error> {
        Ok(npy::write(self.path(&sample_name(step))?, field)?)
    }

    /// Removes the fields inside the first step that another run has left: which ones this run will have is not known before.
    fn forget_parts(&self) -> Result<(), Error> {
        for &halvings in self.evolution.division.iter().flat_map(|d| &d.kept) {
            // A file that is not there needs no removal.
            let _ = std::fs::remove_file(self.path(&part_name(halvings))?);
        }
        Ok(())
    }

    fn stored(&self) -> Option<Stored> {
        let path = self.folder.path("run.json").ok()?;
        serde_json::from_slice(&std::fs::read(path).ok()?).ok()
    }

    fn checkpoint(&self, checkpoint: Checkpoint) -> Result<FlowState<D>, Error> {
        let Checkpoint {
            step,
            time,
            previous_tau,
            half_motions,
        } = checkpoint;
        let previous = match previous_tau {
            Some(tau) => Some((self.read(&checkpoint_name(step, "previous"))?, tau)),
            None => None,
        };
        let mut grid = self.grid;
        let half_motions = (0..half_motions)
            .map(|level| {
                grid = grid.half()?;
                let name = checkpoint_name(step, &half_motion_name(level));
                Ok(npy::read(self.path(&name)?, |_| Ok(grid))?)
            })
            .collect::<Result<_, Error>>()?;
        Ok(FlowState {
            current: self.read(&checkpoint_name(step, "current"))?,
            previous,
            half_motions,
            step,
            time,
        })
    }

    /// Writes the fields of a checkpoint, then the index that names them, then removes the fields of the one before.
    fn store(&self, stored: &mut Stored, state: &FlowState<D>) -> Result<(), Error> {
        let old = stored.checkpoint;
        let current = self.path(&checkpoint_name(state.step, "current"))?;
        npy::write(current, &state.current)?;
        if let Some((previous, _)) = &state.previous {
            npy::write(
                self.path(&checkpoint_name(state.step, "previous"))?,
                previous,
            )?;
        }
        for (level, motion) in state.half_motions.iter().enumerate() {
            let name = checkpoint_name(state.step, &half_motion_name(level));
            npy::write(self.path(&name)?, motion)?;
        }
        stored.checkpoint = Some(Checkpoint {
            half_motions: state.half_motions.len(),
            step: state.step,
            time: state.time,
            previous_tau: state.previous.as_ref().map(|(_, tau)| *tau),
        });
        self.folder
            .write("run.json", report::data::to_json(stored)?)?;
        for old in old.iter().filter(|old| old.step != state.step) {
            let motions = (0..old.half_motions).map(half_motion_name);
            for which in ["current", "previous"]
                .map(str::to_owned)
                .into_iter()
                .chain(motions)
            {
                // A file that is not there needs no removal.
                let _ = std::fs::remove_file(self.path(&checkpoint_name(old.step, &which))?);
            }
        }
        Ok(())
    }
}

fn sample_name(step: usize) -> String {
    format!("step_{step:05}")
}

fn half_motion_name(level: usize) -> String {
    format!("half{level}")
}

fn part_name(halvings: u32) -> String {
    format!("part_{halvings:02}")
}

fn checkpoint_name(step: usize, which: &str) -> String {
    format!("checkpoint_{step:05}_{which}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circles::{EPS, STEP};
    use crate::networks::convergence_ratios;
    use geometry::phase_field;
    use geometry::shapes::Ball;
    use model::pretrained;
    use report::Progress;
    use solver::NewtonParams;

    fn evolution(flow: Flow, method: Method) -> Evolution<2> {
        Evolution {
            shape: "disc of radius 0.2".to_owned(),
            flow,
            method,
            scheme: Scheme::Paper,
            n: 128,
            side: 0.75,
            centre: 0.0,
            params: FlowParams {
                eps: EPS,
                mcf_step: STEP,
                newton: NewtonParams::default(),
                calibration: solver::Factors::PAPER,
            },
            tau: TimeSteps::Constant(STEP),
            division: None,
            still: None,
            region: None,
            sample_every: 2,
            also_sample: vec![1],
            steps: 4,
            pause_after: None,
        }
    }

    fn disc(grid: Grid<2>, eps: f64) -> Result<Field<2>, Error> {
        Ok(phase_field(grid, &Ball::new([0.0, 0.0], 0.2)?, eps)?)
    }

    #[test]
    fn time_adds_up() {
        for tau in [TimeSteps::Constant(0.25), TimeSteps::Doubling(0.25)] {
            let sum: f64 = (1..=5).map(|k| tau.size(k)).sum();
            assert!((tau.time(5) - sum).abs() < 1e-15);
        }
        assert!((TimeSteps::Doubling(0.25).time(5) - 0.25 * 31.0).abs() < 1e-15);
    }

    #[test]
    fn growing_steps_begin_alike() {
        let growing = TimeSteps::Growing {
            tau: 0.25,
            alike: 3,
        };
        let sizes: Vec<f64> = (1..=5).map(|step| growing.size(step)).collect();
        assert_eq!(sizes, [0.25, 0.25, 0.25, 0.5, 1.0]);
        assert!((growing.time(5) - 2.25).abs() < 1e-15);
    }

    /// Parts, what they keep, and standing still: the same after an interruption in the middle of a step.
    #[test]
    fn steps_in_parts_are_interrupted_and_end_when_nothing_moves() {
        let root = tempfile::tempdir().unwrap();
        let store = |name: &str| OutputDir::create(root.path().join(name)).unwrap();
        let device = ComputeDevice::default_compiled().unwrap();
        let bar = Progress::new(true).bar("", 4);
        let network = pretrained::find(crate::networks::convergence_ratios(128).unwrap()).unwrap();
        let divided = Evolution {
            division: Some(Division {
                first: 0.25 * STEP,
                kept: vec![1, 2, 3],
            }),
            still: Some(0.55),
            ..evolution(Flow::Willmore, Method::Hybrid)
        };
        let run = |e: &Evolution<2>, folder: &OutputDir| {
            e.run(&disc, Some(&network), &device, folder, &bar).unwrap()
        };
        let reference = run(&divided, &store("whole"));
        let sizes: Vec<f64> = reference.records.iter().map(|r| r.tau / STEP).collect();
        assert_eq!(sizes, [0.25, 0.25, 0.5, 1.0]);
        assert_eq!((reference.steps(), reference.still), (2, Some(2)));
        assert!((reference.record(2).unwrap().time - 2.0 * STEP).abs() < 1e-15);
        assert_eq!(reference.measures.len(), 5);
        let paused = Evolution {
            pause_after: Some(2),
            ..divided.clone()
        };
        let folder = store("interrupted");
        assert_eq!(run(&paused, &folder).records.len(), 2);
        for _ in 0..2 {
            let resumed = run(&divided, &folder);
            assert_eq!(resumed.measures, reference.measures);
            assert_eq!(resumed.still, reference.still);
            for k in [1, 2, 3] {
                let part = resumed.part_field(k).unwrap();
                assert_eq!(part, reference.part_field(k).unwrap());
                // No part ended at an eighth of the step.
                assert_eq!(part.is_some(), k < 3);
            }
            assert_eq!(resumed.field(2).unwrap(), reference.field(2).unwrap());
        }
    }

    #[test]
    fn an_interrupted_run_continues_with_the_same_bytes() {
        let root = tempfile::tempdir().unwrap();
        let store = |name: &str| OutputDir::create(root.path().join(name)).unwrap();
        let device = ComputeDevice::default_compiled().unwrap();
        let bar = Progress::new(true).bar("", 4);
        for (flow, method, n) in [
            (Flow::Willmore, Method::Hybrid, 128),
            (Flow::MeanCurvature, Method::FeImplicit, 128),
            // Its steps begin on the half grid.
            (Flow::Willmore, Method::Hybrid, 256),
        ] {
            let network = pretrained::find(convergence_ratios(n).unwrap()).unwrap();
            let whole = Evolution {
                n,
                ..evolution(flow, method)
            };
            assert_eq!(whole.sampled_steps(), [0, 1, 2, 4]);
            let run = |e: &Evolution<2>, folder: &OutputDir| {
                e.run(&disc, Some(&network), &device, folder, &bar).unwrap()
            };
            let reference = run(&whole, &store("whole"));
            let paused = Evolution {
                pause_after: Some(2),
                ..whole.clone()
            };
            let folder = store("interrupted");
            assert_eq!(run(&paused, &folder).measures.len(), 3);
            let resumed = run(&whole, &folder);
            assert_eq!(resumed.measures, reference.measures);
            assert_eq!(reference.measures.len(), 5);
            for step in whole.sampled_steps() {
                assert_eq!(resumed.field(step).unwrap(), reference.field(step).unwrap());
            }
            // Looked up, not computed again: the wall time is that of the first time.
            assert_eq!(
                run(&whole, &folder).seconds.to_bits(),
                resumed.seconds.to_bits()
            );
            // Another run does not take these fields for its own.
            let other = Evolution {
                tau: TimeSteps::Constant(0.5 * STEP),
                ..whole.clone()
            };
            assert_ne!(other.name(), whole.name());
            assert_eq!(resumed.distance(&reference, 4).unwrap().to_bits(), 0);
            let volumes = [&reference.measures[0], &reference.measures[4]].map(|m| m.volume);
            let grows = flow == Flow::Willmore;
            assert_eq!(volumes[1] > volumes[0], grows, "{volumes:?}");
        }
    }
}
