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
