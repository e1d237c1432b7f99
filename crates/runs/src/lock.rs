//! One process at a time.

use std::fs::{File, TryLockError};
use std::io::ErrorKind::AlreadyExists;
use std::path::Path;

use files::FileSystem;

use crate::{Error, digest, names};

/// A locked run directory. The lock ends when this is dropped or when the process ends, however it
/// ends.
#[derive(Debug)]
pub(crate) struct Lock(File);

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing the file would not be enough: a process that is being started has a copy of it for
        // a moment. If unlocking fails, closing is all that is left.
        let _ = self.0.unlock();
    }
}

pub(crate) fn lock(file_system: &dyn FileSystem, folder: &Path) -> Result<Lock, Error> {
    let path = folder.join(names::LOCK);
    let locked = || Error::Locked(folder.into());
    let file = if path.symlink_metadata().is_ok() {
        let ordinary = digest::open(&path)?;
        // Locks on network file systems take a file that is open for writing.
        let writable = File::options().read(true).write(true).open(&path);
        writable.unwrap_or(ordinary)
    } else {
        match file_system.create_file(&path) {
            // Somebody else was faster.
            Err(e) if e.kind() == AlreadyExists => return Err(locked()),
            made => made.map_err(files::Error::of("create", &path))?,
        }
    };
    match file.try_lock() {
        Ok(()) => Ok(Lock(file)),
        Err(TryLockError::WouldBlock) => Err(locked()),
        Err(TryLockError::Error(source)) => Err(files::Error::of("lock", path)(source).into()),
    }
}
