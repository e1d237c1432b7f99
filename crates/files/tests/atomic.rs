//! Files are complete or absent, whichever step fails.

use std::fs;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use files::{Disk, FileSystem};

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Fails at one operation, of which it does nothing but half of a write.
#[derive(Debug)]
struct Failing {
    at: usize,
    count: AtomicUsize,
}

impl Failing {
    fn next(&self) -> io::Result<()> {
        match self.count.fetch_add(1, Ordering::Relaxed) {
            n if n == self.at => Err(io::Error::from(io::ErrorKind::StorageFull)),
            _ => Ok(()),
        }
    }
}

impl FileSystem for Failing {
    fn create_file(&self, path: &Path) -> io::Result<fs::File> {
        self.next()?;
        Disk.create_file(path)
    }
    fn write(&self, file: &mut fs::File, path: &Path, bytes: &[u8]) -> io::Result<usize> {
        if let Err(e) = self.next() {
            Disk.write(file, path, &bytes[..bytes.len() / 2])?;
            return Err(e);
        }
        Disk.write(file, path, bytes)
    }
    fn sync_file(&self, file: &fs::File, path: &Path) -> io::Result<()> {
        self.next()?;
        Disk.sync_file(file, path)
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.next()?;
        Disk.rename(from, to)
    }
    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        self.next()?;
        Disk.sync_folder(path)
    }
}

#[test]
fn every_step_may_fail() {
    let actions = [
        ("create a file beside", "old"),
        ("write", "old"),
        ("flush to disk", "old"),
        ("replace", "old"),
        ("flush the folder of", "new"),
    ];
    for (at, (action, content)) in actions.into_iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        fs::write(&path, "old").unwrap();
        let file_system = Failing {
            at,
            count: AtomicUsize::new(0),
        };
        let error = files::write_atomically_on(&file_system, &path, |out| out.write_all(b"new"))
            .unwrap_err();
        assert_eq!(error.action, action);
        assert_eq!(error.path, path);
        assert_eq!(error.source.kind(), io::ErrorKind::StorageFull);
        let message = error.to_string();
        assert!(message.contains("state") && !message.contains('\n'));
        assert_eq!(fs::read_to_string(&path).unwrap(), content, "{message}");
        assert_eq!(names(folder.path()), ["state"], "{message}");
    }
}

#[test]
fn a_failing_or_panicking_producer_leaves_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    files::write_atomically(&path, |out| out.write_all(b"old")).unwrap();
    let error = files::write_atomically(&path, |out| {
        out.write_all(b"half of the n")?;
        Err(io::Error::other("the solver gave up"))
    })
    .unwrap_err();
    assert_eq!(error.action, "write");
    assert!(error.to_string().contains("the solver gave up"));
    let panicked = std::panic::catch_unwind(|| {
        files::write_atomically(&path, |_| std::panic::resume_unwind(Box::new("stop")))
    });
    assert!(panicked.is_err());
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(names(folder.path()), ["state"]);
}

#[test]
fn probing_finds_a_folder_that_is_none() {
    let folder = tempfile::tempdir().unwrap();
    files::probe(folder.path()).unwrap();
    assert!(names(folder.path()).is_empty());
    fs::write(folder.path().join("file"), "").unwrap();
    let error = files::probe(folder.path().join("file")).unwrap_err();
    assert_eq!(error.action, "create a file in");
}

#[cfg(unix)]
#[test]
fn files_are_readable_like_any_other() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (plain, ours) = (folder.path().join("plain"), folder.path().join("ours"));
    fs::write(&plain, "x").unwrap();
    files::write_atomically(&ours, |out| out.write_all(b"x")).unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&ours), mode(&plain));
}

/// As editors and shells do it: the link stays, and what it leads to is written.
#[cfg(unix)]
#[test]
fn a_file_is_written_through_links() {
    use std::os::unix::fs::symlink;
    let root = tempfile::tempdir().unwrap();
    let at = |name: &str| root.path().join(name);
    fs::create_dir(at("folder")).unwrap();
    fs::write(at("folder/file"), "old").unwrap();
    symlink("folder/file", at("link")).unwrap();
    symlink(at("link"), at("link to a link")).unwrap();
    symlink("folder/new", at("dangling")).unwrap();
    symlink("round", at("round")).unwrap();
    let write = |name: &str| files::write_atomically(at(name), |out| out.write_all(b"new"));
    for (link, file) in [
        ("link to a link", "folder/file"),
        ("dangling", "folder/new"),
    ] {
        write(link).unwrap();
        assert!(at(link).is_symlink() && !at(file).is_symlink());
        assert_eq!(fs::read_to_string(at(file)).unwrap(), "new");
    }
    assert!(at("link").is_symlink());
    assert_eq!(names(&at("folder")), ["file", "new"]);
    let error = write("round").unwrap_err().to_string();
    assert!(
        error.starts_with("could not follow the links of"),
        "{error}"
    );
}
