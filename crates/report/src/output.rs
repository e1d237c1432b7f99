//! An output folder that is checked early and whose files are never half written.

use std::fs;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;

use crate::error::{Error, Result};

/// A folder that exists and has been written to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputDir {
    path: PathBuf,
}

impl OutputDir {
    /// Creates the folder (with its parents) unless it exists, and proves that files can be made in
    /// it, so that a long computation does not end in a lost result.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        fs::create_dir_all(&path).map_err(files::Error::of("create the folder", &path))?;
        files::probe(&path)?;
        Ok(Self { path })
    }

    /// A folder inside this one, named as in [`Self::path`], created and checked likewise.
    pub fn subfolder(&self, name: &str) -> Result<Self> {
        Self::create(self.path(name)?)
    }

    /// The folder itself.
    pub fn as_path(&self) -> &Path {
        &self.path
    }

    /// The path of a file in the folder, whether or not it exists. Its name must be one plain component: no separator, not `..`.
    pub fn path(&self, name: &str) -> Result<PathBuf> {
        let mut components = Path::new(name).components();
        match (components.next(), components.next()) {
            (Some(Component::Normal(only)), None) if only == name => Ok(self.path.join(name)),
            _ => Err(Error::FileName(name.to_owned())),
        }
    }

    /// Writes a whole file at once, replacing an old one only when the new one is complete.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<PathBuf> {
        let path = self.path(name)?;
        files::write_atomically(&path, |file| file.write_all(content.as_ref()))?;
        Ok(path)
    }

    /// Writes any value as indented JSON with a final newline. JSON knows no NaN and no infinity: they become `null`; keys of maps must
    /// be text.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<PathBuf> {
        let text = serde_json::to_string_pretty(value).map_err(Error::json("the value"))?;
        self.write(name, text + "\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_appear_whole_and_nothing_else_remains() {
        let root = tempfile::tempdir().unwrap();
        let folder = OutputDir::create(root.path().join("a/b")).unwrap();
        let path = folder.write("result.csv", "x\n1\n").unwrap();
        assert_eq!(path, folder.path("result.csv").unwrap());
        assert_eq!(fs::read_to_string(path).unwrap(), "x\n1\n");
        folder.write("result.csv", "x\n2\n").unwrap();
        assert_eq!(
            fs::read_to_string(folder.path("result.csv").unwrap()).unwrap(),
            "x\n2\n"
        );
        assert_eq!(fs::read_dir(folder.as_path()).unwrap().count(), 1);
        assert_eq!(
            folder.subfolder("c").unwrap().as_path(),
            folder.as_path().join("c")
        );
    }

    #[test]
    fn names_with_folders_in_them_are_refused() {
        let root = tempfile::tempdir().unwrap();
        let folder = OutputDir::create(root.path()).unwrap();
        for name in ["", ".", "..", "a/b", "../a", "/a", "a/"] {
            let error = folder.write(name, "x").unwrap_err();
            assert!(matches!(error, Error::FileName { .. }), "{name:?}");
        }
    }
}
