//! What is in the folder of a run.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use files::TEMPORARY_PREFIX;

use crate::checkpoint::Files;
use crate::names::{self, CHECKPOINTS, LOCK};

/// The steps whose checkpoints are there, in any condition, the newest first.
pub(crate) fn steps(root: &Path) -> Result<Vec<u64>, files::Error> {
    use io::ErrorKind::{NotADirectory, NotFound};
    let items = match list(&root.join(CHECKPOINTS)) {
        Err(e) if matches!(e.source.kind(), NotADirectory | NotFound) => Vec::new(),
        items => items?,
    };
    let names = items.iter().map(|(path, _)| name(root, path));
    let mut steps: Vec<u64> = names.filter_map(|name| names::step(&name)).collect();
    steps.sort_unstable_by(|a, b| b.cmp(a));
    Ok(steps)
}

/// Whatever is not part of a run with these files and checkpoints. What is in folders that are no
/// part either is not listed.
pub(crate) fn others(
    root: &Path,
    files: &Files,
    steps: &[u64],
) -> Result<Vec<PathBuf>, files::Error> {
    let mut others = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for (path, is_folder) in list(&folder)? {
            let name = name(root, &path);
            let inside = format!("{name}/");
            let is_part = if is_folder {
                let first = files.range(inside.clone()..).next();
                name == CHECKPOINTS || first.is_some_and(|(name, _)| name.starts_with(&inside))
            } else {
                name == LOCK
                    || files.contains_key(&name)
                    || names::step(&name).is_some_and(|step| steps.contains(&step))
            };
            match is_part {
                false => others.push(path),
                true if is_folder => folders.push(path),
                true => {}
            }
        }
    }
    others.sort();
    Ok(others)
}

/// What is directly in a folder, each with whether it is a folder. Links are none.
pub(crate) fn list(folder: &Path) -> Result<Vec<(PathBuf, bool)>, files::Error> {
    let read = || {
        let entries = fs::read_dir(folder)?.map(|entry| {
            let entry = entry?;
            Ok((entry.path(), entry.file_type()?.is_dir()))
        });
        entries.collect::<io::Result<_>>()
    };
    read().map_err(files::Error::of("list", folder))
}

/// Whether a process that was killed while it wrote a file has left it.
pub(crate) fn is_temporary(path: &Path) -> bool {
    let own = path.file_name().unwrap_or_default().as_encoded_bytes();
    own.starts_with(TEMPORARY_PREFIX.as_bytes()) && path.is_file()
}

/// The name of something in a run, with `/` between folders.
pub(crate) fn name(root: &Path, path: &Path) -> String {
    let inner = path.strip_prefix(root).unwrap_or(path).components();
    let parts: Vec<_> = inner.map(|c| c.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}
