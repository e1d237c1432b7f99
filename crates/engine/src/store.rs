//! Runs that are stored in directories.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use geometry::{Bricks, Grid, NodeSet, Nodes, PhaseField, Stored};
use operators::ComputeDevice;
use runs::{CheckpointState, RunDirectory, StoredRun};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use solver::{DeviceField, Memory, State};

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

    /// Goes on with a finished run under other stop rules, and with other notes; `case` is the stored one but for those. The files of its
    /// end, which `ends` names, stay and are no longer part of it.
    ///
    /// # Errors
    /// As [`Self::resume`]; [`Error::Stored`] if one of the stop rules holds already, and of Willmore flow for another end time, since steps
    /// may have been cut short for the old one.
    pub fn extend<const D: usize>(
        stored: StoredRun,
        case: Case<D>,
        device: &ComputeDevice,
        checkpoints: Checkpoints,
        notes: Value,
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
        let directory = stored.reopen(&pack(&run, &notes)?, ends, |name| name == METRICS)?;
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
    Ok((phase_field(stored, "initial", grid)?, region.transpose()?))
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

/// A field in the memory of a state: its grid, and its values where nothing is stored.
#[derive(Serialize, Deserialize)]
struct Remembered {
    cells: usize,
    phase_values: [f64; 2],
}

fn pack<'a, const D: usize>(run: &'a Run<D>, notes: &Value) -> Result<CheckpointState<'a>, Error> {
    let state = &run.state;
    let fields = state.memory.fields.iter();
    let fields = fields.map(|(name, field)| {
        let remembered = Remembered {
            cells: field.nodes().grid().cells(),
            phase_values: field.phase_values(),
        };
        (name.clone(), remembered)
    });
    let fields: BTreeMap<String, Remembered> = fields.collect();
    let notes = json!({
        "case": run.identity(),
        "application": notes,
        "start": run.start,
        "ended": run.ended(),
        "records": run.records,
        "time": state.time,
        "progress": state.progress,
        "memory": { "fields": fields, "numbers": state.memory.numbers },
    });
    let initial = &run.case.initial;
    let mut packed = CheckpointState::new(run.records.len() as u64, notes)
        .with_array("initial", initial.values());
    if let Some(marks) = marks(initial.nodes()) {
        packed = packed.with_array(&bricks_of("initial"), marks);
    }
    packed = with_field(packed, "current", &state.field)?;
    for (name, field) in &state.memory.fields {
        packed = with_field(packed, &in_memory(name), field)?;
    }
    if let Some(region) = &run.case.region {
        let ranges = region.ranges().iter();
        let ends = ranges.flat_map(|range| [range.start as f64, range.end as f64]);
        packed = packed.with_array("region", ends.collect::<Vec<f64>>());
    }
    Ok(packed)
}

/// Adds a field, with the bricks on which it is stored, if it is on bricks.
fn with_field<'a, const D: usize>(
    packed: CheckpointState<'a>,
    name: &str,
    field: &DeviceField<D>,
) -> Result<CheckpointState<'a>, Error> {
    let packed = match marks(field.nodes()) {
        Some(marks) => packed.with_array(&bricks_of(name), marks),
        None => packed,
    };
    Ok(packed.with_array(name, field.stored()?.into_values()))
}

fn marks<const D: usize>(nodes: &Nodes<D>) -> Option<Vec<f64>> {
    nodes.bricks().map(|bricks| bricks.marks())
}

/// The name of the array with a field in the memory of a state, apart from those of the run itself.
fn in_memory(field: &str) -> String {
    format!("memory/{field}")
}

/// The name of the marks of the bricks on which a field is stored.
fn bricks_of(field: &str) -> String {
    format!("{field}_bricks")
}

fn restore<const D: usize>(
    stored: &StoredRun,
    case: Case<D>,
    device: &ComputeDevice,
    differing: &[&str],
) -> Result<Run<D>, Error> {
    let notes = &stored.state().notes;
    let mut wanted = case.identity(device);
    for &key in differing {
        wanted[key] = notes["case"][key].clone();
    }
    check_identity(stored, &wanted)?;
    let start = read(stored, &notes["start"])?;
    let mut run = Run::at(case, device, start, records(stored)?)?;
    let state = state(stored, &run)?;
    run.go_to(state)?;
    Ok(run)
}

