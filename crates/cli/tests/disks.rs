//! Full and read-only disks, where the system lets users mount one.
use std::path::Path;
use std::process::{Command, Output};

use crate::common::{assert_same, interrupt, outcome, run, start, text, wait_for, with_output};

const RUN: [&str; 10] = [
    "flow",
    "builtin:disc",
    "--cells",
    "16",
    "--steps",
    "6",
    "--frames",
    "3",
    "--checkpoint-every",
    "1",
];

/// Runs the program between shell commands that may use `$DISK`, an empty folder in which a disk may be mounted, `$SIZE` and
/// `$COPY`. None if no disk can be mounted.
fn on_a_disk(folder: &Path, script: [&str; 2], size: usize, arguments: &[&str]) -> Option<Output> {
    let [before, after] = script;
    let script = format!("{before}\n\"$0\" \"$@\"; code=$?\n{after}\nexit $code");
    let process = Command::new("unshare")
        .current_dir(folder)
        .args(["-rm", "sh", "-c", &script, env!("CARGO_BIN_EXE_willmore")])
        .args(arguments)
        .env("SIZE", format!("{size}k"))
        .env("DISK", folder.join("disk"))
        .env("COPY", folder.join("copy"))
        .output();
    match process {
        Ok(output) if output.status.code() != Some(77) => Some(output),
        other => {
            println!("SKIPPED, no disk can be mounted: {other:?}");
            None
        }
    }
}

fn assert_refused(output: &Output, reason: &str) {
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.starts_with("error: "), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(error.contains(reason), "{error}");
}

/// Disks of all sizes up to one that is large enough. With more room the run goes on to the same bytes.
#[test]
fn on_a_full_disk_there_is_one_line_and_the_run_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    outcome(folder.path(), &with_output(&RUN, "reference"));
    let reference = folder.path().join("reference");
    let mount = "mount -t tmpfs -o size=$SIZE tmpfs \"$DISK\" || exit 77";
    let keep = "cp -R \"$DISK/run\" \"$COPY\" || exit 78";
    let mut resumed = 0;
    for size in (16..).step_by(24) {
        let attempt = tempfile::tempdir_in(folder.path()).unwrap();
        std::fs::create_dir(attempt.path().join("disk")).unwrap();
        let arguments = with_output(&RUN, "disk/run");
        let arguments = [&arguments[..], &["--quiet"]].concat();
        let Some(output) = on_a_disk(attempt.path(), [mount, keep], size, &arguments) else {
            return;
        };
        let copy = attempt.path().join("copy");
        if output.status.success() {
            assert_same(&copy, &reference);
            println!("{size} KiB are enough; {resumed} runs were resumed");
            break;
        }
        assert_refused(&output, "No space left");
        let again = if copy.join("index.json").exists() {
            resumed += 1;
            run(attempt.path(), &["resume", "copy"])
        } else {
            run(attempt.path(), &with_output(&RUN, "copy"))
        };
        assert!(again.status.success(), "{size}: {}", text(&again.stderr));
        assert_same(&copy, &reference);
    }
    assert!(resumed >= 2, "{resumed} runs were resumed");
}

#[test]
fn on_a_read_only_disk_there_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("disk")).unwrap();
    let read_only = "mount -t tmpfs -o ro tmpfs \"$DISK\" || exit 77";
    let new = with_output(&RUN, "disk/run");
    let Some(output) = on_a_disk(folder.path(), [read_only, ""], 0, &new) else {
        return;
    };
    assert_refused(&output, "Read-only file system");

    // A run that was stopped, and then its disk is read-only.
    let long = ["flow", "builtin:cross", "--cells", "32", "--steps", "500"];
    let long = [&long[..], &["--tau", "1e-7", "--checkpoint-every", "1"]].concat();
    let mut child = start(folder.path(), &with_output(&long, "copy"));
    assert!(wait_for(&folder.path().join("copy"), 2, &mut child));
    interrupt(&mut child);
    let read_only = "mount -t tmpfs tmpfs \"$DISK\" || exit 77
        cp -R \"$COPY\" \"$DISK/run\" || exit 78
        mount -o remount,ro \"$DISK\" || exit 77";
    let resume = ["resume", "disk/run"];
    if let Some(output) = on_a_disk(folder.path(), [read_only, ""], 0, &resume) {
        assert_refused(&output, "Read-only file system");
    }
}
