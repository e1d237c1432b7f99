//! The operations that change a disk.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// The operations that change a disk, one method each. They do what they say by default, so that a
/// test overrides those which it wants to fail, count or record.
pub trait Storage: fmt::Debug + Send + Sync {
    /// Makes a folder in an existing one.
    ///
    /// # Errors
    /// What the operating system says, also if there is something of that name.
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        fs::create_dir(path)
    }

    /// Makes an empty file with the permissions of an ordinary new one, open for writing.
    ///
    /// # Errors
    /// What the operating system says, also if there is something of that name.
    fn create_file(&self, path: &Path) -> io::Result<File> {
        File::options().write(true).create_new(true).open(path)
    }

    /// Writes at the current position and returns how many bytes were written.
    ///
    /// # Errors
    /// What the operating system says.
    fn write(&self, file: &mut File, path: &Path, bytes: &[u8]) -> io::Result<usize> {
        let _ = path;
        file.write(bytes)
    }

    /// Cuts a file off.
    ///
    /// # Errors
    /// What the operating system says.
    fn set_length(&self, file: &File, path: &Path, length: u64) -> io::Result<()> {
        let _ = path;
        file.set_len(length)
    }

    /// Flushes a file's content to the disk.
    ///
    /// # Errors
    /// What the operating system says.
    fn sync_file(&self, file: &File, path: &Path) -> io::Result<()> {
        let _ = path;
        file.sync_all()
    }

    /// Gives a file another name, in place of a file that had it.
    ///
    /// # Errors
    /// What the operating system says.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    /// Removes a file, or a link but not what it leads to.
    ///
    /// # Errors
    /// What the operating system says.
    fn remove_file(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }

    /// Removes an empty folder.
    ///
    /// # Errors
    /// What the operating system says.
    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        fs::remove_dir(path)
    }

    /// Flushes the names in a folder to the disk, where there is such a thing.
    ///
    /// # Errors
    /// What the operating system says.
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

impl Storage for Disk {}

/// A file on a storage, for code that writes to [`Write`].
pub(crate) struct Stored<'a> {
    pub storage: &'a dyn Storage,
    pub file: File,
    pub path: &'a Path,
}

impl Write for Stored<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.storage.write(&mut self.file, self.path, bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
