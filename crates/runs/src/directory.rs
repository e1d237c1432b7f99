//! A run that is being computed.

use std::collections::HashSet;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use files::{Disk, Storage, TEMPORARY_PREFIX};
use serde::Serialize;
use serde_json::Value;
use sha2::Digest;

use crate::checkpoint::{self, State};
use crate::digest::{self, Hashing};
use crate::index::{Commit, Entry, Index};
use crate::lock::Lock;
use crate::metrics::Metrics;
use crate::{Error, Identity, index, lock, names, seal};

/// A run directory that this process works on. Dropping it gives the lock back; what was not
/// committed is then forgotten when the run is resumed.
#[derive(Debug)]
pub struct RunDirectory {
    pub(crate) path: PathBuf,
    pub(crate) storage: Arc<dyn Storage>,
    pub(crate) identity: Identity,
    /// As it is on the disk.
    pub(crate) index: Index,
    /// Files since the last commit.
    pub(crate) pending: Vec<Entry>,
    pub(crate) written: HashSet<String>,
    pub(crate) metrics: Metrics,
    pub(crate) broken: bool,
    pub(crate) _lock: Lock,
}

impl RunDirectory {
    /// Starts a run in a folder that does not exist or is empty.
    ///
    /// `manifest` is what was asked for and becomes `manifest.json`; it should hold no times (see
    /// [`RunDirectory::write_timings`]) where runs are to be compared. `config` becomes `config.toml`.
    ///
    /// A folder in which another process was killed while it started a run counts as empty.
    ///
    /// # Errors
    /// [`Error::Occupied`] if there is anything in the folder, [`Error::Locked`] if somebody else is
    /// starting a run there, [`Error::Io`] and [`Error::Write`].
    pub fn create(
        path: impl Into<PathBuf>,
        identity: &Identity,
        manifest: &Value,
        config: &str,
    ) -> Result<Self, Error> {
        Self::create_on(Arc::new(Disk), path, identity, manifest, config)
    }

