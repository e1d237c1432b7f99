//! Readers of files against changed files: they must not panic, hang, or take memory that the file does not back, and what they refuse they
//! must explain in one line. A [`Fuzz`] has valid files, changes them in ways that damage and malice would, and measures every reading. For
//! tests only.
//!
//! ```
//! use fuzzing::{CountingAllocator, Fuzz, Limit};
//!
//! #[global_allocator]
//! static ALLOCATOR: CountingAllocator = CountingAllocator;
//!
//! fn read(bytes: &[u8]) -> Result<u32, std::num::ParseIntError> {
//!     String::from_utf8_lossy(bytes).parse()
//! }
//!
//! let report = Fuzz::new("numbers", Limit { times: 9, plus: 64 })
//!     .valid([b"12".to_vec(), b"4294967295".to_vec()])
//!     .words(["+", "_"])
//!     .run(read, |bytes, number| assert!(bytes.len() > 8 || number < 100_000_000));
//! assert!(report.largest > 0);
//! ```
//!
//! # How long
//!
//! A test run tries 2000 cases, always the same ones. Environment variables ask for more:
//!
//! | variable | meaning |
//! |---|---|
//! | `FUZZ_CASES` | number of cases of every test |
//! | `FUZZ_SEED` | other cases, by a number |
//! | `FUZZ_KEEP` | a folder: every case is stored there, by the name of its test, before it is read. What is found there after a process ended by itself (stack overflow, memory, time) is the reason. `NAME.slowest` is the file that took longest |
//!
//! All tests of this kind have `fuzzing` in their names; `scripts/test_long` runs a million cases of each.

mod change;
mod fuzz;
mod memory;

pub use fuzz::{Fuzz, Limit, Report, assert_short_line};
pub use memory::{CountingAllocator, peak_of};
