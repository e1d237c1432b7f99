//! Runs that are stored in directories.

use std::collections::BTreeSet;
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use geometry::{Bricks, Field, Grid, NodeSet, Nodes, PhaseField, Stored};
use operators::ComputeDevice;
use runs::{RunDirectory, State, StoredRun};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use solver::FlowState;

use crate::record::to_csv;
use crate::{Case, Error, Flow, Record, Run, Stop};

/// The table of all records in a stored run.
pub const METRICS: &str = "metrics.csv";
/// The wall times of all records in a stored run, in seconds: the one file that may differ between two runs of a case.
pub const TIMINGS: &str = "timings.json";

/// When checkpoints are written.
#[derive(Clone, Copy, Debug)]
pub enum Checkpoints {
    /// After this many minimizations.
    EverySteps(usize),
    /// After the first step that ends this long after the last one.
    Every(Duration),
}

/// The directory of a run, with a checkpoint from time to time.
pub struct Store {
    directory: RunDirectory,
    checkpoints: Checkpoints,
    /// What the application keeps in each checkpoint.
    notes: Value,
    last: Instant,
    /// Records in the last checkpoint.
    records: usize,
}

impl Store {
    /// Starts the directory of a run with these files and a first checkpoint. `notes` are kept in all checkpoints, and a run that is
    /// resumed has to have the same.
    pub fn create<const D: usize>(
        folder: impl Into<PathBuf>,
        files: &[(&str, &[u8])],
        run: &Run<D>,
        notes: Value,
        checkpoints: Checkpoints,
    ) -> Result<Self, Error> {
        let directory = RunDirectory::create(folder, files, &pack(run, &notes)?)?;
        Ok(Self::at(directory, notes, checkpoints, run))
    }

    fn at<const D: usize>(
        directory: RunDirectory,
        notes: Value,
        checkpoints: Checkpoints,
        run: &Run<D>,
    ) -> Self {
        Self {
            directory,
            checkpoints,
            notes,
            last: Instant::now(),
            records: run.records.len(),
        }
    }

    /// Takes a stored run up where its last checkpoint is; `case` is built anew, from the [`initial`] field if need be, and must be the
    /// stored one.
    pub fn resume<const D: usize>(
        stored: StoredRun,
        case: Case<D>,
        device: &ComputeDevice,
        checkpoints: Checkpoints,
    ) -> Result<(Self, Run<D>), Error> {
        let run = restore(&stored, case, device, &[])?;
        let notes = notes(&stored).clone();
        let (directory, _) = stored.resume()?;
        Ok((Self::at(directory, notes, checkpoints, &run), run))
    }

    /// Goes on with a finished run under other stop rules, and with other notes; `case` is the stored one but for those. The table of its
    /// records and the files of its end, which `ends` names, stay and are no longer part of it.
    ///
    /// # Errors
    /// As [`Self::resume`]; [`Error::Stored`] if one of the stop rules holds already, and of Willmore flow for another end time, since steps
    /// may have been cut short for the old one.
    pub fn extend<const D: usize>(
        stored: StoredRun,
        case: Case<D>,
        device: &ComputeDevice,
        (checkpoints, notes): (Checkpoints, Value),
        ends: impl Fn(&str) -> bool,
    ) -> Result<(Self, Run<D>), Error> {
        let stops: Vec<Stop> = read(&stored, &stored.state().notes["case"]["stops"])?;
        let [old, new] = [&stops, &case.stops].map(|stops| Stop::end(stops).map(f64::to_bits));
        // Steps of mean curvature flow have one size.
        if case.flow == Flow::Willmore && old.is_some() && old != new {
            let reason = "steps may have been cut short for another end time".to_owned();
            return Err(refused(&stored, reason));
        }
        let run = restore(&stored, case, device, &["stops"])?;
        if let Some(stop) = run.ended() {
            let stop = match stop {
                Stop::Steps(_) => Stop::Steps(run.steps()),
                stop => stop,
            };
            return Err(refused(&stored, stop.to_string()));
        }
        let is_gone = |name: &str| name == METRICS || ends(name);
        let directory = stored.reopen(&pack(&run, &notes)?, is_gone)?;
        Ok((Self::at(directory, notes, checkpoints, &run), run))
    }

    /// The directory, to which files can be added.
    pub fn directory(&mut self) -> &mut RunDirectory {
        &mut self.directory
    }

