//! Running the compiled programs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use experiments::metrics;
use experiments::programs::EXPERIMENTS;

/// Metrics by their names.
pub type Summary = BTreeMap<String, f64>;

/// The metrics in a folder of results.
pub fn read_summary(folder: &Path) -> Summary {
    let text = fs::read_to_string(folder.join("summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Runs a program in a folder, away from the meshes that this machine may have.
pub fn run(program: &str, folder: &Path, arguments: &[&str]) -> Output {
    let one = Path::new(env!("CARGO_BIN_EXE_experiments"));
    let file = format!("{program}{}", std::env::consts::EXE_SUFFIX);
    Command::new(one.with_file_name(file))
        .current_dir(folder)
        .env_remove("WORKBENCH_MESHES")
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// Runs an experiment that must succeed without a word and write the usual figures into the folder `out`, and returns the metrics, which
/// must be explained.
pub fn finished(program: &str, folder: &Path, arguments: &[&str]) -> Summary {
    let output = run(program, folder, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    let silent = output.status.success() && message.is_empty();
    assert!(silent, "{program}: {message}");
    let experiment = EXPERIMENTS.iter().find(|one| one.name == program);
    let experiment = experiment.expect("an experiment");
    let folder = folder.join("out");
    for (stem, _) in experiment.results[0].figures {
        for extension in ["svg", "png"] {
            let file = format!("{stem}.{extension}");
            assert!(folder.join(&file).exists(), "{program} wrote no {file}");
        }
    }
    let summary = read_summary(&folder);
    for name in summary.keys() {
        let explained = metrics::is_explained(experiment, name);
        assert!(explained, "the tables of {program} do not explain {name}");
    }
    summary
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
