//! A toy computation, and what a run directory holds.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use files::FileSystem;
use runs::{CheckpointState, Error, Interrupt, RunDirectory, StoredRun};
use serde_json::json;
use tempfile::TempDir;

pub const STEPS: u64 = 60;
const CELLS: usize = 16;

pub const FILES: [(&str, &[u8]); 2] = [
    ("config.toml", b"rate = 3.9\n"),
    ("manifest.json", b"{ \"steps\": 60 }\n"),
];

/// The disk, but without waiting for it.
#[derive(Debug)]
pub struct Quick;

impl FileSystem for Quick {
    fn sync_file(&self, _: &File, _: &Path) -> io::Result<()> {
        Ok(())
    }
    fn sync_folder(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }
}

/// A temporary folder, in memory where the system has such a thing.
pub fn quick_folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir()
        && let Ok(folder) = tempfile::tempdir_in(memory)
    {
        return folder;
    }
    tempfile::tempdir().unwrap()
}

fn beginning() -> CheckpointState<'static> {
    let values = (0..CELLS).map(|i| (i as f64 + 0.5) / CELLS as f64);
    CheckpointState::new(0, json!({ "time": 0.0, "largest": 0.0 }))
        .with_array("u", values.collect::<Vec<f64>>())
        .with_array("means", vec![])
}

fn step(state: &mut CheckpointState) {
    state.step += 1;
    let time = state.notes["time"].as_f64().unwrap() + 0.1;
    let u = state.arrays.get_mut("u").unwrap().0.to_mut();
    for v in u.iter_mut() {
        *v *= 3.9 * (1.0 - *v);
    }
    let mean = u.iter().sum::<f64>() / CELLS as f64;
    let largest = state.notes["largest"].as_f64().unwrap().max(mean);
    state.notes = json!({ "time": time, "largest": largest });
    let means = state.arrays.get_mut("means").unwrap();
    means.0.to_mut().push(mean);
}

fn metrics(state: &CheckpointState) -> String {
    let means = state.array("means").unwrap();
    let rows = (means.iter().zip(1..)).map(|(mean, step)| format!("{step},{mean}\n"));
    "step,mean\n".to_owned() + &rows.collect::<String>()
}

pub fn state_at(step_number: u64) -> CheckpointState<'static> {
    let mut state = beginning();
    while state.step < step_number {
        step(&mut state);
    }
    state
}

/// How to run the toy.
pub struct Toy {
    pub file_system: Arc<dyn FileSystem>,
    pub interrupt: Interrupt,
    /// Time that a step takes.
    pub pause: Duration,
    /// Go no further, and commit no more.
    pub stop: u64,
    /// Recover from damage.
    pub recover: bool,
    /// The last step that was committed for certain, once the run is there.
    pub committed: Cell<Option<u64>>,
}

impl Toy {
    /// A toy that runs to the end without pauses.
    pub fn on(file_system: Arc<dyn FileSystem>) -> Self {
        Self {
            file_system,
            interrupt: Interrupt::never(),
            pause: Duration::ZERO,
            stop: STEPS,
            recover: false,
            committed: Cell::new(None),
        }
    }
}

/// Starts or resumes the toy, commits every 3 steps and writes a field every 10.
pub fn run(folder: &Path, toy: &Toy) -> Result<(), Error> {
    let mut opened = StoredRun::find_on(toy.file_system.clone(), folder, false);
    if toy.recover && matches!(opened, Err(Error::Damaged { .. })) {
        opened = StoredRun::find_on(toy.file_system.clone(), folder, true);
    }
    let (mut run, mut state) = match opened {
        Ok(stored) if stored.is_finished() => return stored.tidy(),
        Ok(stored) => {
            toy.committed.set(Some(stored.state().step));
            stored.resume()?
        }
        Err(Error::NoRun(_)) => {
            let start = beginning();
            let run = RunDirectory::create_on(toy.file_system.clone(), folder, &FILES, &start)?;
            toy.committed.set(Some(0));
            (run, start)
        }
        Err(error) => return Err(error),
    };
    while state.step < STEPS.min(toy.stop) {
        step(&mut state);
        std::thread::sleep(toy.pause);
        if state.step.is_multiple_of(10) {
            let name = format!("fields/step-{:04}.raw", state.step);
            let values = state
                .array("u")
                .unwrap()
                .iter()
                .flat_map(|v| v.to_le_bytes());
            let bytes: Vec<u8> = values.collect();
            run.write_file(&name, &bytes)?;
        }
        if state.step == 25 {
            let frames = run.path().join("frames/first");
            files::make_folders_on(&*toy.file_system, &frames)?;
            files::write_atomically_on(&*toy.file_system, frames.join("a.png"), |out| {
                out.write_all(b"a picture")
            })?;
            run.adopt_file("frames/first/a.png")?;
        }
        let interrupted = toy.interrupt.requested();
        if state.step.is_multiple_of(3) || interrupted {
            run.replace_file("metrics.csv", metrics(&state).as_bytes())?;
            let id = std::process::id().to_string();
            run.replace_file("timings.json", id.as_bytes())?;
            run.commit(&state)?;
            toy.committed.set(Some(state.step));
        }
        if interrupted {
            return Ok(());
        }
    }
    if toy.stop >= STEPS {
        run.write_file("figures/mean.svg", format!("{}\n", state.notes).as_bytes())?;
        run.write_file("metrics.csv", metrics(&state).as_bytes())?;
        run.finish(&state)?;
        toy.committed.set(Some(state.step));
    }
    Ok(())
}

/// The toy up to a step on a disk without waiting, repairing what is damaged.
pub fn run_to(folder: &Path, stop: u64) -> Result<(), Error> {
    let toy = Toy {
        stop,
        recover: true,
        ..Toy::on(Arc::new(Quick))
    };
    run(folder, &toy)
}

/// All files by their names in the folder.
pub fn all_contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut contents = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(current) = folders.pop() {
        for entry in fs::read_dir(current).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap();
                contents.insert(name.to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    contents
}

/// All files that two runs of the same computation share.
pub fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut contents = all_contents(folder);
    assert!(contents.remove("timings.json").is_some());
    contents
}

pub fn write_contents(folder: &Path, contents: &BTreeMap<String, Vec<u8>>) {
    for (name, bytes) in contents {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

/// What the toy leaves that nothing has stopped.
pub fn uninterrupted() -> BTreeMap<String, Vec<u8>> {
    let folder = quick_folder();
    let path = folder.path().join("run");
    run_to(&path, STEPS).unwrap();
    contents(&path)
}

/// Reproducible numbers (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }
}
