//! Damage is noticed and named, and what does not belong together is refused.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex};

use files::{Disk, FileSystem};

use crate::toy::{
    self, FILES, STEPS, contents, quick_folder, run_to, uninterrupted, write_contents,
};
use files::Sha256;
use runs::{CheckpointState, Error, RunDirectory};
use serde_json::json;

/// A checkpoint with other content and the checksum that goes with it.
pub fn rehashed(bytes: &[u8]) -> Vec<u8> {
    let end = bytes.len().saturating_sub(32);
    [&bytes[..end], &Sha256::of(&bytes[..end])].concat()
}

/// The name of the damaged file and the step of the fallback.
fn damaged(folder: &Path) -> (String, Option<u64>) {
    match RunDirectory::open(folder) {
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            let (path, fallback) = match error {
                Error::Damaged { path, fallback, .. } => (path, fallback),
                other => panic!("{other}"),
            };
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap();
            assert!(message.contains(name), "{message}");
            (name.to_owned(), fallback)
        }
        Ok(_) => panic!("the damage was not noticed"),
    }
}

#[test]
fn every_flipped_bit_is_noticed_and_its_file_named() {
    for stop in [32, STEPS] {
        let folder = quick_folder();
        let run = folder.path().join("run");
        run_to(&run, stop).unwrap();
        // What came after the last commit is not part of the run.
        drop(RunDirectory::open(&run).unwrap().resume().unwrap());
        let files = toy::all_contents(&run);
        assert!(files.len() > 10, "{:?}", files.keys());
        let (mut flips, mut expected) = (0, 0);
        // What is replaced at any time is not checked.
        let unchecked = |name: &str| {
            ["lock", "timings.json"].contains(&name) || name == "metrics.csv" && stop < STEPS
        };
        let newest = files.keys().rfind(|name| name.starts_with("checkpoints/"));
        let newest = newest.unwrap();
        for (name, bytes) in files.iter().filter(|(name, _)| !unchecked(name)) {
            assert!(!bytes.is_empty(), "{name}");
            let path = run.join(name);
            let mut random = toy::Random(bytes.len() as u64);
            let some = (0..24).map(|_| random.below(8 * bytes.len() as u64) as usize);
            let ends = (0..8).chain(8 * bytes.len() - 8..8 * bytes.len());
            // These hold the other checksums: every byte.
            let sealed = name.starts_with("checkpoints/");
            expected += 40 + if sealed { bytes.len() } else { 0 };
            let each = (0..bytes.len()).map(|i| 8 * i + i % 8).filter(|_| sealed);
            for bit in ends.chain(some).chain(each) {
                let mut flipped = bytes.clone();
                flipped[bit / 8] ^= 1 << (bit % 8);
                fs::write(&path, flipped).unwrap();
                assert_eq!(damaged(&run).0, *name, "bit {bit}");
                flips += 1;
            }
            for shorter in [0, bytes.len() / 2, bytes.len() - 1] {
                fs::write(&path, &bytes[..shorter]).unwrap();
                assert_eq!(damaged(&run).0, *name, "{shorter} bytes");
            }
            fs::write(&path, [bytes.as_slice(), b" "].concat()).unwrap();
            assert_eq!(damaged(&run).0, *name, "one byte more");
            fs::remove_file(&path).unwrap();
            match RunDirectory::open(&run) {
                // The commit before, or none.
                Ok(stored) => {
                    assert!(name.starts_with("checkpoints/") && stored.state().step < STEPS);
                }
                Err(Error::NoRun(_)) => assert!(name == newest && stop == STEPS),
                Err(_) => assert_eq!(damaged(&run).0, *name, "missing"),
            }
            fs::create_dir(&path).unwrap();
            assert_eq!(damaged(&run).0, *name, "a folder");
            fs::remove_dir(&path).unwrap();
            #[cfg(unix)]
            {
                let elsewhere = folder.path().join("elsewhere");
                fs::write(&elsewhere, bytes).unwrap();
                std::os::unix::fs::symlink(&elsewhere, &path).unwrap();
                assert_eq!(damaged(&run).0, *name, "a link");
                fs::remove_file(&path).unwrap();
            }
            fs::write(&path, bytes).unwrap();
            RunDirectory::open(&run).unwrap();
        }
        fs::remove_file(run.join("lock")).unwrap();
        fs::create_dir(run.join("lock")).unwrap();
        assert_eq!(damaged(&run).0, "lock");
        println!("{flips} flipped bits");
        assert_eq!(flips, expected);
    }
}

