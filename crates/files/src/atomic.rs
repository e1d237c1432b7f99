//! Write, flush, rename, flush the folder.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::stale::TEMPORARY_PREFIX;
use crate::storage::Stored;
use crate::{Disk, Error, Step, Storage};

/// Large fields are written in pieces of this many bytes.
const BUFFER: usize = 1 << 16;

/// Writes a file through a temporary one in the same folder.
///
/// The temporary file is removed when something fails, also when `write` panics. The new file has
/// the permissions of an ordinary new file.
///
/// # Errors
/// [`Error`] with the step that failed; an error of `write` is reported as [`Step::Write`].
pub fn write_atomically(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    write_atomically_on(&Disk, path, write)
}

/// [`write_atomically`] on another storage than the disk itself.
///
/// # Errors
/// [`Error`] with the step that failed.
pub fn write_atomically_on(
    storage: &dyn Storage,
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let path = path.as_ref();
    let failed = |step| {
        move |source| Error {
            step,
            path: path.into(),
            source,
        }
    };
    let folder = folder_of(path);
    let (file, temporary) = tempfile::Builder::new()
        .prefix(TEMPORARY_PREFIX)
        .make_in(folder, |path| storage.create_file(path))
        .map_err(failed(Step::Create))?
        .into_parts();
    let store = || {
        let mut buffer = BufWriter::with_capacity(
            BUFFER,
            Stored {
                storage,
                file,
                path: &temporary,
            },
        );
        let written = write(&mut buffer).and_then(|()| buffer.flush());
        // Taken apart, or dropping the buffer would write what has just failed again.
        let (stored, _) = buffer.into_parts();
        written.map_err(failed(Step::Write))?;
        storage
            .sync_file(&stored.file, &temporary)
            .map_err(failed(Step::Flush))?;
        // Closed before it is renamed, which not every system does with open files.
        drop(stored);
        storage
            .rename(&temporary, path)
            .map_err(failed(Step::Rename))
    };
    let stored = store();
    // By hand, so that the storage knows. Only a panic above leaves it to the destructor.
    match temporary.keep() {
        Err(e) => stored.and(Err(failed(Step::Rename)(e.error)))?,
        Ok(temporary) => {
            if stored.is_err() {
                // The first error is the one to report.
                let _ = storage.remove_file(&temporary);
            }
            stored?;
        }
    }
    storage
        .sync_folder(folder)
        .map_err(failed(Step::FlushFolder))
}

/// Proves that files can be made in a folder, by making one and removing it.
///
/// # Errors
/// [`Error`] with the step that failed.
pub fn probe(folder: impl AsRef<Path>) -> Result<(), Error> {
    let folder = folder.as_ref();
    let failed = |step| {
        move |source| Error {
            step,
            path: folder.into(),
            source,
        }
    };
    let mut file = tempfile::Builder::new()
        .prefix(TEMPORARY_PREFIX)
        .tempfile_in(folder)
        .map_err(failed(Step::Create))?;
    file.write_all(b"probe").map_err(failed(Step::Write))?;
    file.close().map_err(failed(Step::Remove))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
