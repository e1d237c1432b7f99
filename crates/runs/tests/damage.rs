//! Damage is noticed and named, and what does not belong together is refused.

use std::fs;
use std::path::Path;

use crate::common::{
    self, STEPS, contents, identity, quick_folder, run_to, uninterrupted, write_contents,
};
use runs::{Checkpoint, Damage, Error, Identity, RunDirectory, State};
use serde_json::json;

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
        drop(RunDirectory::open(&run).unwrap().resume(&identity()));
        let files = common::all_contents(&run);
        assert!(files.len() > 10, "{:?}", files.keys());
        let mut flips = 0;
        for (name, bytes) in files.iter().filter(|(name, _)| *name != "lock") {
            assert!(!bytes.is_empty(), "{name}");
            let path = run.join(name);
            let mut random = common::Random(bytes.len() as u64);
            let some = (0..24).map(|_| random.below(8 * bytes.len() as u64) as usize);
            let ends = (0..8).chain(8 * bytes.len() - 8..8 * bytes.len());
            // These hold the other checksums, or their own: every byte.
            let sealed = name == "index.json" || name == "timings.json";
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
            if name != "metrics.csv" {
                fs::write(&path, [bytes.as_slice(), b" "].concat()).unwrap();
                assert_eq!(damaged(&run).0, *name, "one byte more");
            }
            fs::remove_file(&path).unwrap();
            if name == "index.json" {
                assert!(matches!(RunDirectory::open(&run), Err(Error::NoRun { .. })));
            } else {
                assert_eq!(damaged(&run).0, *name, "missing");
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
        // 24 and the ends for each file, and the sealed ones whole.
        assert!(flips > 40 * (files.len() - 1) + 2000, "{flips}");
    }
}

#[test]
fn recovery_ends_with_the_same_bytes() {
    let expected = uninterrupted();
    let original = quick_folder();
    run_to(original.path().join("run").as_path(), 32).unwrap();
    // Commits at 27 and 30; the field of step 30 came between them.
    let original = common::all_contents(&original.path().join("run"));
    let rows: Vec<usize> = original["metrics.csv"]
        .iter()
        .enumerate()
        .filter(|(_, b)| **b == b'\n')
        .map(|(i, _)| i)
        .collect();
    let cases = [
        ("checkpoints/step-00000030.ckpt", 200, Some(27)),
        ("checkpoints/step-00000027.ckpt", 200, Some(30)),
        ("fields/step-0030.raw", 5, Some(27)),
        ("fields/step-0020.raw", 5, None),
        ("timings.json", 90, Some(30)),
        // In the rows 29 and 4.
        ("metrics.csv", rows[28] + 2, Some(27)),
        ("metrics.csv", rows[3] + 2, None),
        ("index.json", 300, None),
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
        assert_eq!(stored.checkpoint().unwrap().state, common::state_at(step));
        let resumed = stored.resume(&identity()).unwrap();
        assert_eq!(resumed.run.committed_step(), step);
        let gone = "checkpoints/step-00000030.ckpt";
        assert_eq!(resumed.removed.contains(&run.join(gone)), step == 27);
        assert!(resumed.removed_metrics > 0);
        drop(resumed);
        RunDirectory::open(run).unwrap();
        run_to(run, STEPS).unwrap();
        assert!(contents(run) == expected, "{name}");
    }
}

#[test]
fn what_a_killed_process_leaves_is_removed_and_told() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    run_to(&run, 32).unwrap();
    let left = ["fields/.partial-x", "fields/step-0040.raw", "extra/deep"];
    fs::create_dir(run.join("extra")).unwrap();
    for name in left {
        fs::write(run.join(name), "half").unwrap();
    }
    let stored = RunDirectory::open(&run).unwrap();
    assert_eq!(
        stored.to_string(),
        "logistic map at step 30, not finished, 6 files"
    );
    assert_eq!(stored.config().unwrap(), "rate = 3.9\n");
    assert_eq!(stored.manifest().unwrap()["steps"], STEPS);
    let listed: Vec<_> = stored.leftovers().map(Path::to_owned).collect();
    let expected = ["extra", "extra/deep", left[0], left[1]].map(|name| run.join(name));
    assert_eq!(listed, expected);
    // Another run leaves everything where it is.
    let mut other = identity();
    other.options = "none".into();
    assert!(matches!(stored.resume(&other), Err(Error::Mismatch { .. })));
    assert!(run.join("extra/deep").exists());
    let resumed = RunDirectory::open(&run)
        .unwrap()
        .resume(&identity())
        .unwrap();
    assert_eq!(resumed.removed, expected);
    // The rows of steps 31 and 32.
    assert!(resumed.removed_metrics > 10);
    assert!(!run.join("extra").exists());
}

