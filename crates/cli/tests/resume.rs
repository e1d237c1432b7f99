//! Runs that are stopped end with the same bytes as runs that are not.
use std::time::Duration;

use crate::common::{
    self, assert_same, committed, interrupt, run, start, text, wait_for, with_output,
};
use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Runs of a second or two with many commits, frames, regions and both flows.
const RUNS: [&[&str]; 6] = [
    &[
        "flow",
        "builtin:cross",
        "--cells",
        "64",
        "--steps",
        "40",
        "--frames",
        "20",
        "--checkpoint-every",
        "2",
    ],
    &[
        "flow",
        "builtin:torus",
        "--cells",
        "32",
        "--tau",
        "1e-6",
        "--steps",
        "24",
        "--frames",
        "6",
        "--checkpoint-every",
        "3",
    ],
    &[
        "inpaint",
        "builtin:disc",
        "--cells",
        "64",
        "--mask",
        "box:0.1,0.1,0.9,0.9",
        "--ansatz",
        "empty",
        "--steps",
        "24",
        "--checkpoint-every",
        "1",
    ],
    &[
        "fair",
        "builtin:figure",
        "--cells",
        "40",
        "--tau",
        "1e-6",
        "--steps",
        "12",
        "--checkpoint-every",
        "1",
    ],
    &[
        "fair",
        "scan.obj",
        "--cells",
        "48",
        "--noise",
        "0.004",
        "--tau",
        "1e-9",
        "--steps",
        "12",
        "--checkpoint-every",
        "1",
    ],
    &[
        "mcf",
        "builtin:ring",
        "--method",
        "fe-implicit",
        "--steps",
        "24",
        "--checkpoint-every",
        "2",
    ],
];

#[test]
fn killed_runs_are_resumed_to_the_same_bytes() {
    let seed = std::env::var("WILLMORE_TEST_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok());
    let mut rng = ChaCha8Rng::seed_from_u64(seed.unwrap_or(1));
    // A fast run may be over before it can be killed.
    let mut kills = 0;
    for arguments in RUNS {
        let folder = tempfile::tempdir().unwrap();
        let scan = surfaces::samples::lever(48).unwrap();
        surfaces::write(folder.path().join("scan.obj"), scan.mesh()).unwrap();
        let [path, reference] = ["killed", "reference"].map(|name| folder.path().join(name));
        let whole = run(folder.path(), &with_output(arguments, "reference"));
        assert!(whole.status.success(), "{}", text(&whole.stderr));
        let mut child = start(folder.path(), &with_output(arguments, "killed"));
        for _ in 0..4 {
            let from = committed(&path).unwrap_or(0);
            if !wait_for(&path, from + rng.random_range(0..5), &mut child) {
                break;
            }
            std::thread::sleep(Duration::from_micros(rng.random_range(0..20_000)));
            child.kill().unwrap();
            child.wait().unwrap();
            kills += usize::from(!path.join("summary.json").exists());
            child = start(folder.path(), &["resume", "killed"]);
        }
        let ended = child.wait_with_output().unwrap();
        let message = text(&ended.stderr);
        assert!(ended.status.success(), "{arguments:?}: {message}");
        assert_same(&path, &reference);
    }
    assert!(kills >= RUNS.len(), "{kills} kills in all");
}

#[test]
fn interrupted_runs_end_with_130_and_are_resumed_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [path, reference] = ["stopped", "reference"].map(|name| folder.path().join(name));
    assert!(
        run(folder.path(), &with_output(RUNS[0], "reference"))
            .status
            .success()
    );
    let mut child = start(folder.path(), &with_output(RUNS[0], "stopped"));
    assert!(wait_for(&path, 4, &mut child));
    interrupt(&mut child);
    assert!(!path.join("summary.json").exists());
    let page = std::fs::read_to_string(path.join("index.html")).unwrap();
    assert!(page.contains("Not finished: "), "the page of a part");
    let resumed = run(folder.path(), &["resume", "stopped"]);
    assert!(resumed.status.success(), "{}", text(&resumed.stderr));
    assert_same(&path, &reference);
    // Once more: there is nothing left to do, but for what a kill right after the last commit leaves.
    std::fs::write(path.join("checkpoints/step-00000004.ckpt"), "old").unwrap();
    std::fs::write(path.join(".partial-1-index.html"), "<html>").unwrap();
    let again = run(folder.path(), &["resume", "stopped"]);
    assert!(again.status.success());
    assert_same(&path, &reference);
}

/// A file that a run has never written is not its own, also where it was to go on to other steps.
#[test]
fn a_run_that_was_never_over_writes_over_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let [path, saved] = ["run", "cross.svg"].map(|name| folder.path().join(name));
    let flow = [
        "flow",
        "builtin:cross",
        "--cells",
        "32",
        "--tau",
        "1e-7",
        "--steps",
        "500",
        "--checkpoint-every",
        "1",
        "--save",
        "cross.svg",
        "--output",
        "run",
    ];
    for arguments in [&flow[..], &["resume", "run", "--steps", "400"]] {
        let from = committed(&path).unwrap_or(0);
        let mut child = start(folder.path(), arguments);
        assert!(wait_for(&path, from + 1, &mut child));
        interrupt(&mut child);
    }
    std::fs::write(&saved, "mine").unwrap();
    let refused = run(folder.path(), &["resume", "run"]);
    let line = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{line}");
    // There is no option for another name.
    assert!(line.contains("move it away, or give --force"), "{line}");
    assert_eq!(std::fs::read(saved).unwrap(), b"mine");
}

