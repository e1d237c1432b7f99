//! Full and read-only disks. Where the system lets users mount one (Linux, user namespaces or root) they are real; a limit on the
//! length of files and a folder in which nobody can write take their place everywhere. What cannot run says `SKIPPED`.
use std::path::Path;
use std::process::{Command, Output};

use crate::common::{
    assert_same, committed, interrupt, outcome, run, skip, start, text, wait_for, with_output,
};

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
        Ok(output) => {
            skip("a disk", &text(&output.stderr));
            None
        }
        Err(error) => {
            skip("a disk", &error.to_string());
            None
        }
    }
}

/// Runs the program where no file may have more than so many blocks of 512 bytes.
fn with_short_files(folder: &Path, blocks: usize, arguments: &[&str]) -> Output {
    let script = "trap '' XFSZ; ulimit -f \"$BLOCKS\" || exit 77; exec \"$0\" \"$@\"";
    Command::new("sh")
        .current_dir(folder)
        .args(["-c", script, env!("CARGO_BIN_EXE_willmore")])
        .args(arguments)
        .env("BLOCKS", blocks.to_string())
        .output()
        .unwrap()
}

fn assert_refused(output: &Output, reason: &str) {
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.starts_with("error: "), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(error.contains(reason), "{error}");
}

/// Goes on with what a refused run has left, if anything, and returns whether there was something.
fn go_on(folder: &Path, left: &str, reference: &Path) -> bool {
    let was_there = committed(&folder.join(left)).is_some();
    let again = if was_there {
        run(folder, &["resume", left])
    } else {
        run(folder, &with_output(&RUN, left))
    };
    assert!(again.status.success(), "{}", text(&again.stderr));
    assert_same(&folder.join(left), reference);
    was_there
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
        if output.status.success() {
            assert_same(&attempt.path().join("copy"), &reference);
            println!("{size} KiB are enough; {resumed} runs were resumed");
            break;
        }
        assert_refused(&output, "No space left");
        resumed += usize::from(go_on(attempt.path(), "copy", &reference));
    }
    assert!(resumed >= 2, "{resumed} runs were resumed");
}

/// The same without a disk.
#[test]
fn where_files_must_be_short_there_is_one_line_and_the_run_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    outcome(folder.path(), &with_output(&RUN, "reference"));
    let reference = folder.path().join("reference");
    let mut resumed = 0;
    for blocks in (2..).step_by(10) {
        let attempt = tempfile::tempdir_in(folder.path()).unwrap();
        let arguments = with_output(&RUN, "run");
        let arguments = [&arguments[..], &["--quiet"]].concat();
        let output = with_short_files(attempt.path(), blocks, &arguments);
        if output.status.success() {
            assert_same(&attempt.path().join("run"), &reference);
            println!("{blocks} blocks are enough; {resumed} runs were resumed");
            break;
        }
        assert_refused(&output, "File too large");
        resumed += usize::from(go_on(attempt.path(), "run", &reference));
    }
    assert!(resumed >= 1, "{resumed} runs were resumed");
}

#[test]
fn on_a_read_only_disk_there_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    // Not even root can write there.
    let nowhere = run(folder.path(), &with_output(&RUN, "/proc/self/run"));
    assert_refused(&nowhere, "/proc/self");

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
    let resume = ["resume", "disk/run", "--quiet"];
    if let Some(output) = on_a_disk(folder.path(), [read_only, ""], 0, &resume) {
        assert_refused(&output, "Read-only file system");
    }
}
