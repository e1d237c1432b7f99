//! One process at a time.

use std::fs::{File, TryLockError};
use std::io::ErrorKind::{AlreadyExists, NotFound};
use std::path::Path;

use files::Storage;

use crate::{Damage, Error, names};

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

/// Locks a run directory.
pub(crate) fn lock(storage: &dyn Storage, folder: &Path) -> Result<Lock, Error> {
    let path = folder.join(names::LOCK);
    // Opening a pipe would wait for ever.
    if path.symlink_metadata().is_ok_and(|about| !about.is_file()) {
        return Err(Error::damaged(path, Damage::NotAFile));
    }
    let open = || match File::open(&path) {
        Err(e) if e.kind() == NotFound => match storage.create_file(&path) {
            // Somebody else was faster.
            Err(e) if e.kind() == AlreadyExists => File::open(&path),
            result => result,
        },
        result => result,
    };
    let file = open().map_err(Error::io("open", &path))?;
    match file.try_lock() {
        Ok(()) => Ok(Lock(file)),
        Err(TryLockError::WouldBlock) => Err(Error::Locked {
            path: folder.into(),
        }),
        Err(TryLockError::Error(source)) => Err(Error::io("lock", path)(source)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use files::Disk;

    #[test]
    fn a_lock_ends_though_others_hold_copies_of_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let first = lock(&Disk, folder.path()).unwrap();
        // As a process has that was forked and has not yet become another program.
        let copy = first.0.try_clone().unwrap();
        let refused = lock(&Disk, folder.path()).unwrap_err();
        assert!(matches!(refused, Error::Locked { .. }), "{refused}");
        drop(first);
        lock(&Disk, folder.path()).unwrap();
        drop(copy);
    }
}
