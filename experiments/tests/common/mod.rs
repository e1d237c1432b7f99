//! Running the compiled programs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Metrics by their names.
pub type Summary = BTreeMap<String, f64>;

/// The metrics in a folder of results.
pub fn read_summary(folder: &Path) -> Summary {
    let text = fs::read_to_string(folder.join("summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Runs a program in a folder, away from the meshes that this machine may have.
pub fn run(program: &str, folder: &Path, arguments: &[&str]) -> Output {
    Command::new(program)
        .current_dir(folder)
        .env_remove("WORKBENCH_MESHES")
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// Runs a program that must refuse: code 2, one line that contains `parts`, and the folder as it was.
pub fn refused(program: &str, folder: &Path, arguments: &[&str], parts: &[&str]) {
    let before = content(folder);
    let output = run(program, folder, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert_eq!(message.lines().count(), 1, "{arguments:?}: {message}");
    assert!(message.starts_with("error: "), "{message}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message}");
    }
    assert!(output.stdout.is_empty());
    assert_eq!(content(folder), before, "{arguments:?}");
}

/// All files and folders with the bytes in them.
fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.push((path.clone(), Vec::new()));
            found.extend(content(&path));
        } else {
            found.push((path.clone(), fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}
