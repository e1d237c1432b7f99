//! Files that are either complete or absent.
//!
//! ```
//! # let folder = tempfile::tempdir().expect("a folder for temporary files");
//! let path = folder.path().join("result.txt");
//! files::write_atomically(&path, |out| writeln!(out, "{}", 42))?;
//! assert_eq!(std::fs::read_to_string(&path).unwrap(), "42\n");
//! # Ok::<(), files::Error>(())
//! ```
//!
//! - A file is written under a temporary name in its own folder, flushed to the disk and renamed;
//!   then the folder is flushed. A reader, or a restart after a crash, sees the old file or the new
//!   one, never a part.
//! - Temporary names begin with [`TEMPORARY_PREFIX`], and nothing else does. They are removed when
//!   writing fails; only a process that is killed, or a power failure, leaves them behind.
//! - Everything that changes the disk goes through [`FileSystem`], so that tests can let every single
//!   operation fail. Its errors are those of the operating system, of which [`Error`] says where they came from.
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
pub use text::{shortened, with_causes};