#[test]
fn recovery_ends_with_the_same_bytes() {
    let expected = uninterrupted();
    let original = quick_folder();
    run_to(original.path().join("run").as_path(), 32).unwrap();
    // Commits at 27 and 30; the field of step 30 came between them.
    let original = toy::all_contents(&original.path().join("run"));
    let cases = [
        ("checkpoints/step-00000030.ckpt", 200, Some(27)),
        ("checkpoints/step-00000027.ckpt", 200, Some(30)),
        ("fields/step-0030.raw", 5, Some(27)),
        ("fields/step-0020.raw", 5, None),
        ("config.toml", 2, None),
    ];
    for (name, byte, fallback) in cases {
        let folder = quick_folder();
        let run = folder.path();
        write_contents(run, &original);
        let mut bytes = original[name].clone();
        bytes[byte] ^= 1;
        fs::write(run.join(name), bytes).unwrap();
        assert_eq!(damaged(run), (name.to_owned(), fallback));
        let Some(step) = fallback else {
            let error = RunDirectory::recover(run).unwrap_err();
            assert!(matches!(error, Error::Damaged { .. }), "{error}");
            continue;
        };
        let stored = RunDirectory::recover(run).unwrap();
        assert_eq!(*stored.state(), toy::state_at(step));
        let gone = run.join("checkpoints/step-00000030.ckpt");
        assert_eq!(stored.leftovers().any(|left| left == gone), step == 27);
        let (resumed, state) = stored.resume().unwrap();
        assert_eq!(state.step, step);
        assert_eq!(gone.exists(), step == 30);
        drop(resumed);
        RunDirectory::open(run).unwrap();
        run_to(run, STEPS).unwrap();
        assert!(contents(run) == expected, "{name}");
    }
}

#[test]
fn what_is_no_part_of_a_run_is_told_and_stays() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    run_to(&run, 32).unwrap();
    let left = ["fields/.partial-x", "fields/step-0040.raw", "extra/deep"];
    fs::create_dir(run.join("extra")).unwrap();
    for name in left {
        fs::write(run.join(name), "half").unwrap();
    }
    let stored = RunDirectory::open(&run).unwrap();
    assert!(!stored.is_finished());
    let files: Vec<_> = stored.files().collect();
    let written = [
        "fields/step-0010.raw",
        "fields/step-0020.raw",
        "fields/step-0030.raw",
    ];
    assert_eq!(files[0], "config.toml");
    assert_eq!(files[1..4], written);
    assert_eq!(
        files[4..],
        [
            "frames/first/a.png",
            "manifest.json",
            "metrics.csv",
            "timings.json"
        ]
    );
    assert_eq!(stored.read_text("config.toml").unwrap(), "rate = 3.9\n");
    assert!(stored.read_text("lock").is_err());
    // What is in a folder that goes is not listed.
    let listed: Vec<_> = stored.leftovers().map(Path::to_owned).collect();
    let expected = ["extra", left[0], left[1]].map(|name| run.join(name));
    assert_eq!(listed, expected);
    drop(stored);
    assert!(run.join("extra/deep").exists());
    let (resumed, _) = RunDirectory::open(&run).unwrap().resume().unwrap();
    assert!(run.join("extra/deep").exists());
    resumed.remove_others(|name| name == left[0]).unwrap();
    let found = [run.join(left[0]), run.join("extra")].map(|path| path.exists());
    assert_eq!(found, [false, true]);
}

#[test]
fn only_checkpoints_and_temporary_files_are_tidied_away() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    run_to(&run, STEPS).unwrap();
    let expected = toy::all_contents(&run);
    let left = ["fields/.partial-Xy12", "checkpoints/step-00000057.ckpt"];
    let own = [
        "fields/mine",
        "mine/.partial-x",
        "checkpoints/mine/step-1.ckpt",
        "checkpoints/notes",
    ];
    for name in left.iter().chain(&own) {
        fs::create_dir_all(run.join(name).parent().unwrap()).unwrap();
        fs::write(run.join(name), "half").unwrap();
    }
    fs::create_dir(run.join(".partial-folder")).unwrap();
    let stored = RunDirectory::open(&run).unwrap();
    assert_eq!(stored.leftovers().count(), 7);
    stored.tidy().unwrap();
    stored.tidy().unwrap();
    assert!(left.iter().all(|name| !run.join(name).exists()));
    assert!(run.join(".partial-folder").exists());
    assert!(own.iter().all(|name| run.join(name).exists()));
    drop(stored.resume().unwrap());
    assert!(own.iter().all(|name| run.join(name).exists()));
    for folder in ["mine", ".partial-folder", "checkpoints/mine"] {
        fs::remove_dir_all(run.join(folder)).unwrap();
    }
    for file in ["fields/mine", "checkpoints/notes"] {
        fs::remove_file(run.join(file)).unwrap();
    }
    assert!(toy::all_contents(&run) == expected);
}

