//! Every single operation on the disk fails once, or with all after it, and the run ends with the
//! same bytes nevertheless.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use crate::toy::{
    self, FILES, Quick, STEPS, Toy, contents, run_to, state_at, uninterrupted, write_contents,
};
use files::{Disk, FileSystem};
use runs::{Error, RunDirectory, StoredRun};

/// Fails at operation `at`, and also at all later ones if the process is to count as dead.
#[derive(Debug)]
struct Faulty {
    at: usize,
    dead: bool,
    /// Longest piece that is written at once.
    piece: usize,
    count: AtomicUsize,
}

impl Faulty {
    fn new(at: usize, dead: bool, piece: usize) -> Arc<Self> {
        Arc::new(Self {
            at,
            dead,
            piece,
            count: AtomicUsize::new(0),
        })
    }

    fn next(&self) -> io::Result<()> {
        let n = self.count.fetch_add(1, Ordering::Relaxed);
        if n == self.at || self.dead && n > self.at {
            return Err(io::ErrorKind::StorageFull.into());
        }
        Ok(())
    }

    fn operations(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }
}

impl FileSystem for Faulty {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.next()?;
        Disk.create_folder(path)
    }
    fn create_file(&self, path: &Path) -> io::Result<File> {
        self.next()?;
        Disk.create_file(path)
    }
    fn write(&self, file: &mut File, path: &Path, bytes: &[u8]) -> io::Result<usize> {
        if let Err(e) = self.next() {
            // The disk was not quite full.
            if self.operations() == self.at + 1 {
                Disk.write(file, path, &bytes[..bytes.len().min(self.piece) / 2])?;
            }
            return Err(e);
        }
        Disk.write(file, path, &bytes[..bytes.len().min(self.piece)])
    }
    fn sync_file(&self, _: &File, _: &Path) -> io::Result<()> {
        self.next()
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.next()?;
        Disk.rename(from, to)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        self.next()?;
        Disk.remove(path)
    }
    fn sync_folder(&self, _: &Path) -> io::Result<()> {
        self.next()
    }
}

/// Runs the toy with a fault, checks what is left, and goes on to the end. Returns whether there was
/// a fault.
fn survives(
    folder: &Path,
    file_system: &Arc<Faulty>,
    expected: &BTreeMap<String, Vec<u8>>,
    damaged: bool,
) -> bool {
    let toy = Toy {
        recover: damaged,
        ..Toy::on(file_system.clone())
    };
    let result = toy::run(folder, &toy);
    let fault = file_system.operations() > file_system.at;
    assert_eq!(result.is_err(), fault, "{result:?}");
    if let Err(error) = &result {
        let message = error.to_string();
        assert!(!message.contains('\n') && message.len() > 20, "{message}");
        match StoredRun::find_on(Arc::new(Quick), folder, false) {
            Ok(stored) => {
                let step = stored.state().step;
                // The commit that failed may have failed after it was done.
                let last = toy.committed.get().unwrap_or(0);
                assert!(step == last || step == last + 3, "{step} after {last}");
                assert_eq!(*stored.state(), state_at(step));
            }
            Err(Error::NoRun(_)) => assert_eq!(toy.committed.get(), None, "{message}"),
            Err(Error::Damaged { .. }) if damaged => {}
            Err(other) => panic!("{other} after {message}"),
        }
        run_to(folder, STEPS).unwrap();
    }
    let found = contents(folder);
    let names: Vec<_> = found.keys().collect();
    assert_eq!(names, expected.keys().collect::<Vec<_>>());
    for (name, bytes) in &found {
        assert!(*bytes == expected[name], "{name} after {result:?}");
    }
    fault
}

/// Lets every `stride`-th operation fail.
fn operations_fail(stride: usize) {
    let expected = uninterrupted();
    for (dead, piece) in [
        (false, usize::MAX),
        (true, usize::MAX),
        (false, 700),
        (true, 700),
    ] {
        let mut at = 0;
        loop {
            let folder = toy::quick_folder();
            // Two levels, so that the upper folder is made too.
            let run = folder.path().join("results/run");
            if !survives(&run, &Faulty::new(at, dead, piece), &expected, false) {
                break;
            }
            at += stride;
        }
        assert!(at > 400, "only {at} operations");
        println!("{at} operations, dead {dead}, pieces of {piece}");
    }
}

