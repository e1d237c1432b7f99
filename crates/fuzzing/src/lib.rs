//! Tests of readers of files with damaged files. A reader must not panic, must not hang, and must not take more memory than the size of the
//! file justifies. If it refuses a file, it must say why in one line. A [`Fuzz`] changes valid files, as damage or malice would, and measures
//! every reading. For tests only.
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
//! A test run tries 2000 cases, the same ones in every run. Environment variables ask for more:
//!
//! | variable | meaning |
//! |---|---|
//! | `FUZZ_CASES` | number of cases of every test |
//! | `FUZZ_SEED` | other cases, by a number |
//! | `FUZZ_KEEP` | a folder, where every case is stored before it is read, under the name of its test; after a crash (stack overflow, memory, time) it holds the case that caused the crash, and `NAME.slowest` is the file that took longest |
//!
//! All tests of this kind have `fuzzing` in their names. `scripts/test_long` runs a million cases of each.

mod change;
mod fuzz;
mod memory;

pub use fuzz::{Fuzz, Limit, Report, assert_short_line};
pub use memory::{CountingAllocator, peak_of};