    /// Writes a checkpoint if one is due, or if there `must` be one of this step: a step that has failed may have begun on other bricks.
    pub(crate) fn commit<const D: usize>(&mut self, run: &Run<D>, must: bool) -> Result<(), Error> {
        let is_due = match self.checkpoints {
            Checkpoints::EverySteps(steps) => run.records.len().is_multiple_of(steps),
            Checkpoints::Every(time) => self.last.elapsed() >= time,
        };
        if !(is_due || must) || run.records.len() == self.records {
            return Ok(());
        }
        let table = self.write_timings(run)?;
        self.directory.replace_file(METRICS, table.as_bytes())?;
        self.directory.commit(&pack(run, &self.notes)?)?;
        (self.last, self.records) = (Instant::now(), run.records.len());
        Ok(())
    }

    /// Writes the last checkpoint of a run that is over, and removes the others.
    pub fn finish<const D: usize>(mut self, run: &Run<D>) -> Result<(), Error> {
        let table = self.write_timings(run)?;
        self.directory.write_file(METRICS, table.as_bytes())?;
        Ok(self.directory.finish(&pack(run, &self.notes)?)?)
    }

    /// Also gives the table of all records.
    fn write_timings<const D: usize>(&mut self, run: &Run<D>) -> Result<String, Error> {
        let seconds: Vec<f64> = run.records.iter().map(|record| record.seconds).collect();
        let json = serde_json::to_vec_pretty(&seconds).expect("they are numbers");
        self.directory.replace_file(TIMINGS, &json)?;
        Ok(to_csv(&run.records))
    }
}

/// What the application keeps in the checkpoints of a run.
pub fn notes(stored: &StoredRun) -> &Value {
    &stored.state().notes["application"]
}

/// The stop rule that ended a stored run, if it is over.
pub fn ended(stored: &StoredRun) -> Result<Option<Stop>, Error> {
    read(stored, &stored.state().notes["ended"])
}

/// The dimension of a stored run.
pub fn dimension(stored: &StoredRun) -> Result<usize, Error> {
    let dimension: usize = read(stored, &stored.state().notes["case"]["grid"]["dimension"])?;
    match dimension {
        2 | 3 => Ok(dimension),
        other => Err(unreadable(stored, format!("{other} is no dimension"))),
    }
}

/// The initial phase field of a stored run, and the nodes whose values move if not all do: a case can be built from them without its
/// input.
pub fn initial<const D: usize>(stored: &StoredRun) -> Result<(Stored<D>, Option<NodeSet>), Error> {
    let grid = grid(stored)?;
    let region = stored.state().array("region").map(|ends| {
        let ranges = ends.chunks_exact(2);
        let ranges = ranges.map(|ends| ends[0] as usize..ends[1] as usize);
        NodeSet::from_ranges(grid.len(), ranges)
            .ok_or_else(|| unreadable(stored, "its region is none of its grid"))
    });
    let initial = phase_field(stored, "initial", &nodes(stored, "initial_bricks", grid)?)?;
    Ok((initial, region.transpose()?))
}

/// All records of a stored run with their wall times, which are not a number where they are lost: the file is not checked.
pub fn records(stored: &StoredRun) -> Result<Vec<Record>, Error> {
    let mut records: Vec<Record> = read(stored, &stored.state().notes["records"])?;
    let timings = stored.read(TIMINGS).unwrap_or_default();
    let timings: Vec<Option<f64>> = serde_json::from_slice(&timings).unwrap_or_default();
    for (k, record) in records.iter_mut().enumerate() {
        record.seconds = timings.get(k).copied().flatten().unwrap_or(f64::NAN);
    }
    Ok(records)
}

fn pack<'a, const D: usize>(run: &'a Run<D>, notes: &Value) -> Result<State<'a>, Error> {
    let state = run.state()?;
    let (previous, previous_tau) = state.previous.unzip();
    let marks = |u: &Stored<D>| u.nodes().bricks().map(|bricks| bricks.marks());
    let bricks = marks(&state.current);
    let notes = json!({
        "case": run.identity(),
        "application": notes,
        "start": run.start,
        "ended": run.ended(),
        "records": run.records,
        "time": state.time,
        "previous_tau": previous_tau,
    });
    let initial = &run.case.initial;
    let mut packed = State::new(run.records.len() as u64, notes)
        .with_array("initial", initial.values())
        .with_array("current", state.current.into_values());
    let optional = [
        ("initial_bricks", marks(initial)),
        ("bricks", bricks),
        ("previous", previous.map(Stored::into_values)),
        ("rate", state.rate.map(Stored::into_values)),
    ];
    for (name, values) in optional {
        if let Some(values) = values {
            packed = packed.with_array(name, values);
        }
    }
    for (level, motion) in state.half_motions.into_iter().enumerate() {
        packed = packed.with_array(&half_motion(level), motion.into_values());
    }
    if let Some(region) = &run.case.region {
        let ranges = region.ranges().iter();
        let ends = ranges.flat_map(|range| [range.start as f64, range.end as f64]);
        packed = packed.with_array("region", ends.collect::<Vec<f64>>());
    }
    Ok(packed)
}

