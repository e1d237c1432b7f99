//! Atomic writing: a file is either complete or absent.
//!
//! ```
//! # let folder = tempfile::tempdir().expect("a folder for temporary files");
//! let path = folder.path().join("result.txt");
//! files::write_atomically(&path, |out| writeln!(out, "{}", 42))?;
//! assert_eq!(std::fs::read_to_string(&path).unwrap(), "42\n");
//! # Ok::<(), files::Error>(())
//! ```
//!
//! - A file is written under a temporary name in its own folder, flushed to the disk and renamed.
//!   Then the folder is flushed. A reader sees the old file or the new one, never a part. So does a
//!   restart after a crash.
//! - Only temporary names begin with [`TEMPORARY_PREFIX`]. Temporary files are removed when writing
//!   fails. They stay only after a kill or a power failure.
//! - All changes of the disk go through [`FileSystem`], so that tests can let every single operation
//!   fail. An [`Error`] has the failed operation, the path and the error of the operating system.
//! - [`Number`] reads the numbers of binary formats.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod atomic;
mod checksum;
mod error;
mod file_system;
mod number;
mod text;

pub use atomic::{
    TEMPORARY_PREFIX, make_folders_on, probe, read, write_atomically, write_atomically_on,
};
pub use checksum::{Sha256, hexadecimal};
pub use error::Error;
pub use file_system::{Disk, FileSystem};
pub use number::Number;
pub use text::{UTF8_MARK, shortened, with_causes, without_mark};