#[test]
fn a_finished_run_can_be_extended() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    let mut first = RunDirectory::create(&run, &FILES, &toy::state_at(0)).unwrap();
    first.replace_file("metrics.csv", b"half").unwrap();
    first.write_file("metrics.csv", b"first").unwrap();
    first.finish(&toy::state_at(3)).unwrap();
    fs::write(run.join("metrics.csv"), "changed").unwrap();
    assert_eq!(damaged(&run), ("metrics.csv".to_owned(), None));
    fs::write(run.join("metrics.csv"), "first").unwrap();

    let (mut again, state) = RunDirectory::open(&run).unwrap().resume().unwrap();
    assert_eq!(state, toy::state_at(3));
    assert!(again.write_file("metrics.csv", b"").is_err());
    assert!(again.replace_file("metrics.csv", b"").is_err());
    drop(again);
    let stored = RunDirectory::open(&run).unwrap();
    let ended = |name: &str| name == "metrics.csv";
    let mut again = stored.reopen(&toy::state_at(3), ended, |_| false).unwrap();
    again.replace_file("metrics.csv", b"half").unwrap();
    again.commit(&toy::state_at(6)).unwrap();
    drop(again);
    fs::write(run.join("metrics.csv"), "changed").unwrap();
    let stored = RunDirectory::open(&run).unwrap();
    assert!(!stored.is_finished());
    assert_eq!(stored.read_text("metrics.csv").unwrap(), "changed");
    let (mut again, _) = stored.resume().unwrap();
    again.write_file("metrics.csv", b"second").unwrap();
    again.finish(&toy::state_at(9)).unwrap();
    let stored = RunDirectory::open(&run).unwrap();
    assert!(stored.is_finished() && stored.state().step == 9);
    let checkpoints = || fs::read_dir(run.join("checkpoints")).unwrap().count();
    assert_eq!(checkpoints(), 1);
    // Nor are checkpoints left of a run that goes on under other rules.
    let (mut again, _) = stored.resume().unwrap();
    again.commit(&toy::state_at(12)).unwrap();
    drop(again);
    assert_eq!(checkpoints(), 2);
    let stored = RunDirectory::open(&run).unwrap();
    // What may change is part of the run all the same, before anything is written.
    let changes = |name: &str| name == "metrics.csv";
    let reopened = stored.reopen(&toy::state_at(12), |_| false, changes);
    drop(reopened.unwrap());
    assert_eq!(checkpoints(), 1);
    fs::write(run.join("metrics.csv"), "changed").unwrap();
    let stored = RunDirectory::open(&run).unwrap();
    assert_eq!(stored.read_text("metrics.csv").unwrap(), "changed");
}

/// As it is kept for a moment by a process that is forked and has not yet become another program.
#[derive(Debug, Default)]
struct Copying(Mutex<Vec<File>>);

impl FileSystem for Copying {
    fn create_file(&self, path: &Path) -> io::Result<File> {
        let file = Disk.create_file(path)?;
        self.0.lock().unwrap().push(file.try_clone()?);
        Ok(file)
    }
}

#[test]
fn a_lock_ends_though_others_hold_copies_of_its_file() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    let copies = Arc::new(Copying::default());
    let first = RunDirectory::create_on(copies.clone(), &run, &[], &toy::state_at(0)).unwrap();
    let refused = RunDirectory::open(&run).unwrap_err();
    assert!(matches!(refused, Error::Locked(_)), "{refused}");
    drop(first);
    RunDirectory::open(&run).unwrap();
    assert!(!copies.0.lock().unwrap().is_empty());
}

#[test]
fn other_versions_are_refused_with_both_values() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    run_to(&run, 5).unwrap();
    let path = run.join("checkpoints/step-00000003.ckpt");
    let mut bytes = fs::read(&path).unwrap();
    assert_eq!(&bytes[..12], b"\x8fckpt\r\n\x1a\x06\0\0\0");
    for version in [3, 7] {
        bytes[8] = version;
        fs::write(&path, rehashed(&bytes)).unwrap();
        let message = RunDirectory::open(&run).unwrap_err().to_string();
        assert!(message.contains(&format!("version {version}")), "{message}");
        assert!(message.contains("version 6") && message.contains("step-00000003"));
    }
    // Before its first checkpoint, a run of version 1 has this alone.
    let old = folder.path().join("old");
    fs::create_dir(&old).unwrap();
    fs::write(old.join("index.json"), "{}").unwrap();
    let error = RunDirectory::open(&old).unwrap_err();
    assert!(matches!(error, Error::Version { found: 1, .. }), "{error}");
    let message = error.to_string();
    assert!(message.contains("index.json") && message.contains("finish the run"));
    assert!(!old.join("lock").exists());
}