fn half_motion(level: usize) -> String {
    format!("half_motion_{level}")
}

fn restore<const D: usize>(
    stored: &StoredRun,
    case: Case<D>,
    device: &ComputeDevice,
    differing: &[&str],
) -> Result<Run<D>, Error> {
    let state = stored.state();
    let mut wanted = case.identity(device);
    for &key in differing {
        wanted[key] = state.notes["case"][key].clone();
    }
    check_identity(stored, &wanted)?;
    let grid = *case.grid();
    let nodes = nodes(stored, "bricks", grid)?;
    let optional = |name: &str| {
        let is_there = state.array(name).is_some();
        is_there
            .then(|| phase_field(stored, name, &nodes))
            .transpose()
    };
    let previous_tau: Option<f64> = read(stored, &state.notes["previous_tau"])?;
    // Where nothing is stored nothing moves.
    let rate =
        optional("rate")?.map(|rate| Stored::new(rate.into_values(), nodes.clone(), [0.0; 2]));
    let (mut half_motions, mut half) = (Vec::new(), grid);
    while let Some(motion) = state.array(&half_motion(half_motions.len())) {
        half = half.half()?;
        half_motions.push(Field::from_values(half, motion.to_vec())?);
    }
    let at = FlowState {
        current: phase_field(stored, "current", &nodes)?,
        previous: optional("previous")?.zip(previous_tau),
        rate,
        half_motions,
        step: usize::try_from(state.step).map_err(|error| unreadable(stored, error))?,
        time: read(stored, &state.notes["time"])?,
    };
    let start = read(stored, &state.notes["start"])?;
    Run::at(case, device, start, records(stored)?, Some(&at))
}

/// Refuses a stored run of another case, and says in what it differs.
fn check_identity(stored: &StoredRun, wanted: &Value) -> Result<(), Error> {
    let found = &stored.state().notes["case"];
    if found == wanted {
        return Ok(());
    }
    let keys = [wanted, found].into_iter().filter_map(Value::as_object);
    let keys: BTreeSet<&String> = keys.flat_map(|map| map.keys()).collect();
    let keys = keys.into_iter().filter(|key| found[key] != wanted[key]);
    let differing = keys.map(|key| format!("{key}: {} there, {} here", found[key], wanted[key]));
    let differing = differing.collect::<Vec<_>>().join("; ");
    let reason = format!("it is of another case ({differing}); start a new run in another folder");
    Err(refused(stored, reason))
}

fn grid<const D: usize>(stored: &StoredRun) -> Result<Grid<D>, Error> {
    let grid = &stored.state().notes["case"]["grid"];
    let origin: Vec<f64> = read(stored, &grid["origin"])?;
    let origin: [f64; D] = origin
        .try_into()
        .map_err(|_| unreadable(stored, format!("its grid is not in {D}D")))?;
    let (cells, side) = (read(stored, &grid["cells"])?, read(stored, &grid["side"])?);
    Ok(Grid::new(cells, side)?.with_origin(origin)?)
}

/// Where the values of phase fields lie, by the name of the marks of their bricks.
fn nodes<const D: usize>(stored: &StoredRun, name: &str, grid: Grid<D>) -> Result<Nodes<D>, Error> {
    let Some(marks) = stored.state().array(name) else {
        return Ok(grid.into());
    };
    let bricks = Bricks::with_marks(grid.cells(), marks);
    let bricks = bricks.map_err(|error| unreadable(stored, error))?;
    Ok(Nodes::on_bricks(grid, Arc::new(bricks)))
}

fn phase_field<const D: usize>(
    stored: &StoredRun,
    name: &str,
    nodes: &Nodes<D>,
) -> Result<Stored<D>, Error> {
    let values = stored.state().array(name).unwrap_or_default().to_vec();
    let field = Stored::from_values(nodes.clone(), values);
    field.map_err(|error| unreadable(stored, format!("its array {name}: {error}")))
}

pub(crate) fn read<T: DeserializeOwned>(stored: &StoredRun, value: &Value) -> Result<T, Error> {
    T::deserialize(value).map_err(|error| unreadable(stored, error))
}

fn unreadable(stored: &StoredRun, reason: impl Display) -> Error {
    refused(stored, format!("{reason}; start a new run"))
}

fn refused(stored: &StoredRun, reason: String) -> Error {
    Error::Stored {
        path: stored.path().to_owned(),
        reason,
    }
}