/// The stored configuration alone makes the same run.
#[test]
fn the_configuration_of_a_run_makes_the_same_run() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let arguments = ["flow", "builtin:disc", "--cells", "32", "--steps", "3"];
    assert!(
        run(folder.path(), &with_output(&arguments, "first"))
            .status
            .success()
    );
    let again = [
        "flow",
        "--config",
        "first/config.toml",
        "--output",
        "second",
    ];
    assert!(run(folder.path(), &again).status.success());
    assert_same(&first, &second);
    // What is typed wins.
    let fewer = [
        "flow",
        "--config",
        "first/config.toml",
        "--output",
        "third",
        "--steps",
        "2",
    ];
    let outcome = common::outcome(folder.path(), &fewer);
    assert_eq!(outcome["steps"], 2);
}

#[test]
fn a_damaged_run_is_refused_and_can_be_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let [path, reference] = ["damaged", "reference"].map(|name| folder.path().join(name));
    assert!(
        run(folder.path(), &with_output(RUNS[0], "reference"))
            .status
            .success()
    );
    let mut child = start(folder.path(), &with_output(RUNS[0], "damaged"));
    assert!(wait_for(&path, 6, &mut child));
    interrupt(&mut child);
    let newest = path.join(format!(
        "checkpoints/step-{:08}.ckpt",
        committed(&path).unwrap()
    ));
    let mut bytes = std::fs::read(&newest).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&newest, bytes).unwrap();
    let refused = run(folder.path(), &["resume", "damaged"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        text(&refused.stderr).contains("is damaged"),
        "{}",
        text(&refused.stderr)
    );
    let recovered = run(folder.path(), &["resume", "damaged", "--recover"]);
    assert!(recovered.status.success(), "{}", text(&recovered.stderr));
    assert_same(&path, &reference);
}

/// A bit that has flipped in any file of a run, stopped or finished, is noticed before anything is done, and the file named.
#[test]
fn a_flipped_bit_in_any_file_is_found_and_the_file_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let arguments = [
        "flow",
        "builtin:torus",
        "--cells",
        "24",
        "--tau",
        "1e-6",
        "--steps",
        "40",
        "--frames",
        "2",
        "--checkpoint-every",
        "1",
    ];
    let mut child = start(folder.path(), &with_output(&arguments, "run"));
    assert!(wait_for(&path, 3, &mut child));
    interrupt(&mut child);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut flipped = std::collections::BTreeSet::new();
    for state in ["stopped", "finished"] {
        // The page is no part of the run, the lock is empty, and wall times (not among these) are no result.
        for (name, bytes) in common::files(&path) {
            if name.ends_with("index.html") || name.ends_with("lock") {
                continue;
            }
            // Until the run is finished, the table is written anew from the checkpoint.
            if state == "stopped" && name.ends_with("metrics.csv") {
                continue;
            }
            let mut damaged = bytes.clone();
            let bit = rng.random_range(0..8 * bytes.len());
            damaged[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(path.join(&name), damaged).unwrap();
            let refused = run(folder.path(), &["resume", "run"]);
            let (line, name) = (text(&refused.stderr), name.to_string_lossy().into_owned());
            let what = format!("{state}, bit {bit} of {name}: {line}");
            assert_eq!(refused.status.code(), Some(2), "{what}");
            assert!(line.contains(&name) && line.lines().count() == 1, "{what}");
            std::fs::write(path.join(&name), bytes).unwrap();
            flipped.insert(name);
        }
        assert!(run(folder.path(), &["resume", "run"]).status.success());
    }
    let kinds = ["config.toml", "metrics.csv", "start.ply", "final.npy"];
    assert!(
        kinds.iter().all(|kind| flipped.contains(*kind)),
        "{flipped:?}"
    );
    assert!(flipped.iter().any(|name| name.starts_with("checkpoints/")));
}

/// A run holds all that it goes on from: its input may be gone, and the folder elsewhere.
#[test]
fn runs_are_resumed_without_their_input_and_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let (drawing, path) = (folder.path().join("disc.png"), folder.path().join("first"));
    let frame = images::Frame::new([80, 80], [-1.0, 1.0], 0.025).unwrap();
    let square = geometry::shapes::Cuboid::new([0.5, 0.5]).unwrap();
    let picture = images::drawing(&frame, &square, Some(render::Rgb::WHITE));
    picture.unwrap().write_png(&drawing).unwrap();
    let arguments = [
        "flow",
        "disc.png",
        "--cells",
        "64",
        "--steps",
        "30",
        "--checkpoint-every",
        "3",
    ];
    assert!(
        run(folder.path(), &with_output(&arguments, "reference"))
            .status
            .success()
    );
    let mut child = start(folder.path(), &with_output(&arguments, "first"));
    assert!(wait_for(&path, 3, &mut child));
    interrupt(&mut child);
    std::fs::remove_file(drawing).unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let moved = folder.path().join("moved");
    std::fs::rename(&path, &moved).unwrap();
    let resumed = run(elsewhere.path(), &["resume", moved.to_str().unwrap()]);
    assert!(resumed.status.success(), "{}", text(&resumed.stderr));
    assert_same(&moved, &folder.path().join("reference"));
}
