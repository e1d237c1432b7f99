//! One process at a time.

use std::fs::{File, TryLockError};
use std::io::ErrorKind::{AlreadyExists, NotFound};
use std::path::Path;

use files::Storage;

use crate::{Damage, Error, names};

/// Locks a run directory until the file is dropped or the process ends, however it ends.
pub(crate) fn lock(storage: &dyn Storage, folder: &Path) -> Result<File, Error> {
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
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::Locked {
            path: folder.into(),
        }),
        Err(TryLockError::Error(source)) => Err(Error::io("lock", path)(source)),
    }
}