#[test]
fn some_operations_may_fail() {
    operations_fail(17);
}

#[test]
#[ignore = "long"]
fn every_operation_may_fail() {
    operations_fail(1);
}

/// Lets the first operations of resuming a run fail that was killed at some operation.
fn operations_of_a_resumption_fail(kills: impl Iterator<Item = usize>, least: usize) {
    let expected = uninterrupted();
    let mut leftovers = 0;
    for killed_at in kills {
        let folder = toy::quick_folder();
        let left = folder.path().join("left");
        let toy = Toy::on(Faulty::new(killed_at, true, 700));
        toy::run(&left, &toy).unwrap_err();
        leftovers += RunDirectory::open(&left).unwrap().leftovers().count();
        let left = toy::all_contents(&left);
        for at in 0..30 {
            let run = folder.path().join(format!("{at}"));
            write_contents(&run, &left);
            let file_system = Faulty::new(at, at % 2 == 0, 700);
            assert!(survives(&run, &file_system, &expected, false));
        }
    }
    assert!(leftovers >= least, "only {leftovers} leftovers");
}

#[test]
fn some_operations_of_a_resumption_may_fail() {
    operations_of_a_resumption_fail((185..205).step_by(7), 2);
}

#[test]
#[ignore = "long"]
fn every_operation_of_a_resumption_may_fail() {
    operations_of_a_resumption_fail(175..215, 20);
}

#[test]
fn every_operation_of_a_recovery_may_fail() {
    let expected = uninterrupted();
    let folder = toy::quick_folder();
    let left = folder.path().join("left");
    // Past step 30, with its field, and on to the commit after it.
    run_to(&left, 32).unwrap();
    let mut left = toy::all_contents(&left);
    for name in ["checkpoints/step-00000030.ckpt", "fields/step-0030.raw"] {
        left.get_mut(name).unwrap()[100] ^= 16;
    }
    for dead in [false, true] {
        for at in 0..60 {
            let run = folder.path().join(format!("{at}-{dead}"));
            write_contents(&run, &left);
            assert!(survives(&run, &Faulty::new(at, dead, 700), &expected, true));
        }
    }
}

#[test]
fn after_a_failed_commit_the_run_goes_on_or_is_opened_again() {
    let folder = toy::quick_folder();
    let start = |name: &str, at| {
        let file_system = Faulty::new(at, false, usize::MAX);
        let path = folder.path().join(name);
        let run = RunDirectory::create_on(file_system.clone(), &path, &FILES, &state_at(0));
        (run.unwrap(), path, file_system.operations())
    };
    let (_, _, operations) = start("counted", usize::MAX);

    // Of a third commit, the write of the checkpoint, the flush of its folder after it is in place,
    // and the removal of the first.
    for (name, after, step) in [("checkpoint", 1, 3), ("folder", 4, 6), ("removal", 5, 6)] {
        let (mut run, path, _) = start(name, operations + 5 + after);
        run.commit(&state_at(3)).unwrap();
        let error = run.commit(&state_at(6)).unwrap_err();
        assert!(matches!(error, Error::Io(_)), "{error}");
        let copy = folder.path().join(format!("{name}-copy"));
        write_contents(&copy, &toy::all_contents(&path));
        let stored = RunDirectory::open(&copy).unwrap();
        assert_eq!(*stored.state(), state_at(step), "{name}");
        drop(stored.resume().unwrap());

        run.commit(&state_at(6)).unwrap();
        run.write_file("fields/a", b"a").unwrap();
        run.commit(&state_at(9)).unwrap();
        drop(run);
        let stored = RunDirectory::open(&path).unwrap();
        assert_eq!(*stored.state(), state_at(9), "{name}");
        let (run, state) = stored.resume().unwrap();
        run.finish(&state).unwrap();
        let names: Vec<_> = toy::all_contents(&path).into_keys().collect();
        let last = "checkpoints/step-00000009.ckpt";
        let expected = [last, "config.toml", "fields/a", "lock", "manifest.json"];
        assert_eq!(names, expected, "{name}");
    }
    // A file alone, and its name is free again.
    let (mut run, ..) = start("file", operations + 3);
    let failed = run.write_file("fields/a", b"a");
    assert!(matches!(failed, Err(Error::Io(_))));
    run.write_file("fields/a", b"a").unwrap();
    run.finish(&state_at(3)).unwrap();
}

