//! A run as it is found on the disk.

use std::collections::HashSet;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use files::{Disk, Storage};
use serde_json::Value;
use sha2::Digest;

use crate::directory::{write_index, write_timings};
use crate::index::{Commit, Entry, Extent, Index};
use crate::lock::Lock;
use crate::metrics::Metrics;
use crate::{Checkpoint, Damage, Error, Identity, RunDirectory, State, digest, lock, names, seal};

/// A run that has been opened and checked, and not yet changed. It is locked until dropped.
#[derive(Debug)]
pub struct StoredRun {
    path: PathBuf,
    storage: Arc<dyn Storage>,
    lock: Lock,
    index: Index,
    checkpoint: Option<Checkpoint>,
    timings: Value,
    /// Whether the index or the timings have to be replaced by those above.
    given_up: bool,
    leftovers: Vec<Leftover>,
}

/// What a killed process has left beside the files of the run.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Leftover {
    path: PathBuf,
    is_folder: bool,
}

/// A run ready to go on.
#[derive(Debug)]
pub struct Resumed {
    /// Where it goes on.
    pub run: RunDirectory,
    /// What it goes on from; None to begin with the first step.
    pub state: Option<State>,
    /// Files and folders that were removed: they came after the commit that is resumed.
    pub removed: Vec<PathBuf>,
    /// Bytes that were cut off `metrics.csv`, likewise.
    pub removed_metrics: u64,
}

impl RunDirectory {
    /// Opens a run and checks every file of it; nothing is changed.
    ///
    /// # Errors
    /// [`Error::NoRun`], [`Error::Locked`], [`Error::Version`], [`Error::Io`]; and
    /// [`Error::Damaged`] with the file, and the step from which [`RunDirectory::recover`] would go
    /// on.
    pub fn open(path: impl Into<PathBuf>) -> Result<StoredRun, Error> {
        Self::open_on(Arc::new(Disk), path)
    }

    /// [`RunDirectory::open`] on another storage than the disk itself.
    ///
    /// # Errors
    /// As [`RunDirectory::open`].
    pub fn open_on(
        storage: Arc<dyn Storage>,
        path: impl Into<PathBuf>,
    ) -> Result<StoredRun, Error> {
        let path = path.into();
        let (lock, index) = lock_and_read(&*storage, &path)?;
        let checked = || {
            let newest = index.newest();
            check_files(&path, &index, newest)?;
            for commit in &index.commits {
                check_checkpoint(&path, commit)?;
            }
            let checkpoint = read_checkpoint(&path, &index, newest)?;
            Ok((checkpoint, read_timings(&path)?))
        };
        let (checkpoint, timings) = checked().map_err(|e| match e {
            Error::Damaged {
                path: file, damage, ..
            } => Error::Damaged {
                path: file,
                damage,
                fallback: intact(&path, &index).map(|(commit, _)| commit.step),
            },
            other => other,
        })?;
        StoredRun::new(path, storage, lock, index, checkpoint, timings)
    }

    /// Opens a damaged run at the newest commit all of whose files are intact: the last one if
    /// only the checkpoint before it or the timings are damaged, else the one before it. What
    /// came later is given up when the run is resumed, and computed again to the same bits.
    ///
    /// # Errors
    /// As [`RunDirectory::open`] if no commit is intact.
    pub fn recover(path: impl Into<PathBuf>) -> Result<StoredRun, Error> {
        Self::recover_on(Arc::new(Disk), path)
    }

    /// [`RunDirectory::recover`] on another storage than the disk itself.
    ///
    /// # Errors
    /// As [`RunDirectory::recover`].
    pub fn recover_on(
        storage: Arc<dyn Storage>,
        path: impl Into<PathBuf>,
    ) -> Result<StoredRun, Error> {
        let path = path.into();
        match Self::open_on(storage.clone(), path.clone()) {
            Err(Error::Damaged {
                fallback: Some(_), ..
            }) => {}
            result => return result,
        }
        let (lock, index) = lock_and_read(&*storage, &path)?;
        let Some((commit, checkpoint)) = intact(&path, &index) else {
            // Damaged further since a moment ago.
            return Self::open_on(storage, path);
        };
        let index = index.only(commit);
        let timings = read_timings(&path).unwrap_or(Value::Null);
        let mut run = StoredRun::new(path, storage, lock, index, checkpoint, timings)?;
        run.given_up = true;
        Ok(run)
    }
}