#[test]
fn what_was_made_with_something_else_is_refused_with_both_values() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    run_to(&run, 5).unwrap();
    let refusal = |change: &dyn Fn(&mut Identity)| {
        let mut other = identity();
        change(&mut other);
        let stored = RunDirectory::open(&run).unwrap();
        let checkpoint = stored.checkpoint().unwrap().identity.clone();
        let of_checkpoint = checkpoint.require(&other, Path::new("step.ckpt"));
        assert!(matches!(of_checkpoint, Err(Error::Mismatch { .. })));
        let message = stored.resume(&other).unwrap_err().to_string();
        assert!(!message.contains('\n'), "{message}");
        message
    };
    let message = refusal(&|i| i.kind = "tent map".into());
    assert!(message.contains("kind") && message.contains("\"logistic map\""));
    assert!(message.contains("\"tent map\""), "{message}");
    let message = refusal(&|i| i.grid.cells = vec![8, 8]);
    assert!(message.contains("grid"), "{message}");
    assert!(message.contains("[4, 4]") && message.contains("[8, 8]"));
    let message = refusal(&|i| i.grid.side = 2.5);
    assert!(message.contains("2.5"), "{message}");
    let message = refusal(&|i| i.network.as_mut().unwrap().checksum = "5c".into());
    let weights = runs::fingerprint("weights");
    assert!(message.contains("network") && message.contains(&weights));
    assert!(message.contains("5c"), "{message}");
    let message = refusal(&|i| i.network = None);
    assert!(message.contains("none now"), "{message}");
    let message = refusal(&|i| i.options = "ab".into());
    assert!(message.contains("options") && message.contains(&identity().options));
    assert!(message.contains("fingerprint ab"), "{message}");
    // The program alone is the caller's business.
    let mut newer = identity();
    newer.program = "toy 0.2".into();
    RunDirectory::open(&run).unwrap().resume(&newer).unwrap();
}

#[test]
fn other_versions_are_refused_with_both_values() {
    let folder = quick_folder();
    let run = folder.path().join("run");
    run_to(&run, 5).unwrap();
    let path = run.join("checkpoints/step-00000003.ckpt");
    let mut bytes = fs::read(&path).unwrap();
    assert_eq!(&bytes[..12], b"\x8fckpt\r\n\x1a\x01\0\0\0");
    bytes[8] = 7;
    let error = Checkpoint::from_bytes(&bytes, &path).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("version 7") && message.contains("version 1"));
    assert!(message.contains("step-00000003"), "{message}");
}

#[test]
fn a_run_is_not_started_over_anything() {
    let start = |path: &Path| RunDirectory::create(path, &identity(), &json!({}), "");
    let folder = quick_folder();
    let run = folder.path().join("run");
    let first = start(&run).unwrap();
    let message = start(&run).unwrap_err().to_string();
    assert!(message.contains("a run") && message.contains("resume it"));
    assert!(matches!(
        RunDirectory::open(&run),
        Err(Error::Locked { .. })
    ));
    drop(first);
    let stored = RunDirectory::open(&run).unwrap();
    assert!(matches!(
        RunDirectory::open(&run),
        Err(Error::Locked { .. })
    ));
    assert!(stored.checkpoint().is_none() && !stored.is_finished());

    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    assert!(matches!(
        RunDirectory::open(&other),
        Err(Error::NoRun { .. })
    ));
    fs::write(other.join("config.toml"), "mine").unwrap();
    let message = start(&other).unwrap_err().to_string();
    assert!(message.contains("config.toml") && message.contains("empty folder"));
    // Even where a process was killed at the start, only its own files are.
    fs::write(other.join("lock"), "").unwrap();
    fs::write(other.join("thesis.tex"), "mine").unwrap();
    let message = start(&other).unwrap_err().to_string();
    assert!(message.contains("thesis.tex"), "{message}");
    assert_eq!(fs::read(other.join("config.toml")).unwrap(), b"mine");
}

