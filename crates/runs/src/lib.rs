//! Run directories that survive: whatever stops a computation, it goes on from the last commit and
//! ends with the same bytes as if nothing had happened.
//!
//! ```
//! use runs::{Error, GridShape, Identity, Interrupt, Resumed, RunDirectory, State, fingerprint};
//! use serde::Serialize;
//!
//! #[derive(Serialize)]
//! struct Row {
//!     step: u64,
//!     mean: f64,
//! }
//!
//! fn compute(folder: &std::path::Path, interrupt: &Interrupt) -> Result<bool, Error> {
//!     let config = "rate = 3.9\n";
//!     let identity = Identity {
//!         kind: "logistic map".into(),
//!         program: "example 1.0".into(),
//!         grid: GridShape { cells: vec![4], side: 1.0, origin: vec![0.0] },
//!         network: None,
//!         options: fingerprint(config),
//!     };
//!     let (mut run, state) = match RunDirectory::open(folder) {
//!         Ok(stored) => {
//!             let Resumed { run, state, .. } = stored.resume(&identity)?;
//!             (run, state)
//!         }
//!         Err(Error::NoRun { .. }) => {
//!             let manifest = serde_json::json!({ "experiment": "logistic", "seed": 7 });
//!             (RunDirectory::create(folder, &identity, &manifest, config)?, None)
//!         }
//!         Err(error) => return Err(error),
//!     };
//!     let mut state = state.unwrap_or_else(|| {
//!         State::new(0, 0.0).with_array("u", vec![0.1, 0.2, 0.3, 0.4])
//!     });
//!     while state.step < 20 {
//!         let u = &mut state.arrays[0].1;
//!         u.iter_mut().for_each(|v| *v *= 3.9 * (1.0 - *v));
//!         let mean = u.iter().sum::<f64>() / 4.0;
//!         state.step += 1;
//!         state.time = 0.1 * state.step as f64;
//!         run.metric(&Row { step: state.step, mean })?;
//!         if state.step % 10 == 0 {
//!             let name = format!("fields/step-{:04}.txt", state.step);
//!             run.write_file(&name, |out| writeln!(out, "{:?}", state.arrays[0].1))?;
//!         }
//!         if state.step % 3 == 0 || interrupt.requested() {
//!             run.commit(&state)?;
//!         }
//!         if interrupt.requested() {
//!             return Ok(false); // and the program ends with Interrupt::EXIT_CODE
//!         }
//!     }
//!     run.write_file("figures/mean.txt", |out| writeln!(out, "a figure"))?;
//!     run.finish(&state)?;
//!     Ok(true)
//! }
//!
//! # let root = tempfile::tempdir().expect("a folder for temporary files");
//! # let folder = root.path().join("run");
//! let interrupt = Interrupt::never(); // in a program: Interrupt::catch()?
//! interrupt.request();
//! assert!(!compute(&folder, &interrupt)?); // one step, then the signal
//! assert!(compute(&folder, &Interrupt::never())?); // the other nineteen
//! assert!(RunDirectory::open(&folder)?.is_finished());
//! # Ok::<(), Error>(())
//! ```
//!
//! # The directory
//!
//! | name | content | written |
//! |---|---|---|
//! | `index.json` | length and SHA-256 of every file, and its own SHA-256 | replaced at each commit |
//! | `manifest.json`, `config.toml` | what was asked for, without times | once |
//! | `metrics.csv` | a row per step | grows |
//! | `checkpoints/step-00000012.ckpt` | the state ([`Checkpoint`] has the format) | once, the last two kept |
//! | `figures/`, `fields/`, … | whatever the caller writes | once |
//! | `timings.json` | wall times and the like, and its own SHA-256 | replaced at any time |
//! | `lock` | nothing; locked while a process works here | once |
//!
//! The directory belongs to the run: resuming removes all files that are not part of it.
//!
//! # What is promised
//!
//! - The index is the commit point. Files are written and flushed before it and never overwritten, so
//!   that it describes a whole state of the run whenever the process dies. What it does not list, and
//!   rows of `metrics.csv` after the committed ones, were written after the commit; resuming removes
//!   them, and the computation writes them again.
//! - A run that is a function of its [`State`] ends with the same bytes in every file but
//!   `timings.json`, however often it was stopped. [`RunDirectory::finish`] keeps one checkpoint
//!   only, because which other one there is depends on where it was stopped.
//! - A bit that has flipped in any of the files is noticed when the run is opened, and the file
//!   named. [`RunDirectory::recover`] goes on from the newest intact commit. Of a damaged
//!   `index.json` there is no copy: what can then be saved is in the checkpoints, which
//!   [`Checkpoint::read`] checks on their own.
//! - Readers never trust a number in a file before its length agrees. They take at most the length
//!   of a checkpoint and 160 times [`Checkpoint::MAX_HEADER`], some ten times the length of
//!   an index (at most 64 MiB), 160 times that of `timings.json` (at most 1 MiB), and 64 KiB
//!   for anything else.
//! - A failed write (full disk, read-only folder) leaves the last commit in place.

mod checkpoint;
mod digest;
mod directory;
mod error;
mod identity;
mod index;
mod interrupt;
mod lock;
mod metrics;
mod names;
mod seal;
mod stored;

#[cfg(test)]
mod fuzzing;

pub use checkpoint::{Checkpoint, State};
pub use digest::fingerprint;
pub use directory::RunDirectory;
pub use error::{Damage, Error};
pub use identity::{GridShape, Identity, NetworkName};
pub use interrupt::Interrupt;
pub use stored::{Resumed, StoredRun};
