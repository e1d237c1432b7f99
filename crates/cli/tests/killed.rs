//! Twenty kills at random moments, each followed by a resumption to the same bytes.
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

use crate::common::{assert_same, run, start, text, wait_for, with_output};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const KILLS: u64 = 20;

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

/// Kills 0 and 1 come wherever the process is before its first commit, the others spread over all steps; every third one
/// strikes while a checkpoint is written.
#[test]
fn twenty_kills_at_random_moments() {
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
    let (mut unfinished, mut torn) = (0, 0);
    for kill in 0..KILLS {
        let which = usize::from(kill % 2 == 1);
        let (steps, arguments) = RUNS[which];
        let name = format!("killed{kill}");
        let path = folder.path().join(&name);
        let mut child = start(folder.path(), &with_output(arguments, &name));
        if kill >= 2 {
            // A part of the steps for each, and a moment within it.
            let part = |k: u64| (k - 2) * steps / (KILLS - 2);
            let step = rng.random_range(part(kill)..part(kill + 1).max(part(kill) + 1));
            wait_for(&path, step, &mut child);
        }
        std::thread::sleep(Duration::from_micros(rng.random_range(0..20_000)));
        if kill % 3 == 2 {
            wait_for_writing(&path, &mut child);
        }
        child.kill().unwrap();
        child.wait().unwrap();
        unfinished += usize::from(!path.join("summary.json").exists());
        torn += usize::from(is_writing(&path.join("checkpoints")));
        // Before there is an index there is no run, and the same command starts it.
        let resumed = if path.join("index.json").exists() {
            run(folder.path(), &["resume", &name])
        } else {
            run(folder.path(), &with_output(arguments, &name))
        };
        assert!(
            resumed.status.success(),
            "{name}: {}",
            text(&resumed.stderr)
        );
        assert_same(&path, &folder.path().join(format!("reference{which}")));
    }
    println!(
        "{unfinished} of {KILLS} runs were killed before their end, {torn} while a checkpoint was written"
    );
    assert!(unfinished >= 15, "{unfinished} of {KILLS} only");
    assert!(torn >= 1, "no kill struck while a checkpoint was written");
}
