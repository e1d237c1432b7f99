//! Cases and their check.

use std::any::Any;
use std::cell::RefCell;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::{RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};

use crate::change::{Change, Material, changes};
use crate::peak_of;

/// Number of cases in a test run that asks for no other.
const CASES: u32 = 2000;
/// Longest message of an error, in bytes.
const LONGEST_MESSAGE: usize = 1000;
/// Most bytes of a file in the message of a failed test.
const SHOWN: usize = 2000;
/// Seconds after which a case hangs. Cases take far less than one, but machines are shared.
const PATIENCE: u64 = 20;

/// The most memory that a reader may hold at a time, its result included and the file not:
/// `times` the size of the file and `plus` bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// Bytes for each byte of the file.
    pub times: usize,
    /// Bytes in any case.
    pub plus: usize,
}

/// What was measured.
#[derive(Clone, Debug, Default, derive_more::Display)]
#[display(
    "{name}: {cases} cases in {:.1} s, {accepted} accepted; slowest {:.1} ms; at most {:.1} KiB, {:.0} % of the limit",
    time.as_secs_f64(), 1e3 * slowest.as_secs_f64(), *largest as f64 / 1024.0, 100.0 * largest_part
)]
pub struct Report {
    /// Name of the test.
    pub name: &'static str,
    /// Files read.
    pub cases: u64,
    /// Of these, files that the reader accepted.
    pub accepted: u64,
    /// Time of all cases.
    pub time: Duration,
    /// Longest time of a case.
    pub slowest: Duration,
    /// Most bytes that a case held at a time.
    pub largest: usize,
    /// Most bytes that a case held at a time, as part of what it might.
    pub largest_part: f64,
}

/// A file, what happens to it, and whether it is repaired then.
type Case = (Index, Vec<Change>, bool);

/// One reader and the files to change.
#[must_use]
pub struct Fuzz<'a> {
    name: &'static str,
    limit: Limit,
    valid: usize,
    material: Material,
    repair: Option<Box<dyn Fn(Vec<u8>) -> Vec<u8> + 'a>>,
}

impl<'a> Fuzz<'a> {
    /// A reader under a name, with the memory that its documentation states.
    pub fn new(name: &'static str, limit: Limit) -> Self {
        Self {
            name,
            limit,
            valid: 0,
            // Random bytes begin with nothing.
            material: Material {
                files: vec![Vec::new()],
                ..Material::default()
            },
            repair: None,
        }
    }

    /// Files that the reader accepts.
    pub fn valid(mut self, files: impl IntoIterator<Item = Vec<u8>>) -> Self {
        let before = self.material.files.len();
        self.material.files.splice(0..0, files);
        self.valid += self.material.files.len() - before;
        self
    }

    /// Beginnings of files, to be followed by random bytes.
    pub fn starts<T: AsRef<[u8]>>(mut self, starts: impl IntoIterator<Item = T>) -> Self {
        let starts = starts.into_iter().map(|s| s.as_ref().to_vec());
        self.material.files.extend(starts);
        self
    }

    /// Words that have a meaning in the format, such as those that open something: they are repeated, and nested by that.
    pub fn words<T: AsRef<[u8]>>(mut self, words: impl IntoIterator<Item = T>) -> Self {
        let words = words.into_iter().map(|w| w.as_ref().to_vec());
        self.material.words.extend(words);
        self
    }

    /// Half of the changed files go through this, such as for checksums that fit again: behind them
    /// is more to reach.
    pub fn repair(mut self, repair: impl Fn(Vec<u8>) -> Vec<u8> + 'a) -> Self {
        self.repair = Some(Box::new(repair));
        self
    }

    /// Reads the valid files and changed ones; time and memory of `read` are measured, and `accepted`
    /// has a look at what it returns. The report is printed, too.
    ///
    /// # Panics
    /// If one of the two panics, if a valid file is refused, if an error is longer than a line, and
    /// if a limit is exceeded. The message has the shortest case that was found, and the beginning of its bytes.
    pub fn run<T, E: fmt::Display>(
        &self,
        read: impl Fn(&[u8]) -> Result<T, E>,
        accepted: impl Fn(&[u8], T),
    ) -> Report {
        let begun = AtomicU64::new(0);
        let report = RefCell::new(Report {
            name: self.name,
            ..Report::default()
        });
        let one = |bytes: &[u8]| {
            begun.fetch_add(1, Ordering::Relaxed);
            self.one(bytes, &read, &accepted, &mut report.borrow_mut())
        };
        let (end, ended) = channel();
        let name = self.name;
        std::thread::scope(|scope| {
            let begun = &begun;
            scope.spawn(move || watch(name, begun, &ended));
            // Dropped at the end, also that by a panic, and then the watch ends.
            let _end: Sender<()> = end;
            for (number, file) in self.material.files[..self.valid].iter().enumerate() {
                let result = one(file);
                assert!(
                    result == Ok(true),
                    "{name}: valid file {number}: {result:?}"
                );
            }
            let outcome = Self::runner().run(&(any::<Index>(), changes(), any::<bool>()), |case| {
                let result = one(&self.bytes(&case));
                result.map(|_| ()).map_err(TestCaseError::fail)
            });
            match outcome {
                Ok(()) => {}
                Err(TestError::Fail(reason, case)) => {
                    let bytes = self.bytes(&case);
                    let shown = bytes[..bytes.len().min(SHOWN)].escape_ascii();
                    let length = bytes.len();
                    panic!("{name}: {reason}\n{case:?}\n{length} bytes: b\"{shown}\"");
                }
                Err(TestError::Abort(reason)) => panic!("{name}: {reason}"),
            }
        });
        let report = report.into_inner();
        println!("{report}");
        report
    }

