//! Run manifests: what was computed, with which program, parameters and machine class.

use std::path::PathBuf;
use std::process::Command;
use std::time::{Instant, SystemTime};

use serde::Serialize;
use serde_json::{Map, Value};

use crate::error::{Error, Result};
use crate::output::OutputDir;

/// A named part of a run and how long it took.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Phase {
    name: String,
    seconds: f64,
}

/// What is needed to repeat a run, and its wall times. It holds nothing about who ran it where: no host name, no user, no paths.
///
/// Beside what it is started with, these are the version of the workspace, the commit of the sources, the compiler, the target triple, the
/// number of processors available, and the start of the run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Manifest {
    experiment: String,
    parameters: Map<String, Value>,
    version: &'static str,
    commit: Option<String>,
    rustc: &'static str,
    target: &'static str,
    os: &'static str,
    arch: &'static str,
    cpus: usize,
    device: String,
    dtype: String,
    backend: String,
    seed: u64,
    started: String,
    wall_seconds: f64,
    phases: Vec<Phase>,
    #[serde(skip)]
    clock: Instant,
}

impl Manifest {
    /// Starts the clock and looks up what the program can know by itself. Parameters are anything that serialises to a map, such as a
    /// struct; then come the tensor backend, its device and its number format, and the seed of all random numbers.
    pub fn start(
        experiment: &str,
        parameters: &impl Serialize,
        [backend, device, dtype]: [&str; 3],
        seed: u64,
    ) -> Result<Self> {
        let parameters = serde_json::to_value(parameters).and_then(serde_json::from_value);
        Ok(Self {
            experiment: experiment.to_owned(),
            parameters: parameters.map_err(Error::json("the run parameters"))?,
            version: env!("CARGO_PKG_VERSION"),
            commit: commit(),
            rustc: env!("REPORT_RUSTC"),
            target: env!("REPORT_TARGET"),
            os: std::env::consts::OS,
            arch: std::env::consts::ARCH,
            cpus: std::thread::available_parallelism().map_or(1, usize::from),
            device: device.to_owned(),
            dtype: dtype.to_owned(),
            backend: backend.to_owned(),
            seed,
            started: rfc3339(SystemTime::now()),
            wall_seconds: 0.0,
            phases: Vec::new(),
            clock: Instant::now(),
        })
    }

    /// Does a part of the run and records how long it took.
    pub fn phase<R>(&mut self, name: impl Into<String>, work: impl FnOnce() -> R) -> R {
        let clock = Instant::now();
        let result = work();
        self.phases.push(Phase {
            name: name.into(),
            seconds: clock.elapsed().as_secs_f64(),
        });
        result
    }

    /// Writes `manifest.json` with the wall time so far.
    pub fn write(&mut self, folder: &OutputDir) -> Result<PathBuf> {
        self.wall_seconds = self.clock.elapsed().as_secs_f64();
        folder.write_json("manifest.json", self)
    }
}

/// Commit of the checkout this crate was built from, if it still is there and git knows it; `-modified` is appended if its code differs from
/// that. Other tracked files are results, which runs replace.
fn commit() -> Option<String> {
    let git = |arguments: &[&str]| -> Option<String> {
        let output = Command::new("git")
            .args(["-C", env!("CARGO_MANIFEST_DIR")])
            .args(arguments)
            .output()
            .ok()
            .filter(|output| output.status.success())?;
        Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
    };
    let hash = git(&["rev-parse", "HEAD"])?;
    let code = [":/crates", ":/experiments", ":/Cargo.toml", ":/Cargo.lock"];
    let status = ["status", "--porcelain", "--untracked-files=no", "--"];
    let changes = git(&[&status[..], &code].concat())?;
    let suffix = if changes.is_empty() { "" } else { "-modified" };
    Some(hash + suffix)
}

/// Date and time of day in UTC to the second, as RFC 3339 writes them.
fn rfc3339(moment: SystemTime) -> String {
    const DAY: u64 = 86400;
    // A clock before 1970 is wrong anyway.
    let since = moment.duration_since(SystemTime::UNIX_EPOCH);
    let seconds = since.map_or(0, |since| since.as_secs());
    let (days, second) = (seconds / DAY, seconds % DAY);
    // Counted from 1 March of the year 0, so that the leap day is the last of a year; 400 years have 146097 days.
    let days = days + 719_468;
    let (cycle, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (year, month) = (400 * cycle + year + month / 10, (month + 2) % 12 + 1);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[derive(Serialize)]
    struct Parameters {
        epsilon: f64,
        shape: &'static str,
    }

    #[test]
    fn a_manifest_says_what_was_run_but_not_where() {
        let root = tempfile::tempdir().unwrap();
        let folder = OutputDir::create(root.path()).unwrap();
        let parameters = Parameters {
            epsilon: 0.02,
            shape: "circle",
        };
        let mut manifest =
            Manifest::start("circle", &parameters, ["flex", "cpu", "f64"], 7).unwrap();
        let answer = manifest.phase("solve", || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            42
        });
        assert_eq!(answer, 42);
        let text = std::fs::read_to_string(manifest.write(&folder).unwrap()).unwrap();
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["experiment"], "circle");
        assert_eq!(json["parameters"]["epsilon"], 0.02);
        assert_eq!(json["seed"], 7);
        assert_eq!(json["backend"], "flex");
        let word = |key: &str| json[key].as_str().unwrap();
        assert!(word("rustc").starts_with("rustc 1."));
        assert!(word("target").contains(std::env::consts::ARCH));
        assert!(json["cpus"].as_u64().unwrap() >= 1);
        let started = word("started");
        assert!(
            started.len() == 20 && started.starts_with("20"),
            "{started}"
        );
        let phase = json["phases"][0]["seconds"].as_f64().unwrap();
        assert!(phase >= 0.02 && json["wall_seconds"].as_f64().unwrap() >= phase);
        assert!(!text.contains(env!("CARGO_MANIFEST_DIR")));
        assert!(!text.contains(root.path().to_str().unwrap()));
    }

    #[test]
    fn moments_are_dates_and_times() {
        for (seconds, expected) in [
            (0, "1970-01-01T00:00:00Z"),
            (68_255_999, "1972-02-29T23:59:59Z"),
            (951_868_800, "2000-03-01T00:00:00Z"),
            (1_767_225_599, "2025-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(
                rfc3339(SystemTime::UNIX_EPOCH + Duration::from_secs(seconds)),
                expected
            );
        }
    }

    #[test]
    fn parameters_must_be_a_map() {
        let error = Manifest::start("circle", &[1, 2], [""; 3], 0).unwrap_err();
        assert!(error.to_string().contains("expected a map"));
    }
}
