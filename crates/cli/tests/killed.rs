//! Kills at random moments, each followed by a resumption to the same bytes.
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use crate::common::{assert_same, committed, run, start, text, wait_for, with_output};
use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Runs with a commit after every step, as far as they go.
const RUNS: [(u64, &[&str]); 2] = [
    (
        25,
        &[
            "flow",
            "builtin:cross",
            "--cells",
            "32",
            "--steps",
            "25",
            "--frames",
            "5",
            "--checkpoint-every",
            "1",
        ],
    ),
    (
        12,
        &[
            "flow",
            "builtin:torus",
            "--cells",
            "24",
            "--tau",
            "1e-6",
            "--steps",
            "12",
            "--checkpoint-every",
            "1",
        ],
    ),
];

/// Whether a file is being written in the folder.
fn is_writing(folder: &Path) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return false;
    };
    (entries.flatten()).any(|entry| entry.file_name().to_string_lossy().starts_with(".partial-"))
}

/// Waits until a checkpoint is being written.
fn wait_for_writing(run: &Path, child: &mut Child) {
    let clock = Instant::now();
    while !is_writing(&run.join("checkpoints")) {
        if child.try_wait().unwrap().is_some() {
            return;
        }
        assert!(clock.elapsed() < Duration::from_mins(1), "no checkpoint");
        std::hint::spin_loop();
    }
}

/// A run that was killed before its end, and whether while a checkpoint was written. Kills 0 and 1 come wherever the process is
/// before its first commits, the others spread over all steps; every third one strikes while a checkpoint is written. A kill
/// that comes after the end of its run is none, and is repeated.
fn killed(rng: &mut ChaCha8Rng, folder: &Path, kill: u64, kills: u64) -> bool {
    let (steps, arguments) = RUNS[usize::from(kill % 2 == 1)];
    let name = format!("killed{kill}");
    let path = folder.join(&name);
    for _ in 0..10 {
        let mut child = start(folder, &with_output(arguments, &name));
        if kill >= 2 {
            // A part of the steps for each, and a moment within it.
            let part = |k: u64| (k - 2) * steps / (kills - 2);
            let step = rng.random_range(part(kill)..part(kill + 1).max(part(kill) + 1));
            wait_for(&path, step, &mut child);
        }
        std::thread::sleep(Duration::from_micros(rng.random_range(0..20_000)));
        if kill % 3 == 2 {
            wait_for_writing(&path, &mut child);
        }
        child.kill().unwrap();
        child.wait().unwrap();
        if !path.join("summary.json").exists() {
            return is_writing(&path.join("checkpoints"));
        }
        std::fs::remove_dir_all(&path).unwrap();
    }
    panic!("kill {kill} came too late ten times");
}

/// Kills as many runs, and resumes each to the same bytes.
fn kills_at_random_moments(kills: u64) {
    let seed = std::env::var("WILLMORE_TEST_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok());
    let mut rng = ChaCha8Rng::seed_from_u64(seed.unwrap_or(20));
    let folder = tempfile::tempdir().unwrap();
    for (k, (_, arguments)) in RUNS.iter().enumerate() {
        let whole = run(
            folder.path(),
            &with_output(arguments, &format!("reference{k}")),
        );
        assert!(whole.status.success(), "{}", text(&whole.stderr));
    }
    let (mut torn, mut kill) = (0, 0);
    // Further ones, if no checkpoint was torn by chance.
    while kill < kills || (torn == 0 && kill < 3 * kills) {
        torn += u64::from(killed(&mut rng, folder.path(), kill % kills, kills));
        let which = kill % kills % 2;
        let (name, (_, arguments)) = (format!("killed{}", kill % kills), RUNS[which as usize]);
        let path = folder.path().join(&name);
        // Before there is a checkpoint there is no run, and the same command starts it.
        let resumed = if committed(&path).is_some() {
            run(folder.path(), &["resume", &name])
        } else {
            run(folder.path(), &with_output(arguments, &name))
        };
        let error = text(&resumed.stderr);
        assert!(resumed.status.success(), "{name}: {error}");
        assert_same(&path, &folder.path().join(format!("reference{which}")));
        std::fs::remove_dir_all(&path).unwrap();
        kill += 1;
    }
    println!("{kill} runs were killed, {torn} while a checkpoint was written");
    assert!(torn >= 1, "no kill struck while a checkpoint was written");
}

#[test]
fn six_kills_at_random_moments() {
    kills_at_random_moments(6);
}

#[test]
#[ignore = "takes minutes: the long form of the one above"]
fn twenty_kills_at_random_moments() {
    kills_at_random_moments(20);
}

/// The step that is being made takes seconds and is dropped; what is there resumes to the bytes of the run without a signal.
#[test]
fn a_signal_ends_the_program_within_two_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = "flow builtin:torus --cells 48 --tau 1e-5 --steps 2 --storage dense";
    let arguments: Vec<&str> = arguments.split(' ').collect();
    let clock = Instant::now();
    let whole = run(folder.path(), &with_output(&arguments, "whole"));
    assert!(whole.status.success(), "{}", text(&whole.stderr));
    let whole_time = clock.elapsed();
    let mut dropped = 0;
    for (signal, part) in [("-TERM", 0.3), ("-INT", 0.5), ("-TERM", 0.8)] {
        let name = format!("ended{part}");
        let path = folder.path().join(&name);
        let mut child = start(folder.path(), &with_output(&arguments, &name));
        // From here on signals are caught.
        wait_for(&path, 0, &mut child);
        std::thread::sleep(whole_time.mul_f64(part));
        let id = child.id().to_string();
        let clock = Instant::now();
        Command::new("kill").args([signal, &id]).status().unwrap();
        let code = child.wait().unwrap().code();
        assert!(clock.elapsed() < Duration::from_secs(2));
        if code == Some(0) {
            // It was over.
            continue;
        }
        assert_eq!(code, Some(130));
        dropped += 1;
        let resumed = run(folder.path(), &["resume", &name]);
        assert!(resumed.status.success(), "{}", text(&resumed.stderr));
        assert_same(&path, &folder.path().join("whole"));
    }
    assert!(dropped > 0, "no signal came in time");
}