/// Watches the order of operations: what a power failure may take away.
#[derive(Debug, Default)]
struct Watching(Mutex<Watched>);

#[derive(Debug, Default)]
struct Watched {
    /// With content that is not on the disk.
    files: BTreeSet<PathBuf>,
    /// With names that are not on the disk.
    folders: BTreeSet<PathBuf>,
    /// The new checkpoint is in place, but not for certain.
    swapping: bool,
    swaps: usize,
    removals: usize,
}

impl Watching {
    fn named(&self, path: &Path) {
        let folder = path.parent().unwrap().to_owned();
        self.0.lock().unwrap().folders.insert(folder);
    }
}

impl FileSystem for Watching {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.named(path);
        Disk.create_folder(path)
    }
    fn create_file(&self, path: &Path) -> io::Result<File> {
        self.0.lock().unwrap().files.insert(path.into());
        Disk.create_file(path)
    }
    fn write(&self, file: &mut File, path: &Path, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().files.insert(path.into());
        Disk.write(file, path, bytes)
    }
    fn sync_file(&self, _: &File, path: &Path) -> io::Result<()> {
        self.0.lock().unwrap().files.remove(path);
        Ok(())
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut watched = self.0.lock().unwrap();
        assert!(
            !watched.files.contains(from),
            "{} before its content",
            to.display()
        );
        if to.extension().is_some_and(|e| e == "ckpt") {
            let checkpoints = to.parent().unwrap();
            let root = checkpoints.parent().unwrap();
            watched.files.remove(&root.join("lock"));
            let Watched { files, folders, .. } = &mut *watched;
            assert!(files.is_empty(), "commit before {files:?}");
            // Only the name of the checkpoint may still be missing.
            folders.remove(checkpoints);
            assert!(folders.is_empty(), "commit before {folders:?}");
            watched.swapping = true;
            watched.swaps += 1;
        }
        drop(watched);
        self.named(to);
        Disk.rename(from, to)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        let mut watched = self.0.lock().unwrap();
        let path_shown = path.display();
        assert!(!watched.swapping, "{path_shown} removed before the commit");
        watched.removals += 1;
        Disk.remove(path)
    }
    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        let mut watched = self.0.lock().unwrap();
        watched.folders.remove(path);
        watched.swapping &= watched.folders.iter().any(|f| path.starts_with(f));
        Ok(())
    }
}

#[test]
fn a_power_failure_finds_what_the_checkpoint_lists() {
    let folder = toy::quick_folder();
    let file_system = Arc::new(Watching::default());
    let toy = Toy::on(file_system.clone());
    toy::run(&folder.path().join("run"), &toy).unwrap();
    let watched = file_system.0.lock().unwrap();
    // One at the start, twenty commits, one at the end in place of the last. Only that stays.
    assert_eq!(watched.swaps, 22);
    assert_eq!(watched.removals, 20);
}

/// The file system that all tests above replace. Files in place of folders work for root, too, whom no
/// permission stops.
#[test]
fn the_real_disk_refuses_with_one_line() {
    let folder = toy::quick_folder();
    let run = folder.path().join("run");
    fs::write(&run, "not a folder").unwrap();
    for path in [run.clone(), run.join("deeper")] {
        let error = RunDirectory::create(&path, &FILES, &state_at(0)).unwrap_err();
        let message = error.to_string();
        assert!(matches!(error, Error::Io(_)), "{message}");
        assert!(message.contains("run") && !message.contains('\n'));
    }
    assert_eq!(fs::read(&run).unwrap(), b"not a folder");
}