    fn runner() -> TestRunner {
        let number = |name: &str| -> Option<u32> {
            let text = std::env::var(name).ok()?;
            Some(text.parse().expect("FUZZ_CASES and FUZZ_SEED are numbers"))
        };
        let config = ProptestConfig {
            cases: number("FUZZ_CASES").unwrap_or(CASES),
            failure_persistence: None,
            max_shrink_iters: 5000,
            ..ProptestConfig::default()
        };
        let algorithm = RngAlgorithm::ChaCha;
        // Without the standard library proptest does not look at the seed of its configuration.
        let rng = match number("FUZZ_SEED") {
            Some(number) => TestRng::from_seed(algorithm, &[number.to_le_bytes(); 8].concat()),
            None => TestRng::deterministic_rng(algorithm),
        };
        TestRunner::new_with_rng(config, rng)
    }

    /// Stores a file, if `FUZZ_KEEP` says where.
    fn keep(&self, bytes: &[u8], suffix: &str) {
        if let Some(folder) = std::env::var_os("FUZZ_KEEP") {
            let path = PathBuf::from(folder).join(format!("{}{suffix}", self.name));
            std::fs::write(path, bytes).expect("the folder of FUZZ_KEEP can be written to");
        }
    }

    /// Whether one file is accepted, measured and judged.
    fn one<T, E: fmt::Display>(
        &self,
        bytes: &[u8],
        read: impl Fn(&[u8]) -> Result<T, E>,
        accepted: impl Fn(&[u8], T),
        report: &mut Report,
    ) -> Result<bool, String> {
        self.keep(bytes, "");
        let start = Instant::now();
        let attempt = catch_unwind(AssertUnwindSafe(|| {
            let (result, peak) = peak_of(|| read(bytes));
            let refusal = result.map(|value| accepted(bytes, value)).err();
            (refusal.map(|error| error.to_string()), peak)
        }));
        let time = start.elapsed();
        let (refusal, peak) = attempt.map_err(|payload| panic_message(&*payload))?;
        let limit = self.limit.times * bytes.len() + self.limit.plus;
        report.cases += 1;
        report.accepted += u64::from(refusal.is_none());
        report.time += time;
        let is_slowest = time > report.slowest;
        report.slowest = report.slowest.max(time);
        report.largest = report.largest.max(peak);
        report.largest_part = report.largest_part.max(peak as f64 / limit as f64);
        if is_slowest {
            self.keep(bytes, ".slowest");
        }
        if peak > limit {
            let length = bytes.len();
            return Err(format!(
                "{peak} bytes of memory for {length} of the file, the limit is {limit}"
            ));
        }
        match refusal {
            Some(text) if !is_short_line(&text) => {
                let start: String = text.chars().take(2 * LONGEST_MESSAGE).collect();
                Err(format!("not one short line: {start:?}"))
            }
            refusal => Ok(refusal.is_none()),
        }
    }

    fn bytes(&self, case: &Case) -> Vec<u8> {
        let (file, changes, repaired) = case;
        let mut bytes = file.get(&self.material.files).clone();
        for change in changes {
            change.apply(&mut bytes, &self.material);
        }
        match &self.repair {
            Some(repair) if *repaired => repair(bytes),
            _ => bytes,
        }
    }
}

/// Checks that an error explains itself in one line of bearable length, as every error should that
/// a user gets to see.
///
/// # Panics
/// If it does not.
pub fn assert_short_line(error: &impl fmt::Display) {
    let text = error.to_string();
    assert!(is_short_line(&text), "not one short line: {text:?}");
}

fn is_short_line(text: &str) -> bool {
    !text.is_empty() && text.len() <= LONGEST_MESSAGE && !text.chars().any(char::is_control)
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
    format!("panic: {}", text.unwrap_or_default())
}

/// Ends the process if a case takes too long: a thread cannot be ended.
fn watch(name: &str, begun: &AtomicU64, ended: &Receiver<()>) {
    let (mut seen, mut seconds) = (0, 0);
    while ended.recv_timeout(Duration::from_secs(1)) == Err(RecvTimeoutError::Timeout) {
        let now = begun.load(Ordering::Relaxed);
        seconds = if now == seen { seconds + 1 } else { 0 };
        seen = now;
        if seconds > PATIENCE {
            eprintln!(
                "{name}: reading file {now} takes more than {PATIENCE} seconds; FUZZ_KEEP=FOLDER stores it"
            );
            std::process::abort();
        }
    }
}