    /// [`RunDirectory::create`] on another storage than the disk itself.
    ///
    /// # Errors
    /// As [`RunDirectory::create`].
    pub fn create_on(
        storage: Arc<dyn Storage>,
        path: impl Into<PathBuf>,
        identity: &Identity,
        manifest: &Value,
        config: &str,
    ) -> Result<Self, Error> {
        let path = path.into();
        // What could not be read back is refused before anything is there.
        checkpoint::start(identity, &State::new(0, 0.0))?;
        create_folders(&*storage, &path)?;
        left_by_a_start(&path)?;
        let lock = lock::lock(&*storage, &path)?;
        // Again, now that nobody else starts a run here.
        for (left, is_folder) in left_by_a_start(&path)? {
            if is_folder {
                storage.remove_folder(&left)
            } else {
                storage.remove_file(&left)
            }
            .map_err(Error::io("remove", left))?;
        }
        for folder in names::FOLDERS {
            make_folder(&*storage, &path.join(folder))?;
        }
        let metrics = Metrics::create(&*storage, path.join(names::METRICS))?;
        let first = Commit {
            step: 0,
            checkpoint: None,
            metrics: metrics.extent(),
            files: 0,
        };
        let mut run = Self {
            path,
            storage,
            identity: identity.clone(),
            index: Index {
                format: index::FORMAT,
                finished: false,
                identity: identity.clone(),
                commits: vec![first],
                files: Vec::new(),
            },
            pending: Vec::new(),
            written: HashSet::new(),
            metrics,
            broken: false,
            _lock: lock,
        };
        let mut text = serde_json::to_string_pretty(manifest).map_err(|source| Error::Json {
            what: "the manifest",
            source,
        })?;
        text.push('\n');
        run.store(names::MANIFEST, |out| out.write_all(text.as_bytes()))?;
        run.store(names::CONFIG, |out| out.write_all(config.as_bytes()))?;
        run.write_timings(&Value::Null)?;
        let mut index = run.index.clone();
        index.files.append(&mut run.pending);
        index.commits[0].files = index.files.len();
        run.swap(index)?;
        Ok(run)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The step of the last commit; 0 before the first.
    pub fn committed_step(&self) -> u64 {
        self.index.newest().step
    }

    /// Appends a row to `metrics.csv`. Rows are structs, all with the same names of fields.
    ///
    /// # Errors
    /// [`Error::Columns`], [`Error::Row`], [`Error::Io`], [`Error::Broken`].
    pub fn metric(&mut self, row: &impl Serialize) -> Result<(), Error> {
        self.usable()?;
        let bytes = self.metrics.encode(row)?;
        let appended = self.metrics.append(&*self.storage, &bytes);
        // Half a row may be there, which only the next start removes.
        self.broken |= appended.is_err();
        appended
    }

    /// Writes a file under a new name such as `fields/step-0010.vti`; folders are made. It belongs to
    /// the run from the next commit on.
    ///
    /// After an error the name is free again.
    ///
    /// # Errors
    /// [`Error::Name`] for names that are reserved or not made of letters, digits, `.`, `-`, `_` and
    /// `/`; [`Error::Exists`], [`Error::Write`], [`Error::Io`], [`Error::Broken`].
    pub fn write_file(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<PathBuf, Error> {
        self.check_new(name)?;
        self.make_parents(name)?;
        self.store(name, write)?;
        Ok(self.path.join(name))
    }

    /// Takes up a file that other code has written whole at [`path`](RunDirectory::path)`/name`, as
    /// [`RunDirectory::write_file`] would have; make the folder with
    /// [`RunDirectory::make_folder`].
    ///
    /// # Errors
    /// As [`RunDirectory::write_file`], and [`Error::Damaged`] if there is no such file.
    pub fn adopt_file(&mut self, name: &str) -> Result<(), Error> {
        self.check_new(name)?;
        let path = self.path.join(name);
        let (file, length) = digest::open(&path)?;
        self.storage
            .sync_file(&file, &path)
            .map_err(Error::io("flush to disk", &path))?;
        let (hash, length) = digest::hash_prefix(file, length, &path)?;
        let folder = path.parent().unwrap_or(&self.path);
        self.storage
            .sync_folder(folder)
            .map_err(Error::io("flush to disk", folder))?;
        self.written.insert(name.into());
        self.pending.push(Entry {
            name: name.into(),
            length,
            sha256: digest::hex(hash.finalize()),
        });
        Ok(())
    }

    /// Makes a folder in the run directory, unless it exists, and returns its path.
    ///
    /// # Errors
    /// [`Error::Name`], [`Error::Io`], [`Error::Broken`].
    pub fn make_folder(&mut self, name: &str) -> Result<PathBuf, Error> {
        self.usable()?;
        names::check_free(name)?;
        self.make_parents(name)?;
        let path = self.path.join(name);
        make_folder(&*self.storage, &path)?;
        Ok(path)
    }

    /// Replaces `timings.json`, the one file that may differ between two runs of the same
    /// computation: wall times and the like. It stands outside of the commits, and a crash
    /// leaves the old one or the new one.
    ///
    /// # Errors
    /// [`Error::Json`], [`Error::Write`], [`Error::Broken`].
    pub fn write_timings(&mut self, timings: &Value) -> Result<(), Error> {
        self.usable()?;
        write_timings(&*self.storage, &self.path, timings)
    }

    /// Makes all that was written so far, and this state, what the run is resumed from. The last two
    /// checkpoints are kept.
    ///
    /// The same state may be committed again, for example on an interruption right after a commit.
    ///
    /// # Errors
    /// [`Error::State`] and [`Error::Order`], which change nothing. After [`Error::Write`] or
    /// [`Error::Io`] the directory is that of this commit or of the last one, and has to be opened
    /// again: all further calls give [`Error::Broken`].
    pub fn commit(&mut self, state: &State) -> Result<(), Error> {
        self.commit_as(state, false)
    }

    /// Commits the last state, marks the run as finished, and keeps this checkpoint alone.
    ///
    /// # Errors
    /// As [`RunDirectory::commit`].
    pub fn finish(mut self, state: &State) -> Result<(), Error> {
        self.commit_as(state, true)
    }

    fn commit_as(&mut self, state: &State, finished: bool) -> Result<(), Error> {
        self.usable()?;
        let start = checkpoint::start(&self.identity, state)?;
        let repeated = self.repeated(&start, state)?;
        let done = self.try_commit(&start, state, repeated, finished);
        self.broken = done.is_err();
        done
    }

    /// The last checkpoint if it is of this very state.
    fn repeated(&self, start: &[u8], state: &State) -> Result<Option<Entry>, Error> {
        let newest = self.index.newest();
        let refused = Err(Error::Order {
            step: state.step,
            last: newest.step,
        });
        match &newest.checkpoint {
            _ if state.step < newest.step => refused,
            Some(entry) if state.step == newest.step => {
                let mut out = Hashing::new(io::sink());
                checkpoint::write(&mut out, start, state)
                    .map_err(Error::io("encode", &self.path))?;
                if digest::hex(out.hash.finalize()) == entry.sha256 {
                    Ok(Some(entry.clone()))
                } else {
                    refused
                }
            }
            _ => Ok(None),
        }
    }

    fn try_commit(
        &mut self,
        start: &[u8],
        state: &State,
        repeated: Option<Entry>,
        finished: bool,
    ) -> Result<(), Error> {
        let again = repeated.is_some();
        let entry = match repeated {
            Some(entry) => entry,
            None => write_hashed(
                &*self.storage,
                &self.path,
                &names::checkpoint(state.step),
                |out| checkpoint::write(out, start, state),
            )?,
        };
        let mut index = self.index.clone();
        index.finished = finished;
        index.identity = self.identity.clone();
        index.files.extend_from_slice(&self.pending);
        if again {
            index.commits.pop();
        }
        index.commits.push(Commit {
            step: state.step,
            checkpoint: Some(entry),
            metrics: self.metrics.sync(&*self.storage)?,
            files: index.files.len(),
        });
        let keep = if finished { 1 } else { 2 };
        let surplus = index.commits.len().saturating_sub(keep);
        let dropped: Vec<Commit> = index.commits.drain(..surplus).collect();
        self.swap(index)?;
        self.pending.clear();
        // Not before the new index is on the disk: the old one needs them.
        for old in dropped.into_iter().filter_map(|commit| commit.checkpoint) {
            let path = self.path.join(old.name);
            self.storage
                .remove_file(&path)
                .map_err(Error::io("remove", path))?;
        }
        Ok(())
    }

    /// The commit point.
    pub(crate) fn swap(&mut self, index: Index) -> Result<(), Error> {
        write_index(&*self.storage, &self.path, &index)?;
        self.index = index;
        Ok(())
    }

    fn store(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Error> {
        let entry = write_hashed(&*self.storage, &self.path, name, write)?;
        self.written.insert(entry.name.clone());
        self.pending.push(entry);
        Ok(())
    }

    fn usable(&self) -> Result<(), Error> {
        if self.broken {
            Err(Error::Broken {
                path: self.path.clone(),
            })
        } else {
            Ok(())
        }
    }

    fn check_new(&self, name: &str) -> Result<(), Error> {
        self.usable()?;
        names::check_free(name)?;
        if self.written.contains(name) {
            Err(Error::Exists { name: name.into() })
        } else {
            Ok(())
        }
    }

    fn make_parents(&self, name: &str) -> Result<(), Error> {
        for (end, _) in name.match_indices('/') {
            make_folder(&*self.storage, &self.path.join(&name[..end]))?;
        }
        Ok(())
    }
}

pub(crate) fn write_index(
    storage: &dyn Storage,
    folder: &Path,
    index: &Index,
) -> Result<(), Error> {
    let text = seal::seal("the index", index, index::MAX_LENGTH)?;
    write_text(storage, folder.join(names::INDEX), &text)
}

pub(crate) fn write_timings(
    storage: &dyn Storage,
    folder: &Path,
    timings: &Value,
) -> Result<(), Error> {
    let text = seal::seal("the timings", timings, seal::MAX_TIMINGS)?;
    write_text(storage, folder.join(names::TIMINGS), &text)
}

fn write_text(storage: &dyn Storage, path: PathBuf, text: &str) -> Result<(), Error> {
    files::write_atomically_on(storage, path, |out| out.write_all(text.as_bytes()))?;
    Ok(())
}

fn write_hashed(
    storage: &dyn Storage,
    folder: &Path,
    name: &str,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Entry, Error> {
    let mut hashed = None;
    files::write_atomically_on(storage, folder.join(name), |out| {
        let mut out = Hashing::new(out);
        write(&mut out)?;
        hashed = Some((out.hash, out.length));
        Ok(())
    })?;
    let (hash, length) = hashed.expect("the file was written");
    Ok(Entry {
        name: name.into(),
        length,
        sha256: digest::hex(hash.finalize()),
    })
}

/// Makes a folder that lasts, unless it exists.
fn make_folder(storage: &dyn Storage, path: &Path) -> Result<(), Error> {
    match storage.create_folder(path) {
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => return Ok(()),
        result => result.map_err(Error::io("create the folder", path))?,
    }
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => storage.sync_folder(parent),
        _ => storage.sync_folder(Path::new(".")),
    }
    .map_err(Error::io("flush the folder of", path))
}

fn create_folders(storage: &dyn Storage, path: &Path) -> Result<(), Error> {
    let mut missing: Vec<&Path> = path
        .ancestors()
        .filter(|p| !p.as_os_str().is_empty())
        .take_while(|p| !p.is_dir())
        .collect();
    while let Some(folder) = missing.pop() {
        make_folder(storage, folder)?;
    }
    Ok(())
}

/// What is in the folder of a new run, each with whether it is a folder: only what a process leaves
/// that is killed while it starts a run. The lock file, which stays, is not among it.
fn left_by_a_start(path: &Path) -> Result<Vec<(PathBuf, bool)>, Error> {
    let failed = |source| Error::io("list", path)(source);
    let occupied = |found: String, advice| Error::Occupied {
        path: path.into(),
        found,
        advice,
    };
    if path.join(names::INDEX).exists() {
        return Err(occupied(
            "a run".into(),
            "resume it, or give another folder",
        ));
    }
    let started = path.join(names::LOCK).is_file();
    let mut left = Vec::new();
    for entry in fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let is_folder = entry.file_type().map_err(failed)?.is_dir();
        let os_name = entry.file_name();
        let name = os_name.to_string_lossy();
        if name == names::LOCK && !is_folder {
            continue;
        }
        let ours = if is_folder {
            let mut inside = fs::read_dir(entry.path()).map_err(failed)?;
            names::FOLDERS.contains(&&*name) && inside.next().is_none()
        } else {
            let own = [
                names::METRICS,
                names::MANIFEST,
                names::CONFIG,
                names::TIMINGS,
            ];
            own.contains(&&*name) || name.starts_with(TEMPORARY_PREFIX)
        };
        if !(started && ours) {
            return Err(occupied(
                format!("{name:?}"),
                "give an empty folder, or one that does not exist",
            ));
        }
        left.push((entry.path(), is_folder));
    }
    left.sort();
    Ok(left)
}
