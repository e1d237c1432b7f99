//! One shape evolving by one method, kept on disk sample by sample, so that it can be compared with any other run.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use fem::LinearSolver;
use geometry::contour::ray_crossing;
use geometry::measure::{perimeter, zero_set_volume};
use geometry::{Field, Grid, npy};
use indicatif::ProgressBar;
use model::Network;
use operators::ComputeDevice;
use report::OutputDir;
use serde::{Deserialize, Serialize};
use solver::{Factors, FlowParams, FlowState, StepRecord};

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
    /// All alike, but for the first: that is divided into `halvings + 1` parts, the first two of length `tau / 2^halvings` and each
    /// of the others twice as long as the one before. Large steps from corners start so.
    Ramp {
        /// The step size in the end.
        tau: f64,
        /// How often the first part is halved.
        halvings: usize,
    },
}

impl TimeSteps {
    /// Size of a step, counted from 1.
    pub fn size(self, step: usize) -> f64 {
        match self {
            Self::Constant(tau) => tau,
            Self::Doubling(first) => first * 2.0_f64.powi(step as i32 - 1),
            Self::Ramp { tau, halvings } => {
                // The first and the second part have the same length.
                let doublings = step.max(2) - 2;
                tau * 2.0_f64.powi(doublings.min(halvings) as i32 - halvings as i32)
            }
        }
    }

    /// Time after so many steps.
    pub fn time(self, steps: usize) -> f64 {
        match self {
            Self::Constant(tau) => steps as f64 * tau,
            Self::Doubling(first) => first * (2.0_f64.powi(steps as i32) - 1.0),
            Self::Ramp { .. } => (1..=steps).map(|step| self.size(step)).sum(),
        }
    }

    /// Name in folders.
    fn key(self) -> String {
        match self {
            Self::Constant(tau) => format!("t{:.4}", -tau.log2()),
            Self::Doubling(first) => format!("doubling{:.4}", -first.log2()),
            Self::Ramp { tau, halvings } => format!("ramp{:.4}-{halvings}", -tau.log2()),
        }
    }
}

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
    /// The region in which Willmore flow moves values, if not everywhere.
    pub region: Option<NamedRegion>,
    /// Steps between two samples.
    pub sample_every: usize,
    /// Further steps to sample.
    pub also_sample: Vec<usize>,
    /// Number of steps.
    pub steps: usize,
    /// Pause after this many steps, with a checkpoint. Does not change the result of the run that continues.
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
    /// Records of the steps of Willmore flow; empty for mean curvature flow.
    pub records: Vec<StepRecord>,
    /// Measures of the shape after every step, the initial ones first.
    pub measures: Vec<Measures>,
    /// Wall time of all steps, interruptions left out.
    pub seconds: f64,
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

    /// The last step before the end or the pause.
    fn last(&self) -> usize {
        self.pause_after.unwrap_or(self.steps).min(self.steps)
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
            seconds: 0.0,
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
        bar.set_position(state.step as u64);
        if state.step < self.last() {
            match self.flow {
                Flow::Willmore => {
                    let step = (network, calibration);
                    self.willmore(&mut trajectory, &mut stored, &state, step, device, bar)
                }
                Flow::MeanCurvature => {
                    self.mean_curvature(&mut trajectory, &mut stored, &state, network, device, bar)
                }
            }?;
        }
        trajectory.records = stored.records;
        trajectory.measures = stored.measures;
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
        state: &FlowState<D>,
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
        let mut last = Instant::now();
        while flow.steps() < self.last() {
            let record = flow
                .advance(self.tau.size(flow.steps() + 1))
                .map_err(|error| self.failed(error.into()))?;
            stored.seconds += record.seconds;
            stored.records.push(record);
            let step = flow.steps();
            let field = flow.field()?;
            stored
                .measures
                .push(Measures::of(&field, self.centre, self.params.eps)?);
            if self.samples(step) {
                trajectory.keep(step, &field)?;
            }
            bar.inc(1);
            if step == self.last() || last.elapsed() >= CHECKPOINT_INTERVAL {
                trajectory.store(stored, &flow.state()?)?;
                last = Instant::now();
            }
        }
        Ok(())
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
        Ok(geometry::measure::l2_distance(
            &self.field(step)?,
            &sampled,
        )?)
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
    fn a_ramp_makes_up_for_one_step() {
        let ramp = TimeSteps::Ramp {
            tau: 0.25,
            halvings: 3,
        };
        let sizes: Vec<f64> = (1..=6).map(|step| ramp.size(step)).collect();
        assert_eq!(sizes, [0.03125, 0.03125, 0.0625, 0.125, 0.25, 0.25]);
        assert!((ramp.time(4) - 0.25).abs() < 1e-15);
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