impl StoredRun {
    fn new(
        path: PathBuf,
        storage: Arc<dyn Storage>,
        lock: Lock,
        index: Index,
        checkpoint: Option<Checkpoint>,
        timings: Value,
    ) -> Result<Self, Error> {
        let leftovers = find_leftovers(&path, &index)?;
        Ok(Self {
            path,
            storage,
            lock,
            index,
            checkpoint,
            timings,
            given_up: false,
            leftovers,
        })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the run belongs to.
    pub fn identity(&self) -> &Identity {
        &self.index.identity
    }

    /// Whether the run is complete.
    pub fn is_finished(&self) -> bool {
        self.index.finished
    }

    /// The newest checkpoint, if there is one.
    pub fn checkpoint(&self) -> Option<&Checkpoint> {
        self.checkpoint.as_ref()
    }

    /// The names of the files of the run in the order in which they were written, without the
    /// checkpoints, `metrics.csv` and `timings.json`.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        self.index.files.iter().map(|entry| entry.name.as_str())
    }

    /// The text of `config.toml`.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Damaged`].
    pub fn config(&self) -> Result<String, Error> {
        self.text(names::CONFIG)
    }

    /// The content of `manifest.json`.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Damaged`].
    pub fn manifest(&self) -> Result<Value, Error> {
        serde_json::from_str(&self.text(names::MANIFEST)?).map_err(|e| {
            Error::damaged(
                self.path.join(names::MANIFEST),
                Damage::json("its content", &e),
            )
        })
    }

    fn text(&self, name: &str) -> Result<String, Error> {
        let path = self.path.join(name);
        fs::read_to_string(&path).map_err(Error::io("read", path))
    }

    /// What was last given to [`RunDirectory::write_timings`], null if nothing was.
    pub fn timings(&self) -> &Value {
        &self.timings
    }

    /// Files and folders that are not part of the run, left by a process that was killed; those that
    /// [`StoredRun::resume`] removes.
    pub fn leftovers(&self) -> impl Iterator<Item = &Path> {
        self.leftovers.iter().map(|left| left.path.as_path())
    }

    /// Removes the leftovers alone, for example of a run that is finished.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_leftovers(&mut self) -> Result<Vec<PathBuf>, Error> {
        self.replace_what_is_given_up()?;
        let mut removed = Vec::new();
        // From the back, so that folders are empty when their turn comes.
        while let Some(left) = self.leftovers.last() {
            if left.is_folder {
                self.storage.remove_folder(&left.path)
            } else {
                self.storage.remove_file(&left.path)
            }
            .map_err(Error::io("remove", &left.path))?;
            removed.extend(self.leftovers.pop().map(|left| left.path));
        }
        removed.reverse();
        Ok(removed)
    }

    /// Goes on with the run: removes everything that is not part of the last commit.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if the run was made with something else than `identity`, and
    /// [`Error::Finished`]; both change nothing. [`Error::Io`], [`Error::Write`].
    pub fn resume(mut self, identity: &Identity) -> Result<Resumed, Error> {
        self.identity().require(identity, &self.path)?;
        if self.is_finished() {
            return Err(Error::Finished { path: self.path });
        }
        let removed = self.remove_leftovers()?;
        let length = self.index.newest().metrics.length;
        let metrics = self.path.join(names::METRICS);
        let (metrics, removed_metrics) = Metrics::resume(&*self.storage, metrics, length)?;
        let run = RunDirectory {
            path: self.path,
            storage: self.storage,
            identity: identity.clone(),
            pending: Vec::new(),
            written: self.index.files.iter().map(|e| e.name.clone()).collect(),
            index: self.index,
            metrics,
            broken: false,
            _lock: self.lock,
        };
        Ok(Resumed {
            run,
            state: self.checkpoint.map(|checkpoint| checkpoint.state),
            removed,
            removed_metrics,
        })
    }

    /// After this, no index names a file that is about to be removed.
    fn replace_what_is_given_up(&mut self) -> Result<(), Error> {
        if self.given_up {
            write_index(&*self.storage, &self.path, &self.index)?;
            write_timings(&*self.storage, &self.path, &self.timings)?;
            self.given_up = false;
        }
        Ok(())
    }
}

impl fmt::Display for StoredRun {
    /// One line for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let step = self.index.newest().step;
        let kind = &self.index.identity.kind;
        let state = if self.index.finished {
            "finished"
        } else {
            "not finished"
        };
        write!(
            f,
            "{kind} at step {step}, {state}, {} files",
            self.index.files.len()
        )
    }
}

