//! Run directories that survive: whatever stops a computation, it goes on from the last commit and
//! ends with the same bytes as if nothing had happened.
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
//! | `config.toml`, `fields/`, … | whatever the caller writes | once |
//! | `metrics.csv`, … | whatever the caller replaces at any time | at any time |
//! | `lock` | nothing; locked while a process works here | once |
//!
//! Resuming removes checkpoints and temporary files that are no part of the run; files of others stay.
//!
//! # What is promised
//!
//! - A checkpoint is the commit. Other files are written and flushed before it, so that it describes
//!   a whole state of the run whenever the process dies. What it does not list was written after it,
//!   and the computation of a resumed run writes it again.
//! - A run that is a function of its [`CheckpointState`] ends with the same bytes in every file that is written once, however
//!   often it was stopped: only the last checkpoint stays.
//! - A bit that has flipped in one of those files is noticed when the run is opened, and the file named.
//!   [`RunDirectory::recover`] goes on from the newest intact commit.
//! - Readers never trust a number in a file before its length agrees. They take up to four times the length of a checkpoint with
//!   large arrays, and at most 320 times that of its notes (small maps).
//! - A failed write (full disk, read-only folder) leaves the last commit in place.
//!
//! Whatever touches files fails with [`Error::Io`]; other errors are named where they arise.

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
pub use interrupt::Interrupt;
pub use stored::StoredRun;
