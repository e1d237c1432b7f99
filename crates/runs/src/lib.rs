//! Directories for long computations. A computation that was stopped in any way goes on from its last
//! commit. Its files are the same, byte for byte, as without the stop.
//!
//! ```
//! use runs::{CheckpointState, Error, RunDirectory};
//! use serde_json::Value;
//!
//! fn compute(folder: &std::path::Path, last: u64) -> Result<(), Error> {
//!     let (mut run, mut state) = match RunDirectory::open(folder) {
//!         Err(Error::NoRun { .. }) => {
//!             let start = CheckpointState::new(0, Value::Null).with_array("u", vec![0.1, 0.2]);
//!             let config = [("config.toml", &b"rate = 3.9\n"[..])];
//!             (RunDirectory::create(folder, &config, &start)?, start)
//!         }
//!         stored => stored?.resume()?,
//!     };
//!     while state.step < last {
//!         let u = state.arrays.get_mut("u").expect("it is there");
//!         u.0.to_mut().iter_mut().for_each(|v| *v *= 3.9 * (1.0 - *v));
//!         state.step += 1;
//!         if state.step % 3 == 0 {
//!             run.commit(&state)?;
//!         }
//!     }
//!     run.write_file("figures/u.txt", format!("{:?}\n", state.array("u")).as_bytes())?;
//!     run.finish(&state)
//! }
//!
//! # let root = tempfile::tempdir().expect("a folder for temporary files");
//! compute(&root.path().join("run"), 20)?;
//! assert!(RunDirectory::open(root.path().join("run"))?.is_finished());
//! # Ok::<(), Error>(())
//! ```
//!
//! # The directory
//!
//! | name | content | written |
//! |---|---|---|
//! | `checkpoints/step-00000012.ckpt` | the state, and length and SHA-256 of every file that is written once | at each commit, the last two kept |
//! | `config.toml`, `fields/`, … | files of the caller that do not change | once |
//! | `metrics.csv`, … | files of the caller that change | at any time |
//! | `lock` | nothing; locked while a process works here | once |
//!
//! Resuming removes checkpoints and temporary files that are no part of the run. Files of other programs stay.
//!
//! # What is promised
//!
//! - To commit is to write a checkpoint. All files that a checkpoint lists are written and flushed before the checkpoint itself. So the last
//!   checkpoint describes a whole state of the run, whenever the process dies. If the last checkpoint does not list a file, this file was
//!   written later. A resumed run writes it again.
//! - Let a run be a function of its [`CheckpointState`]. Then every file that is written once has the same bytes at the end of the run, however
//!   often the run was stopped. At the end only the last checkpoint stays.
//! - If a bit has flipped in a file that is written once, opening the run finds it, and the error names the file.
//!   [`RunDirectory::recover`] goes on from the newest intact commit.
//! - A file may contain a number that says how much data follows. A reader uses such a number only after it has checked that the file is long
//!   enough. For a checkpoint with large arrays, readers take memory of up to four times its length. For the other data of a checkpoint, its
//!   [notes](CheckpointState::notes), they take at most 320 times the length of the notes.
//! - A failed write (full disk, read-only folder) leaves the last commit in place.
//!
//! Functions that read or write files can fail with [`Error::Io`]. Functions name other errors in their documentation.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod checkpoint;
mod digest;
mod directory;
mod error;
mod folder;
mod interrupt;
mod lock;
mod names;
mod stored;

pub use checkpoint::{Array, CheckpointState};
pub use directory::RunDirectory;
pub use error::Error;
pub use interrupt::{Interrupt, Last};
pub use stored::StoredRun;
