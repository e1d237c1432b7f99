//! The toy as a process of its own: killed, interrupted, and out of space.

use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::toy::{self, FILES, Random, STEPS, Toy, contents, run_to, state_at, uninterrupted};
use files::Disk;
use runs::{Error, Interrupt, RunDirectory};

/// The folder of the run, the milliseconds of a step; both set for the process.
const FOLDER: &str = "RUNS_TEST_FOLDER";
const PAUSE: &str = "RUNS_TEST_PAUSE";

#[test]
#[ignore = "the process that the other tests start"]
fn process() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else {
        return; // not started by another test
    };
    let pause = std::env::var(PAUSE).unwrap().parse().unwrap();
    let interrupt = Interrupt::catch().unwrap();
    // Now signals are caught.
    std::fs::write(folder.with_extension("ready"), "").unwrap();
    let toy = Toy {
        interrupt: interrupt.clone(),
        pause: Duration::from_millis(pause),
        ..Toy::on(Arc::new(Disk))
    };
    let result = toy::run(&folder, &toy);
    std::process::exit(match result {
        Ok(()) if interrupt.requested() => Interrupt::EXIT_CODE.into(),
        Ok(()) => 0,
        Err(error) => {
            eprintln!("{error}");
            1
        }
    });
}

/// The process, through a shell that first does `before`.
fn start(folder: &Path, pause: u64, before: &str) -> Child {
    let _ = std::fs::remove_file(folder.with_extension("ready"));
    Command::new("sh")
        .args(["-c", &format!("{before} exec \"$0\" \"$@\"")])
        .arg(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "killed::process", "--nocapture"])
        .env(FOLDER, folder)
        .env(PAUSE, pause.to_string())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    let status = Command::new("kill").args(["-s", name, &id]).status();
    assert!(status.unwrap().success());
}

