//! Refusals that take more than a command; `messages` has the others.

use crate::common::{self, run, text};

/// A whole grid of this size takes 291 GB, which is said before the distances from the mesh, and not after them.
#[cfg(target_os = "linux")]
#[test]
fn what_does_not_fit_into_memory_is_refused_before_it_takes_long() {
    if operators::memory::available().is_some_and(|bytes| bytes > 290e9) {
        return common::skip("a refusal", "there is memory for it");
    }
    let folder = tempfile::tempdir().unwrap();
    let arguments = "flow builtin:figure --cells 990 --storage dense --output run";
    let arguments: Vec<&str> = arguments.split(' ').collect();
    let clock = std::time::Instant::now();
    let output = run(folder.path(), &arguments);
    // The distances take minutes.
    assert!(clock.elapsed().as_secs() < 20);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("needs about 291.1 GB of memory"),
        "{stderr}"
    );
    assert!(stderr.contains("or bricks near the surface"), "{stderr}");
    assert!(!folder.path().join("run").exists());
}

/// Whatever the limit is, there is one line and the exit code 2, and what was stored goes on.
#[cfg(target_os = "linux")]
#[test]
fn memory_that_the_system_refuses_is_said_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let limited = |kib: usize, arguments: &str| {
        let program = env!("CARGO_BIN_EXE_willmore");
        let command = format!("ulimit -v {kib}; exec {program} {arguments} --quiet");
        let mut shell = std::process::Command::new("sh");
        shell.current_dir(folder.path()).args(["-c", &command]);
        shell.output().unwrap()
    };
    let mut refused = 0;
    for megabytes in [200, 300] {
        let flow = format!("flow builtin:cube --cells 64 --steps 1 --output run{megabytes}");
        let output = limited(megabytes << 10, &flow);
        let stderr = text(&output.stderr);
        if output.status.success() {
            continue;
        }
        refused += 1;
        assert_eq!(output.status.code(), Some(2), "{megabytes}: {stderr}");
        assert_eq!(stderr.lines().count(), 1, "{megabytes}: {stderr}");
        assert!(
            stderr.contains("does not fit into memory") || stderr.contains("GB of memory"),
            "{megabytes}: {stderr}"
        );
        let name = format!("run{megabytes}");
        if folder.path().join(&name).exists() {
            let resumed = run(folder.path(), &["resume", &name]);
            assert!(resumed.status.success(), "{}", text(&resumed.stderr));
        }
    }
    assert!(refused > 0, "all of it fitted");
}

#[cfg(target_os = "linux")]
#[test]
fn an_outcome_that_cannot_be_printed_is_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    let full = std::fs::File::options().write(true).open("/dev/full");
    let mut command = common::program(folder.path());
    let output = command.args(["info", "--json"]).stdout(full.unwrap());
    let output = output.output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("could not write standard output"),
        "{stderr}"
    );
}

#[test]
fn help_has_examples_and_exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let help = |arguments: &[&str]| {
        let output = common::program(folder.path())
            .args(arguments)
            .arg("--help")
            .output()
            .unwrap();
        assert!(output.status.success());
        text(&output.stdout)
    };
    assert!(help(&[]).contains("130 interrupted"));
    let commands = [
        "flow",
        "resume",
        "fair",
        "inpaint",
        "mcf",
        "sample",
        "networks",
        "info",
        "check",
        "train",
        "completions",
        "man",
    ];
    for command in commands {
        assert!(
            help(&[command]).contains(&format!("willmore {command}")),
            "{command}"
        );
        assert!(help(&[command]).contains("Example"), "{command}");
    }
}
