//! Running the program.
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The program in a folder.
pub fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_willmore"));
    command.current_dir(folder);
    command
}

/// Runs the program, which must succeed, and returns its outcome.
pub fn outcome(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let output = run(folder, arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        text(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Runs the program with `--json`.
pub fn run(folder: &Path, arguments: &[&str]) -> Output {
    program(folder)
        .args(arguments)
        .arg("--json")
        .output()
        .unwrap()
}

/// What was printed.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// All files of a run by name, but for wall times.
pub fn files(run: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![run.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name().is_some_and(|name| name != "timings.json") {
                let name = path.strip_prefix(run).unwrap().to_owned();
                all.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    all
}

/// Fails unless two runs have the same files with the same bytes.
pub fn assert_same(run: &Path, reference: &Path) {
    let (found, expected) = (files(run), files(reference));
    let names = |files: &BTreeMap<PathBuf, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(&expected));
    for (name, bytes) in &expected {
        assert!(found[name] == *bytes, "{} differs", name.display());
    }
}

/// Says that a part of a test cannot run on this machine; unlike what is printed, that is shown of tests that pass, too.
#[cfg(target_os = "linux")]
pub fn skip(what: &str, reason: &str) {
    use std::io::Write;
    let line = format!("SKIPPED {what}: {reason}\n");
    std::io::stderr().write_all(line.as_bytes()).unwrap();
}

/// Starts the program, that nobody listens to.
pub fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = program(folder);
    command
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// The newest checkpoint in a run.
pub fn committed(run: &Path) -> Option<u64> {
    let entries = std::fs::read_dir(run.join("checkpoints")).ok()?;
    let step = |name: &str| {
        name.strip_prefix("step-")?
            .strip_suffix(".ckpt")?
            .parse()
            .ok()
    };
    entries
        .filter_map(|entry| step(entry.ok()?.file_name().to_str()?))
        .max()
}

/// Waits until the run has committed this step; false if the process ended before.
pub fn wait_for(run: &Path, step: u64, child: &mut Child) -> bool {
    let clock = Instant::now();
    while committed(run).is_none_or(|found| found < step) {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        assert!(clock.elapsed() < Duration::from_mins(2), "no step {step}");
        std::thread::sleep(Duration::from_millis(1));
    }
    true
}

/// Ctrl-C.
pub fn interrupt(child: &mut Child) {
    let number = child.id().to_string();
    let sent = Command::new("kill")
        .args(["-INT", &number])
        .status()
        .unwrap();
    assert!(sent.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

/// The arguments of a run in a folder of this name.
pub fn with_output<'a>(arguments: &[&'a str], output: &'a str) -> Vec<&'a str> {
    [arguments, &["--output", output]].concat()
}

/// A column of the metrics of a run; absent values are not numbers.
pub fn column(run: &Path, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(run.join("metrics.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let place = head.iter().position(|column| *column == name);
    let place = place.unwrap_or_else(|| panic!("no {name} in {head:?}"));
    lines
        .map(|row| row[place].parse().unwrap_or(f64::NAN))
        .collect()
}
