//! `scripts/regenerate_figures` in a repository of two results, with a Cargo that only tells how it is called.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use experiments::derived::root;

const SCRIPT: &str = "scripts/regenerate_figures";
const CARGO: &str = r#"#!/bin/sh
case "$*" in
    *--results) printf 'cross cross --cells 8\npaper_numbers paper_numbers\n' ;;
    *) echo "$*" >>calls ;;
esac
"#;

fn write(folder: &Path, file: &str, text: &str) {
    let path = folder.join(file);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

fn git(folder: &Path, arguments: &[&str]) -> String {
    let who = ["-c", "user.name=a", "-c", "user.email=a@b"];
    let mut git = Command::new("git");
    git.arg("-C").arg(folder).args(who).args(arguments);
    let output = git.output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// A repository whose results are those of its code.
fn repository() -> tempfile::TempDir {
    let repository = tempfile::tempdir().unwrap();
    let folder = repository.path();
    for file in [
        "crates/a.rs",
        "experiments/a.rs",
        "Cargo.toml",
        "Cargo.lock",
    ] {
        write(folder, file, "");
    }
    git(folder, &["init", "--quiet"]);
    git(folder, &["add", "."]);
    git(
        folder,
        &["-c", "commit.gpgsign=false", "commit", "--quiet", "-m", "a"],
    );
    let commit = git(folder, &["rev-parse", "HEAD"]);
    for name in ["cross", "paper_numbers"] {
        let manifest = format!("{{\n  \"commit\": \"{commit}\"\n}}\n");
        write(folder, &format!("results/{name}/manifest.json"), &manifest);
        write(folder, &format!("results/{name}/summary.json"), "{}");
    }
    write(folder, "bin/cargo", CARGO);
    let executable = fs::Permissions::from_mode(0o755);
    fs::set_permissions(folder.join("bin/cargo"), executable).unwrap();
    write(
        folder,
        SCRIPT,
        &fs::read_to_string(root().join(SCRIPT)).unwrap(),
    );
    repository
}

/// The results that the script makes, with their options, in its order.
fn made(folder: &Path, names: &[&str]) -> Vec<String> {
    let path = std::env::var("PATH").unwrap();
    let path = format!("{}:{path}", folder.join("bin").display());
    let mut script = Command::new("bash");
    script.arg(folder.join(SCRIPT)).args(names);
    let output = script.env("PATH", path).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let calls = fs::read_to_string(folder.join("calls")).unwrap();
    fs::remove_file(folder.join("calls")).unwrap();
    let results = calls
        .lines()
        .filter_map(|call| call.split_once("--output results/"));
    results
        .map(|(_, result)| result.trim_end().to_owned())
        .collect()
}

#[test]
fn the_papers_numbers_are_made_each_time_and_the_others_by_new_code() {
    let repository = repository();
    let folder = repository.path();
    assert_eq!(made(folder, &[]), ["paper_numbers"]);
    for file in ["Cargo.toml", "experiments/a.rs"] {
        write(folder, file, "# other");
        let all = ["cross --cells 8", "paper_numbers"];
        assert_eq!(made(folder, &["cross"]), all, "{file}");
        write(folder, file, "");
    }
    assert_eq!(made(folder, &["cross"]), ["paper_numbers"]);
}
