//! Finished runs that are kept on disk, so that they can be compared.

use std::path::{Path, PathBuf};
use std::time::Duration;

use geometry::measure::l2_distance;
use geometry::{Field, npy};
use operators::ComputeDevice;
use runs::{Error as RunsError, Interrupt, RunDirectory, StoredRun};
use serde_json::{Value, json};

use crate::record::Values;
use crate::store::{self, Checkpoints};
use crate::{Case, Error, Observer, Record, Run, Samples, Stop, Store};

/// One checkpoint a minute.
const CHECKPOINTS: Checkpoints = Checkpoints::Every(Duration::from_mins(1));

/// A finished run: the records of all steps, and the phase fields that were kept.
pub struct Trajectory<const D: usize> {
    /// The case that was run.
    pub case: Case<D>,
    /// The measures of the initial phase field.
    pub start: Values,
    /// The records of all minimizations, or of all steps of mean curvature flow.
    pub records: Vec<Record>,
    /// The stop rule that ended the run, perhaps in the middle of a step.
    pub ended: Stop,
    /// Whether all of it was made now: nothing was looked up, and nothing continued.
    pub is_new: bool,
    folder: PathBuf,
}

impl<const D: usize> Trajectory<D> {
    /// Runs a case, or continues it, or only looks up what is stored in `folder`; a folder with a stored run of another case, or of another
    /// version of its format, is replaced with all that is in it, one that holds anything but a run is refused. None if it was interrupted.
    pub fn of(
        case: Case<D>,
        device: &ComputeDevice,
        folder: &Path,
        samples: &Samples,
        observers: &mut [&mut dyn Observer<D>],
        interrupt: &Interrupt,
    ) -> Result<Option<Self>, Error> {
        let notes = json!({ "samples": samples });
        let (mut store, mut run) = match found(&case, device, folder, &notes)? {
            Some(stored) if stored.is_finished() => {
                let notes = &stored.state().notes;
                return Ok(Some(Self {
                    case,
                    start: store::read(&stored, &notes["start"])?,
                    records: store::records(&stored)?,
                    ended: store::read(&stored, &notes["ended"])?,
                    is_new: false,
                    folder: folder.to_owned(),
                }));
            }
            Some(stored) => Store::resume(stored, case, device, CHECKPOINTS)?,
            None => {
                let run = Run::new(case, device)?;
                (Store::create(folder, &[], &run, notes, CHECKPOINTS)?, run)
            }
        };
        let is_new = run.records().is_empty();
        let mut samples = samples.clone();
        let mut all: Vec<&mut dyn Observer<D>> = vec![&mut samples];
        for observer in observers {
            all.push(&mut **observer);
        }
        let Some(ended) = run.advance(Some(&mut store), &mut all, interrupt)? else {
            return Ok(None);
        };
        store.finish(&run)?;
        Ok(Some(Self {
            case: run.case,
            start: run.start,
            records: run.records,
            ended,
            is_new,
            folder: folder.to_owned(),
        }))
    }

    /// The phase field after a step, which must be one that was kept.
    pub fn field(&self, step: usize) -> Result<Field<D>, Error> {
        self.read(&Samples::name(step))
    }

    /// The phase field at the time `tau / 2^halvings` inside the first step, if it was to be kept and a substep ended there.
    pub fn part_field(&self, halvings: u32) -> Result<Option<Field<D>>, Error> {
        let name = Samples::part_name(halvings);
        if !self.folder.join(&name).exists() {
            return Ok(None);
        }
        self.read(&name).map(Some)
    }

    fn read(&self, name: &str) -> Result<Field<D>, Error> {
        let grid = *self.case.grid();
        Ok(npy::read(self.folder.join(name), |_| Ok(grid))?)
    }

    /// Time steps made, the one in whose middle the run became stationary included.
    pub fn steps(&self) -> usize {
        self.records.last().map_or(0, |last| last.step)
    }

    /// The records of a time step, counted from 1; none if it was not made.
    pub fn substeps(&self, step: usize) -> &[Record] {
        let end = |step: usize| self.records.partition_point(|record| record.step <= step);
        &self.records[end(step.saturating_sub(1))..end(step)]
    }

    /// The record at the end of a time step, counted from 1.
    pub fn record(&self, step: usize) -> Option<&Record> {
        self.substeps(step).last()
    }

    /// The measures after a time step, those of the initial phase field for 0; none if it was not made.
    pub fn measures(&self, step: usize) -> Option<&Values> {
        match step {
            0 => Some(&self.start),
            _ => self.record(step).map(|record| &record.measures),
        }
    }

    /// Wall time of all steps in seconds, interruptions left out; not a number if some of it is lost.
    pub fn seconds(&self) -> f64 {
        self.records.iter().map(|record| record.seconds).sum()
    }

    /// `L2` distance to the phase field of a run at a multiple of the resolution after `there` of its steps, in the nodes of this grid: the
    /// finer phase field is sampled there.
    ///
    /// # Errors
    /// [`Error::Incomparable`] if the nodes of this grid are not among those of the other.
    pub fn distance(&self, step: usize, other: &Self, there: usize) -> Result<f64, Error> {
        let (own, fine) = (*self.case.grid(), *other.case.grid());
        let in_place = own.side().to_bits() == fine.side().to_bits()
            && own.origin().map(f64::to_bits) == fine.origin().map(f64::to_bits);
        if !in_place || !fine.cells().is_multiple_of(own.cells()) {
            return Err(Error::Incomparable {
                cells: own.cells(),
                reference: fine.cells(),
            });
        }
        let sampled = other.field(there)?.thinned(fine.cells() / own.cells())?;
        Ok(l2_distance(&self.field(step)?, &sampled)?)
    }
}

/// The stored run of a case, if there is one to go on from. A run of another case or format, or one that is damaged beyond its checkpoints, is removed
/// with its folder: it can be computed again.
fn found<const D: usize>(
    case: &Case<D>,
    device: &ComputeDevice,
    folder: &Path,
    notes: &Value,
) -> Result<Option<StoredRun>, Error> {
    let stored = match RunDirectory::open(folder) {
        Err(RunsError::Damaged { .. }) => RunDirectory::recover(folder),
        result => result,
    };
    match stored {
        Ok(stored) => {
            let kept = &stored.state().notes;
            if kept["application"] == *notes && kept["case"] == case.identity(device) {
                return Ok(Some(stored));
            }
        }
        Err(RunsError::NoRun(_)) => return Ok(None),
        Err(error @ (RunsError::Locked(_) | RunsError::Io(_))) => return Err(error.into()),
        Err(_) => {}
    }
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(RunsError::from(files::Error::of("remove", folder)(error)).into())
        }
        _ => Ok(None),
    }
}