fn lock_and_read(storage: &dyn Storage, folder: &Path) -> Result<(Lock, Index), Error> {
    let path = folder.join(names::INDEX);
    if path.symlink_metadata().is_err() {
        // Before there is a lock file in somebody's folder.
        return Err(Error::NoRun {
            path: folder.into(),
        });
    }
    let lock = lock::lock(storage, folder)?;
    Ok((lock, Index::read(&path)?))
}

/// The newest commit that can be resumed.
fn intact<'a>(folder: &Path, index: &'a Index) -> Option<(&'a Commit, Option<Checkpoint>)> {
    index.commits.iter().rev().find_map(|commit| {
        check_files(folder, index, commit).ok()?;
        check_checkpoint(folder, commit).ok()?;
        Some((commit, read_checkpoint(folder, index, commit).ok()?))
    })
}

fn check_files(folder: &Path, index: &Index, commit: &Commit) -> Result<(), Error> {
    for entry in &index.files[..commit.files] {
        check_entry(folder, entry)?;
    }
    check_prefix(&folder.join(names::METRICS), &commit.metrics)
}

fn check_checkpoint(folder: &Path, commit: &Commit) -> Result<(), Error> {
    match &commit.checkpoint {
        Some(entry) => check_entry(folder, entry),
        None => Ok(()),
    }
}

/// The checkpoint of a commit, if it has one; not only is its file as it was written, but it is one
/// of this run.
fn read_checkpoint(
    folder: &Path,
    index: &Index,
    commit: &Commit,
) -> Result<Option<Checkpoint>, Error> {
    let Some(entry) = &commit.checkpoint else {
        return Ok(None);
    };
    let path = folder.join(&entry.name);
    let checkpoint = Checkpoint::read(&path)?;
    checkpoint.identity.require(&index.identity, &path)?;
    if checkpoint.state.step != commit.step {
        let step = checkpoint.state.step;
        let damage = Damage::Content(format!("it is of step {step}, not {}", commit.step));
        return Err(Error::damaged(path, damage));
    }
    Ok(Some(checkpoint))
}

fn read_timings(folder: &Path) -> Result<Value, Error> {
    let path = folder.join(names::TIMINGS);
    seal::unseal(&digest::read_small(&path, seal::MAX_TIMINGS)?, &path)
}

fn check_entry(folder: &Path, entry: &Entry) -> Result<(), Error> {
    let path = folder.join(&entry.name);
    let (_, found) = digest::open(&path)?;
    let expected = entry.length;
    if found != expected {
        return Err(Error::damaged(path, Damage::Length { found, expected }));
    }
    let extent = Extent {
        length: entry.length,
        sha256: entry.sha256.clone(),
    };
    check_prefix(&path, &extent)
}

fn check_prefix(path: &Path, extent: &Extent) -> Result<(), Error> {
    let (file, _) = digest::open(path)?;
    let (hash, found) = digest::hash_prefix(file, extent.length, path)?;
    if found != extent.length {
        let expected = extent.length;
        return Err(Error::damaged(path, Damage::Length { found, expected }));
    }
    if digest::hex(hash.finalize()) == extent.sha256 {
        Ok(())
    } else {
        Err(Error::damaged(path, Damage::Checksum))
    }
}

/// Everything in the folder that the index does not list, folders before what is in them.
fn find_leftovers(folder: &Path, index: &Index) -> Result<Vec<Leftover>, Error> {
    let checkpoints = index.commits.iter().filter_map(|c| c.checkpoint.as_ref());
    let listed: HashSet<PathBuf> = index
        .files
        .iter()
        .chain(checkpoints)
        .map(|entry| entry.name.as_str())
        .chain([names::INDEX, names::LOCK, names::METRICS, names::TIMINGS])
        .map(|name| folder.join(name))
        .collect();
    let needed: HashSet<PathBuf> = listed
        .iter()
        .flat_map(|file| file.ancestors().skip(1).map(Path::to_owned))
        .chain(names::FOLDERS.map(|name| folder.join(name)))
        .collect();
    let mut leftovers = Vec::new();
    let mut to_visit = vec![folder.to_owned()];
    while let Some(current) = to_visit.pop() {
        let failed = |source| Error::io("list", &current)(source);
        for entry in fs::read_dir(&current).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let path = entry.path();
            // Links are not followed: they are no folders here.
            let is_folder = entry.file_type().map_err(failed)?.is_dir();
            if is_folder {
                to_visit.push(path.clone());
            }
            let part = if is_folder {
                needed.contains(&path)
            } else {
                listed.contains(&path)
            };
            if !part {
                leftovers.push(Leftover { path, is_folder });
            }
        }
    }
    leftovers.sort();
    Ok(leftovers)
}
