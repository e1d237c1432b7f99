//! A run as it is found on the disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use files::{Disk, FileSystem};

use crate::checkpoint::{self, CheckpointState, Commit};
use crate::digest::{self, Seal};
use crate::{Error, RunDirectory, folder, lock, names};

/// A run that has been opened and checked, and not yet changed. It is locked until dropped.
#[derive(Debug)]
pub struct StoredRun {
    run: RunDirectory,
    state: CheckpointState<'static>,
    finished: bool,
    leftovers: Vec<PathBuf>,
}

impl RunDirectory {
    /// Opens a run and checks every file of it; nothing is changed.
    ///
    /// [`Error::NoRun`], [`Error::Locked`], [`Error::Version`], [`Error::Io`]; and
    /// [`Error::Damaged`] with the file, and the step from which [`RunDirectory::recover`] would go
    /// on.
    pub fn open(path: impl Into<PathBuf>) -> Result<StoredRun, Error> {
        StoredRun::find_on(Arc::new(Disk), path, false)
    }

    /// Opens a damaged run at the newest commit all of whose files are intact: the last one if
    /// only the checkpoint before it is damaged, else the one before it. What
    /// came later is given up when the run is resumed, and computed again to the same bits. As
    /// [`RunDirectory::open`] if no commit is intact.
    pub fn recover(path: impl Into<PathBuf>) -> Result<StoredRun, Error> {
        StoredRun::find_on(Arc::new(Disk), path, true)
    }
}

impl StoredRun {
    /// [`RunDirectory::open`], or [`RunDirectory::recover`], on another file system than the disk itself.
    pub fn find_on(
        file_system: Arc<dyn FileSystem>,
        path: impl Into<PathBuf>,
        recover: bool,
    ) -> Result<Self, Error> {
        let path = path.into();
        // Before there is a lock file in somebody's folder.
        commits(&path)?;
        let lock = lock::lock(&*file_system, &path)?;
        let mut steps = commits(&path)?;
        let mut checked = check(&path, &mut steps);
        if let Err(Error::Damaged { fallback, .. }) = &mut checked {
            let intact = steps.iter().find_map(|&step| intact(&path, step).ok());
            *fallback = intact.as_ref().map(|commit| commit.state.step);
            if let Some(intact) = intact.filter(|_| recover) {
                steps = vec![intact.state.step];
                checked = Ok(intact);
            }
        }
        let Commit {
            finished,
            files,
            state,
        } = checked?;
        Ok(Self {
            leftovers: folder::others(&path, &files, &steps)?,
            finished,
            run: RunDirectory {
                path,
                file_system,
                files,
                steps,
                _lock: lock,
            },
            state,
        })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.run.path
    }

    /// The state of the commit.
    pub fn state(&self) -> &CheckpointState<'static> {
        &self.state
    }

    /// Whether the run is complete.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// The names of the files of the run in alphabetical order, without the checkpoints.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        self.run.files.keys().map(String::as_str)
    }

    /// One of the [files](StoredRun::files) of the run; [`Error::Invalid`] if it is none.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, Error> {
        if !self.run.files.contains_key(name) {
            return Err(Error::Invalid(format!("the run has no file {name:?}")));
        }
        digest::read(&self.run.path.join(name))
    }

    /// Such a file as text.
    pub fn read_text(&self, name: &str) -> Result<String, Error> {
        let text = String::from_utf8(self.read(name)?);
        text.map_err(|error| Error::damaged(self.run.path.join(name), error.to_string()))
    }

    /// Files and folders that are not part of the run: left by a process that was killed, or somebody else's.
    pub fn leftovers(&self) -> impl Iterator<Item = &Path> {
        self.leftovers.iter().map(PathBuf::as_path)
    }

    /// Removes old checkpoints and temporary files, which a process that was killed has left, and nothing else.
    pub fn tidy(&self) -> Result<(), Error> {
        // First the commit becomes the last one: after that, no checkpoint lists a file that is about to be removed.
        let checkpoints = self.run.path.join(names::CHECKPOINTS);
        let is_commit = |path: &Path| names::step(&folder::name(&self.run.path, path)).is_some();
        self.run.remove(is_commit)?;
        let flushed = self.run.file_system.sync_folder(&checkpoints);
        flushed.map_err(files::Error::of("flush", checkpoints))?;
        self.run.remove(folder::is_temporary)
    }

    /// Goes on with the run, also with a finished one. [Leftovers](StoredRun::leftovers) stay until files of the same names are written, but
    /// for those that are [tidied](StoredRun::tidy) away.
    pub fn resume(self) -> Result<(RunDirectory, CheckpointState<'static>), Error> {
        self.tidy()?;
        Ok((self.run, self.state))
    }

    /// Goes on with a run by a commit of `state`, of the same step. After it the files that `ends` names do not belong to the run any
    /// more; they stay until [`RunDirectory::remove_others`]. Those that `changes` names still do, and may be
    /// [replaced](RunDirectory::replace_file).
    pub fn reopen(
        self,
        state: &CheckpointState<'_>,
        ends: impl Fn(&str) -> bool,
        changes: impl Fn(&str) -> bool,
    ) -> Result<RunDirectory, Error> {
        let (mut run, _) = self.resume()?;
        run.files.retain(|name, _| !ends(name));
        for (name, seal) in &mut run.files {
            if changes(name) {
                *seal = None;
            }
        }
        // The commits that there are give way to this one.
        let mut others = std::mem::take(&mut run.steps);
        run.commit(state)?;
        others.retain(|&step| step != state.step);
        for other in others {
            let path = run.path.join(names::checkpoint(other));
            (run.file_system.remove(&path)).map_err(files::Error::of("remove", path))?;
        }
        Ok(run)
    }
}

/// The steps of the commits in a folder, the newest first, and at least one.
fn commits(folder: &Path) -> Result<Vec<u64>, Error> {
    let steps = folder::steps(folder)?;
    let old = folder.join("index.json");
    if !steps.is_empty() {
        Ok(steps)
    } else if old.is_file() {
        // A run from before checkpoints were commits.
        Err(checkpoint::other_version(old, 1))
    } else {
        Err(Error::NoRun(folder.into()))
    }
}

/// Checks everything. Of the steps, those are left whose checkpoints are part of the run.
fn check(folder: &Path, steps: &mut Vec<u64>) -> Result<Commit, Error> {
    let newest = intact(folder, steps[0])?;
    let kept = checkpoint::kept(newest.finished);
    for &older in steps[1..].iter().take(kept - 1) {
        checkpoint::content(folder, older)?;
    }
    steps.truncate(kept);
    Ok(newest)
}

/// A checkpoint all of whose files are as they were written.
fn intact(folder: &Path, step: u64) -> Result<Commit, Error> {
    let commit = checkpoint::read(folder, step)?;
    for (name, seal) in &commit.files {
        let path = folder.join(name);
        if let Some(seal) = seal
            && Seal::of(&path)? != *seal
        {
            return Err(digest::wrong_checksum(&path));
        }
    }
    Ok(commit)
}
