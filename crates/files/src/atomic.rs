//! Write, flush, rename, flush the folder.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::{Disk, Error, FileSystem};

/// How the names of temporary files begin.
pub const TEMPORARY_PREFIX: &str = ".partial-";
/// Large fields are written in pieces of this many bytes.
const BUFFER: usize = 1 << 16;

/// Writes a file through a temporary one in the same folder.
///
/// The temporary file is removed when something fails, also when `write` panics. The new file has
/// the permissions of an ordinary new file. The action of an error of `write` is `write`. Of a
/// symbolic link, the file to which it leads is written, and the link stays.
pub fn write_atomically(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let path = path.as_ref();
    let target = target(path).map_err(Error::of("follow the links of", path))?;
    write_atomically_on(&Disk, target, write)
}

/// The file to which a path leads through symbolic links, whether it is there or not.
fn target(path: &Path) -> io::Result<PathBuf> {
    /// As many as Linux follows.
    const MOST_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MOST_LINKS {
        if !target.is_symlink() {
            return Ok(target);
        }
        // A relative link is relative to its own folder.
        target = folder_of(&target).join(std::fs::read_link(&target)?);
    }
    Err(io::Error::other("there are too many of them"))
}

/// [`write_atomically`] on another file system than the disk itself, and in place of symbolic links.
pub fn write_atomically_on(
    file_system: &dyn FileSystem,
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let path = path.as_ref();
    let failed = |action| Error::of(action, path);
    let folder = folder_of(path);
    let (file, mut temporary) = tempfile::Builder::new()
        .prefix(TEMPORARY_PREFIX)
        .make_in(folder, |path| file_system.create_file(path))
        .map_err(failed("create a file beside"))?
        .into_parts();
    let store = || {
        let mut buffer = BufWriter::with_capacity(
            BUFFER,
            Stored {
                file_system,
                file,
                path: &temporary,
            },
        );
        let written = write(&mut buffer).and_then(|()| buffer.flush());
        // Taken apart, or dropping the buffer would write what has just failed again.
        let (stored, _) = buffer.into_parts();
        written.map_err(failed("write"))?;
        let flushed = file_system.sync_file(&stored.file, &temporary);
        flushed.map_err(failed("flush to disk"))?;
        // Closed before it is renamed, which not every system does with open files.
        drop(stored);
        (file_system.rename(&temporary, path)).map_err(failed("replace"))
    };
    let stored = store();
    // By hand, so that the file system knows. Only a panic above leaves it to the destructor.
    temporary.disable_cleanup(true);
    if stored.is_err() {
        // The first error is the one to report.
        let _ = file_system.remove(&temporary);
    }
    stored?;
    (file_system.sync_folder(folder)).map_err(failed("flush the folder of"))
}

/// Makes a folder that lasts, and those that it is in, unless they are there. Something else of that name is an error.
pub fn make_folders_on(file_system: &dyn FileSystem, path: impl AsRef<Path>) -> Result<(), Error> {
    let path = path.as_ref();
    if path.as_os_str().is_empty() || path.is_dir() {
        return Ok(());
    }
    let folder = folder_of(path);
    make_folders_on(file_system, folder)?;
    match file_system.create_folder(path) {
        // Somebody else was faster.
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => return Ok(()),
        result => result.map_err(Error::of("create the folder", path))?,
    }
    (file_system.sync_folder(folder)).map_err(Error::of("flush the folder of", path))
}

/// The bytes of a file.
pub fn read(path: impl AsRef<Path>) -> Result<Vec<u8>, Error> {
    let path = path.as_ref();
    std::fs::read(path).map_err(Error::of("read", path))
}

/// Proves that files can be made in a folder, by making one and removing it.
pub fn probe(folder: impl AsRef<Path>) -> Result<(), Error> {
    let folder = folder.as_ref();
    let mut file = tempfile::Builder::new()
        .prefix(TEMPORARY_PREFIX)
        .tempfile_in(folder)
        .map_err(Error::of("create a file in", folder))?;
    file.write_all(b"probe")
        .and_then(|()| file.close())
        .map_err(Error::of("write to", folder))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// A file on a file system, for code that writes to [`Write`].
struct Stored<'a> {
    file_system: &'a dyn FileSystem,
    file: File,
    path: &'a Path,
}

impl Write for Stored<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file_system.write(&mut self.file, self.path, bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