/// The stored state of a run.
fn state<const D: usize>(stored: &StoredRun, run: &Run<D>) -> Result<State<D>, Error> {
    let (packed, grid) = (stored.state(), *run.case.grid());
    let notes = &packed.notes;
    let field = phase_field(stored, "current", grid)?;
    let upload = |u: Stored<D>, phase_values: [f64; 2]| {
        let nodes = u.nodes().clone();
        DeviceField::upload(
            &Stored::new(u.into_values(), nodes, phase_values),
            &run.device,
        )
    };
    let fields: BTreeMap<String, Remembered> = read(stored, &notes["memory"]["fields"])?;
    let mut memory = Memory {
        fields: BTreeMap::new(),
        numbers: read(stored, &notes["memory"]["numbers"])?,
    };
    for (name, remembered) in fields {
        let grid = Grid::new(remembered.cells, grid.side())?.with_origin(grid.origin())?;
        let field = phase_field(stored, &in_memory(&name), grid)?;
        memory
            .fields
            .insert(name, upload(field, remembered.phase_values));
    }
    Ok(State {
        // As at the start, where nothing is stored.
        field: upload(field, run.state.field.phase_values()),
        step: usize::try_from(packed.step).map_err(|error| unreadable(stored, error))?,
        time: read(stored, &notes["time"])?,
        progress: read(stored, &notes["progress"])?,
        memory,
    })
}

/// Refuses a stored run of another case, and says in what it differs.
fn check_identity(stored: &StoredRun, wanted: &Value) -> Result<(), Error> {
    let found = &stored.state().notes["case"];
    if found == wanted {
        return Ok(());
    }
    if let Some(own) = own_parts(found, wanted) {
        return Err(refused(stored, own));
    }
    let keys = [wanted, found].into_iter().filter_map(Value::as_object);
    let keys: BTreeSet<&String> = keys.flat_map(|map| map.keys()).collect();
    let keys = keys.into_iter().filter(|key| found[key] != wanted[key]);
    let differing = keys.map(|key| format!("{key}: {} there, {} here", found[key], wanted[key]));
    let differing = differing.collect::<Vec<_>>().join("; ");
    let reason = format!("it is of another case ({differing}); start a new run in another folder");
    Err(refused(stored, reason))
}

/// What a stored run has of one's own that is not there now, by name.
fn own_parts(found: &Value, wanted: &Value) -> Option<String> {
    let names = |parts: &Value| -> Vec<String> {
        let name = |part: &Value| match part {
            Value::String(name) => name.clone(),
            part => part["name"]
                .as_str()
                .map_or_else(|| part.to_string(), str::to_owned),
        };
        match parts {
            Value::Null => Vec::new(),
            Value::Array(parts) => parts.iter().map(name).collect(),
            part => vec![name(part)],
        }
    };
    let kinds = [
        (
            "term of the energy",
            &found["own_terms"],
            &wanted["own_terms"],
        ),
        (
            "operator",
            &found["operator"]["own"],
            &wanted["operator"]["own"],
        ),
        ("scheme", &found["own_scheme"], &wanted["own_scheme"]),
        (
            "controller",
            &found["own_controller"],
            &wanted["own_controller"],
        ),
        ("stop rule", &found["own_stops"], &wanted["own_stops"]),
    ];
    kinds.into_iter().find_map(|(kind, found, wanted)| {
        let wanted = names(wanted);
        let missing = names(found).into_iter().find(|name| !wanted.contains(name))?;
        Some(format!(
            "it was made with the {kind} {missing:?}, which this program does not have; go on with the program that made it"
        ))
    })
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

fn phase_field<const D: usize>(
    stored: &StoredRun,
    name: &str,
    grid: Grid<D>,
) -> Result<Stored<D>, Error> {
    let array = |name: &str| stored.state().array(name);
    let nodes = match array(&bricks_of(name)) {
        Some(marks) => {
            let bricks = Bricks::with_marks(grid.cells(), marks);
            let bricks = bricks.map_err(|error| unreadable(stored, error))?;
            Nodes::on_bricks(grid, Arc::new(bricks))
        }
        None => grid.into(),
    };
    let field = Stored::from_values(nodes, array(name).unwrap_or_default().to_vec());
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