fn await_ready(folder: &Path) {
    let begin = Instant::now();
    while !folder.with_extension("ready").exists() {
        assert!(begin.elapsed() < Duration::from_mins(1), "it never started");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The exit status within a time that is short of a step of the process where that matters.
fn await_end(child: &mut Child) -> ExitStatus {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if begin.elapsed() > Duration::from_mins(1) {
            child.kill().unwrap();
            panic!("it did not end");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn killed_at_random_moments_it_ends_with_the_same_bytes() {
    killed_at_random_moments(3);
}

#[test]
#[ignore = "long"]
fn killed_at_many_moments_it_ends_with_the_same_bytes() {
    killed_at_random_moments(40);
}

fn killed_at_random_moments(most: u64) {
    let expected = uninterrupted();
    let root = tempfile::tempdir().unwrap();
    let whole = root.path().join("whole");
    let begin = Instant::now();
    assert!(await_end(&mut start(&whole, 2, "")).success());
    let duration = begin.elapsed();
    assert!(contents(&whole) == expected);

    let mut random = Random(20);
    let (mut kills, mut runs, mut leftovers) = (0, 0, 0);
    while kills < most {
        runs += 1;
        let folder = root.path().join(format!("run-{runs}"));
        loop {
            let mut child = start(&folder, 2, "");
            let moment = duration.mul_f64(random.below(1000) as f64 / 1400.0);
            std::thread::sleep(moment);
            child.kill().unwrap();
            let status = child.wait().unwrap();
            if let Ok(stored) = RunDirectory::open(&folder) {
                leftovers += stored.leftovers().count();
                assert_eq!(*stored.state(), state_at(stored.state().step));
            }
            match status.signal() {
                Some(9) => kills += 1,
                _ => assert!(status.success(), "{status}"),
            }
            if status.success() {
                break;
            }
            if kills >= most {
                run_to(&folder, STEPS).unwrap();
                break;
            }
        }
        assert!(contents(&folder) == expected, "run {runs}");
    }
    println!("{kills} kills in {runs} runs of {duration:?}, {leftovers} leftovers");
}

#[test]
fn one_signal_commits_and_two_end_at_once() {
    for name in ["INT", "TERM"] {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("run");
        let mut child = start(&folder, 100, "");
        await_ready(&folder);
        std::thread::sleep(Duration::from_millis(150));
        signal(&child, name);
        assert_eq!(await_end(&mut child).code(), Some(130));
        let stored = RunDirectory::open(&folder).unwrap();
        let step = stored.state().step;
        assert!(step < 50, "it went on to step {step}");
        drop(stored);
        run_to(&folder, STEPS).unwrap();
        assert!(contents(&folder) == uninterrupted());

        // A step of ten minutes.
        let stuck = root.path().join("stuck");
        let mut child = start(&stuck, 600_000, "");
        await_ready(&stuck);
        signal(&child, name);
        std::thread::sleep(Duration::from_millis(300));
        assert!(child.try_wait().unwrap().is_none(), "one signal ended it");
        signal(&child, name);
        assert_eq!(await_end(&mut child).code(), Some(130));
    }
}

#[test]
fn the_signals_of_a_process_set_one_flag() {
    let [first, second] = [(); 2].map(|()| Interrupt::catch().unwrap());
    first.request();
    assert!(second.requested());
}

/// Files cannot exceed a limit: the system's own error in the middle of a write.
#[test]
fn where_the_system_refuses_to_write_the_last_commit_stays() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    let mut last = 0;
    // Blocks of 512 bytes. The checkpoint is the longest file, and grows.
    for blocks in [1, 2, 3] {
        let limit = format!("trap '' XFSZ; ulimit -f {blocks};");
        let output = start(&folder, 0, &limit).wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        let message = String::from_utf8(output.stderr).unwrap();
        let message = message.lines().last().unwrap();
        assert!(message.starts_with("could not write"), "{message}");
        assert!(message.contains("File too large"), "{message}");
        if let Ok(stored) = RunDirectory::open(&folder) {
            last = stored.state().step;
        }
    }
    assert!(last > 0, "no run came far enough");
    run_to(&folder, STEPS).unwrap();
    assert!(contents(&folder) == uninterrupted());
}

/// Disks of all sizes up to one that is large enough, where the system lets users mount one.
#[cfg(target_os = "linux")]
#[test]
fn on_a_full_disk_the_last_commit_stays() {
    const SCRIPT: &str = "mount -t tmpfs -o size=$SIZE tmpfs \"$DISK\" || exit 77
        \"$0\" \"$@\"; code=$?
        cp -R \"$DISK/.\" \"$COPY\" || exit 78
        exit $code";
    let expected = uninterrupted();
    let mut steps = Vec::new();
    for size in (8..).step_by(4) {
        let root = tempfile::tempdir().unwrap();
        let (disk, copy) = (root.path().join("disk"), root.path().join("copy"));
        for folder in [&disk, &copy] {
            std::fs::create_dir(folder).unwrap();
        }
        let process = Command::new("unshare")
            .args(["-rm", "sh", "-c", SCRIPT])
            .arg(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "killed::process", "--nocapture"])
            .env("SIZE", format!("{size}k"))
            .env("DISK", &disk)
            .env("COPY", &copy)
            .env(FOLDER, disk.join("run"))
            .env(PAUSE, "0")
            .output();
        let output = match process {
            Ok(output) if output.status.code() != Some(77) => output,
            other => {
                println!("SKIPPED, no disk can be mounted: {other:?}");
                return;
            }
        };
        let message = String::from_utf8(output.stderr).unwrap();
        let run = copy.join("run");
        if output.status.success() {
            assert!(contents(&run) == expected);
            println!("{size} KiB are enough; steps before: {steps:?}");
            break;
        }
        assert_eq!(output.status.code(), Some(1), "{message}");
        let message = message.lines().last().unwrap();
        assert!(message.starts_with("could not "), "{message}");
        assert!(message.contains("No space left"), "{message}");
        match RunDirectory::open(&run) {
            Ok(stored) => steps.push(stored.state().step),
            Err(error) => assert!(matches!(error, Error::NoRun(_)), "{error}"),
        }
        run_to(&run, STEPS).unwrap();
        assert!(contents(&run) == expected, "{size} KiB");
    }
    assert!(steps.iter().any(|step| (3..STEPS).contains(step)));
}

#[test]
fn a_run_is_locked_against_other_processes() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    let run = RunDirectory::create(&folder, &FILES, &state_at(0)).unwrap();
    let output = start(&folder, 0, "").wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("another process works on"), "{message}");
    assert_eq!(output.status.code(), Some(1));
    drop(run);
    assert!(await_end(&mut start(&folder, 0, "")).success());
}
