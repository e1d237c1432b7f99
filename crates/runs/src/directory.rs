//! A run that is being computed.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use files::{Disk, FileSystem, make_folders_on};

use crate::checkpoint::{self, CheckpointState, Files};
use crate::digest::{self, Seal};
use crate::folder;
use crate::lock::Lock;
use crate::{Error, lock, names};

/// A run directory that this process works on. Dropping it gives the lock back; what was not
/// committed is then forgotten when the run is resumed.
///
/// All methods give [`Error::Invalid`] for what cannot be stored, which changes nothing, and
/// [`Error::Io`]. Names of files are `/`-separated and made of letters, digits, `.`, `-` and `_`.
#[derive(Debug)]
pub struct RunDirectory {
    pub(crate) path: PathBuf,
    pub(crate) file_system: Arc<dyn FileSystem>,
    pub(crate) files: Files,
    /// Of the checkpoints that are part of the run, the newest first.
    pub(crate) steps: Vec<u64>,
    pub(crate) _lock: Lock,
}

impl RunDirectory {
    /// Starts a run in a folder that does not exist or is empty: writes `files`, names and texts such
    /// as that of `config.toml`, and then the first checkpoint.
    ///
    /// A folder in which another process was killed while it started a run counts as empty. Anything
    /// else in it gives [`Error::Occupied`], and another process there [`Error::Locked`].
    pub fn create(
        path: impl Into<PathBuf>,
        files: &[(&str, &[u8])],
        state: &CheckpointState<'_>,
    ) -> Result<Self, Error> {
        Self::create_on(Arc::new(Disk), path, files, state)
    }

