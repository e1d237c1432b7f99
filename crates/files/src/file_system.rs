//! The operations that change a disk.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// The operations that change a disk, one method each. They do what they say by default, so that a
/// test overrides those which it wants to fail, count or record.
pub trait FileSystem: fmt::Debug + Send + Sync {
    /// Makes a folder in an existing one; it is an error if there is something of that name.
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        fs::create_dir(path)
    }

    /// Makes an empty file with the permissions of an ordinary new one, open for writing; it is an
    /// error if there is something of that name.
    fn create_file(&self, path: &Path) -> io::Result<File> {
        File::options().write(true).create_new(true).open(path)
    }

    /// Writes at the current position and returns how many bytes were written.
    fn write(&self, file: &mut File, _path: &Path, bytes: &[u8]) -> io::Result<usize> {
        file.write(bytes)
    }

    /// Flushes a file's content to the disk.
    fn sync_file(&self, file: &File, _path: &Path) -> io::Result<()> {
        file.sync_all()
    }

    /// Gives a file another name, in place of a file that had it.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    /// Removes a file, a link but not what it leads to, or a folder with all that is in it.
    fn remove(&self, path: &Path) -> io::Result<()> {
        if path.symlink_metadata()?.is_dir() {
            fs::remove_dir_all(path)
        } else {
            fs::remove_file(path)
        }
    }

    /// Flushes the names in a folder to the disk, where there is such a thing.
    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        use io::ErrorKind::{InvalidInput, Unsupported};
        // Folders cannot be opened everywhere, and not every file system can flush them.
        if !cfg!(unix) {
            return Ok(());
        }
        match File::open(path)?.sync_all() {
            Err(e) if matches!(e.kind(), InvalidInput | Unsupported) => Ok(()),
            result => result,
        }
    }
}

/// The disk itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl FileSystem for Disk {}