#[test]
fn a_run_is_not_started_over_anything() {
    let start = |path: &Path| RunDirectory::create(path, &FILES, &toy::state_at(0));
    let folder = quick_folder();
    let run = folder.path().join("run");
    let first = start(&run).unwrap();
    let message = start(&run).unwrap_err().to_string();
    assert!(message.contains("a run") && message.contains("resume the run"));
    assert!(matches!(RunDirectory::open(&run), Err(Error::Locked(_))));
    drop(first);
    let stored = RunDirectory::open(&run).unwrap();
    assert!(matches!(RunDirectory::open(&run), Err(Error::Locked(_))));
    assert!(stored.state().step == 0 && !stored.is_finished());

    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    assert!(matches!(RunDirectory::open(&other), Err(Error::NoRun(_))));
    fs::write(other.join("config.toml"), "mine").unwrap();
    let message = start(&other).unwrap_err().to_string();
    assert!(message.contains("config.toml") && message.contains("empty"));
    // Even where a process was killed at the start, only its own files are.
    fs::write(other.join("lock"), "").unwrap();
    fs::write(other.join("thesis.tex"), "mine").unwrap();
    let message = start(&other).unwrap_err().to_string();
    assert!(message.contains("thesis.tex"), "{message}");
    assert_eq!(fs::read(other.join("config.toml")).unwrap(), b"mine");
}

#[test]
fn misuse_is_refused_and_changes_nothing() {
    let folder = quick_folder();
    let path = folder.path().join("run");
    let deep = (0..250).fold(json!(0), |inner, _| json!([inner]));
    let refused = RunDirectory::create(&path, &[], &CheckpointState::new(0, deep.clone()));
    assert!(refused.unwrap_err().to_string().contains("deeply"));
    let refused = RunDirectory::create(&path, &[("../a", b"")], &toy::state_at(0));
    assert!(matches!(refused, Err(Error::Invalid(_))));
    assert!(!path.exists());
    let mut run =
        RunDirectory::create(&path, &FILES, &CheckpointState::new(0, json!(null))).unwrap();
    for name in [
        "", "/a", "a/", "../a", "a/../b", ".hidden", "a b", "a\\b", "ü",
    ] {
        let error = run.write_file(name, b"").unwrap_err();
        assert!(matches!(error, Error::Invalid(_)), "{name:?}");
        assert!(run.replace_file(name, b"").is_err());
    }
    for name in ["Lock", "checkpoints/a"] {
        let message = run.write_file(name, b"").unwrap_err().to_string();
        assert!(message.contains("itself"), "{message}");
    }
    let absent = run.adopt_file("fields/absent").unwrap_err();
    assert!(matches!(absent, Error::Damaged { .. }) && absent.to_string().contains("is missing"));
    run.write_file("a/b", b"x").unwrap();
    assert!(matches!(run.write_file("a/b", b""), Err(Error::Invalid(_))));
    assert!(run.replace_file("a/b", b"").is_err());

    let unusable = |state: &CheckpointState, run: &mut RunDirectory, reason: &str| {
        let message = run.commit(state).unwrap_err().to_string();
        assert!(message.contains(reason), "{message}");
    };
    unusable(&CheckpointState::new(1, deep), &mut run, "deeply");
    // Two hundred levels are read back.
    let nested = (0..200).fold(json!(0), |inner, _| json!([inner]));
    run.commit(&CheckpointState::new(1, nested.clone()))
        .unwrap();
    drop(run);
    let (mut run, kept) = RunDirectory::open(&path).unwrap().resume().unwrap();
    assert_eq!(kept.notes, nested);
    let state = |step| CheckpointState::new(step, json!(0.1 + 0.2));
    // Bits, not numbers.
    let odd = vec![f64::NAN, -0.0, f64::NEG_INFINITY, f64::from_bits(1)];
    let fourth = state(4).with_array("odd", odd.clone());
    run.commit(&fourth).unwrap();
    run.commit(&fourth).unwrap();
    unusable(&state(4), &mut run, "step 4");
    let other = state(4).with_array("odd", vec![0.0; 4]);
    unusable(&other, &mut run, "step 4");
    unusable(&CheckpointState::new(4, json!(0)), &mut run, "step 4");
    unusable(&state(3), &mut run, "step 3");
    run.commit(&state(5).with_array("odd", odd.clone()))
        .unwrap();
    drop(run);

    let stored = RunDirectory::open(&path).unwrap();
    assert_eq!(stored.files().next(), Some("a/b"));
    let (_, state) = stored.resume().unwrap();
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(state.array("odd").unwrap()), bits(&odd));
    assert!(state.array("even").is_none());
    assert_eq!(state.notes, json!(0.1 + 0.2));
}