    /// [`RunDirectory::create`] on another file system than the disk itself.
    pub fn create_on(
        file_system: Arc<dyn FileSystem>,
        path: impl Into<PathBuf>,
        files: &[(&str, &[u8])],
        state: &CheckpointState<'_>,
    ) -> Result<Self, Error> {
        let path = path.into();
        state.check()?;
        let mut own = Files::new();
        for &(name, _) in files {
            names::check(name)?;
            own.insert(name.into(), None);
        }
        make_folders_on(&*file_system, &path)?;
        check_free(&path, &own)?;
        let lock = lock::lock(&*file_system, &path)?;
        // Again, now that nobody else starts a run here.
        check_free(&path, &own)?;
        for (left, _) in folder::list(&path)? {
            if !left.ends_with(names::LOCK) {
                (file_system.remove(&left)).map_err(files::Error::of("remove", left))?;
            }
        }
        make_folders_on(&*file_system, path.join(names::CHECKPOINTS))?;
        let mut run = Self {
            path,
            file_system,
            files: Files::new(),
            steps: Vec::new(),
            _lock: lock,
        };
        for (name, bytes) in files {
            run.write_file(name, bytes)?;
        }
        run.commit(state)?;
        Ok(run)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a file such as `fields/step-0010.vti` under a name that is new, or was [replaced](RunDirectory::replace_file) so far; folders
    /// are made. It belongs to the run from the next commit on, and never changes. After an error the name is free again.
    pub fn write_file(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.check_open(name)?;
        self.store(name, bytes)?;
        let seal = Seal::of(&self.path.join(name))?;
        self.files.insert(name.into(), Some(seal));
        Ok(())
    }

    /// Takes up a file that other code has written whole at [`path`](RunDirectory::path)`/name`, as
    /// [`RunDirectory::write_file`] would have. [`Error::Damaged`] if there is no such file.
    pub fn adopt_file(&mut self, name: &str) -> Result<(), Error> {
        self.check_open(name)?;
        let path = self.path.join(name);
        let (file, folder) = (digest::open(&path)?, path.parent().unwrap_or(&self.path));
        (self.file_system.sync_file(&file, &path))
            .and_then(|()| self.file_system.sync_folder(folder))
            .map_err(files::Error::of("flush to disk", &path))?;
        self.files.insert(name.into(), Some(Seal::of(&path)?));
        Ok(())
    }

    /// Writes or replaces a file that is no result, or not yet, such as wall times: a crash leaves an old one or the new one. It belongs
    /// to the run from the next commit on, and its content is not checked.
    pub fn replace_file(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.check_open(name)?;
        self.store(name, bytes)?;
        self.files.insert(name.into(), None);
        Ok(())
    }

    /// Removes the files of these names that do not belong to the run.
    pub fn remove_others(&self, which: impl Fn(&str) -> bool) -> Result<(), Error> {
        self.remove(|path| path.is_file() && which(&folder::name(&self.path, path)))
    }

    /// Removes those files and folders that `which` names and that are no part of the run.
    pub(crate) fn remove(&self, which: impl Fn(&Path) -> bool) -> Result<(), Error> {
        let others = folder::others(&self.path, &self.files, &self.steps)?;
        for path in others.into_iter().filter(|path| which(path)) {
            (self.file_system.remove(&path)).map_err(files::Error::of("remove", path))?;
        }
        Ok(())
    }

    /// Makes all that was written so far, and this state, what the run is resumed from. The last two
    /// checkpoints are kept.
    ///
    /// The same state may be committed again, for example on an interruption right after a commit.
    /// After [`Error::Io`] the directory is that of this commit or of the last one, and the run may go
    /// on or be opened again.
    pub fn commit(&mut self, state: &CheckpointState<'_>) -> Result<(), Error> {
        self.commit_as(state, false)
    }

    /// Commits the last state, marks the run as finished, and keeps this checkpoint alone.
    pub fn finish(mut self, state: &CheckpointState<'_>) -> Result<(), Error> {
        // Those in folders that were no part of the run when it was resumed.
        self.remove(folder::is_temporary)?;
        self.commit_as(state, true)
    }

    fn commit_as(&mut self, state: &CheckpointState<'_>, finished: bool) -> Result<(), Error> {
        state.check()?;
        let (last, step) = (self.steps.first().copied(), state.step);
        let repeats = || checkpoint::read(&self.path, step).map(|old| old.state == *state);
        if last > Some(step) || last == Some(step) && !repeats()? {
            return Err(state.refused("a commit is of a later step than the last, or repeats it"));
        }
        let path = self.path.join(names::checkpoint(step));
        files::write_atomically_on(&*self.file_system, path, |out| {
            checkpoint::write(out, finished, &self.files, state)
        })?;
        if last != Some(step) {
            self.steps.insert(0, step);
        }
        // Not before the new checkpoint is on the disk.
        let kept = checkpoint::kept(finished).min(self.steps.len());
        for old in self.steps.drain(kept..) {
            let path = self.path.join(names::checkpoint(old));
            (self.file_system.remove(&path)).map_err(files::Error::of("remove", path))?;
        }
        Ok(())
    }

    /// Accepts names of files that may still change.
    fn check_open(&self, name: &str) -> Result<(), Error> {
        names::check(name)?;
        if matches!(self.files.get(name), Some(Some(_))) {
            let reason = "the run has it already, and files are written once: choose another name";
            return Err(Error::file(name, reason));
        }
        Ok(())
    }

    fn store(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let path = self.path.join(name);
        make_folders_on(&*self.file_system, path.parent().unwrap_or(&self.path))?;
        let written =
            files::write_atomically_on(&*self.file_system, path, |out| out.write_all(bytes));
        Ok(written?)
    }
}

/// Accepts a folder in which there is nothing but what a process leaves that is killed while it
/// starts a run with these files.
fn check_free(path: &Path, files: &Files) -> Result<(), Error> {
    let other = if path.join(names::LOCK).is_file() {
        let others = folder::others(path, files, &[])?;
        others.into_iter().find(|path| !folder::is_temporary(path))
    } else {
        folder::list(path)?.pop().map(|(path, _)| path)
    };
    match other {
        None => Ok(()),
        Some(other) => Err(Error::Occupied {
            path: path.into(),
            found: other.file_name().unwrap_or_default().display().to_string(),
        }),
    }
}