#[test]
fn misuse_is_refused_and_changes_nothing() {
    #[derive(serde::Serialize)]
    struct Row {
        a: f64,
    }
    #[derive(serde::Serialize)]
    struct Other {
        b: f64,
    }
    let folder = quick_folder();
    let mut run =
        RunDirectory::create(folder.path().join("run"), &identity(), &json!({}), "").unwrap();
    for name in [
        "", "/a", "a/", "../a", "a/../b", ".hidden", "a b", "a\\b", "ü",
    ] {
        let error = run.write_file(name, |_| Ok(())).unwrap_err();
        assert!(matches!(error, Error::Name { .. }), "{name:?}");
    }
    for name in ["index.json", "Lock", "metrics.csv", "checkpoints/a"] {
        let message = run.write_file(name, |_| Ok(())).unwrap_err().to_string();
        assert!(message.contains("itself"), "{message}");
    }
    assert!(matches!(
        run.adopt_file("fields/absent"),
        Err(Error::Damaged {
            damage: Damage::Missing,
            ..
        })
    ));
    // A failing producer leaves the name free.
    let failed = run.write_file("a/b", |_| Err(std::io::Error::other("no")));
    assert!(matches!(failed, Err(Error::Write(_))));
    run.write_file("a/b", |out| out.write_all(b"x")).unwrap();
    assert!(matches!(
        run.write_file("a/b", |_| Ok(())),
        Err(Error::Exists { .. })
    ));

    run.metric(&Row { a: 1.5 }).unwrap();
    let error = run.metric(&Other { b: 1.0 }).unwrap_err().to_string();
    assert!(
        error.contains("\"a\"") && error.contains("\"b\""),
        "{error}"
    );
    assert!(matches!(
        run.metric(&[1.0, 2.0]),
        Err(Error::Columns { .. })
    ));

    let unusable = |state: &State, run: &mut RunDirectory, reason: &str| {
        let message = run.commit(state).unwrap_err().to_string();
        assert!(message.contains(reason), "{message}");
    };
    unusable(&State::new(1, f64::NAN), &mut run, "finite");
    let twice = State::new(1, 0.0)
        .with_array("u", vec![])
        .with_array("u", vec![]);
    unusable(&twice, &mut run, "two arrays");
    unusable(
        &State::new(1, 0.0).with_array("", vec![]),
        &mut run,
        "no name",
    );
    let long = State::new(1, 0.0).with_notes("x".repeat(Checkpoint::MAX_HEADER));
    unusable(&long, &mut run, "1048576");
    // Bits, not numbers.
    let odd = vec![f64::NAN, -0.0, f64::NEG_INFINITY, f64::from_bits(1)];
    let mut state = State::new(4, 0.1 + 0.2).with_array("odd", odd.clone());
    run.commit(&state).unwrap();
    run.commit(&state).unwrap();
    state.time = 0.5;
    unusable(&state, &mut run, "step 4");
    unusable(&State::new(3, 0.0), &mut run, "step 3");
    run.metric(&Row { a: 2.5 }).unwrap();
    run.commit(&State::new(5, 0.5).with_array("odd", odd.clone()))
        .unwrap();
    drop(run);

    let stored = RunDirectory::open(folder.path().join("run")).unwrap();
    assert_eq!(stored.files().last(), Some("a/b"));
    let resumed = stored.resume(&identity()).unwrap();
    let mut state = resumed.state.unwrap();
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&state.take_array("odd").unwrap()), bits(&odd));
    assert!(state.take_array("odd").is_err());
    let metrics = fs::read(resumed.run.path().join("metrics.csv")).unwrap();
    assert_eq!(metrics, b"a\n1.5\n2.5\n");
}
