//! Results of finished parts of a long computation.

use std::fs;
use std::path::PathBuf;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::{Error, names};

/// A folder of finished parts. Each is stored with everything it depends on, its key, and only used
/// if that is the same.
///
/// All methods give [`Error::Io`], and [`Error::Invalid`] for names that are not made of letters,
/// digits, `.`, `-` and `_`, and content that JSON does not know.
#[derive(Debug, Clone)]
pub struct Cache {
    folder: PathBuf,
}

#[expect(clippy::missing_errors_doc, reason = "said once for all of them")]
impl Cache {
    /// Opens a folder, which is made unless it exists.
    pub fn open(folder: impl Into<PathBuf>) -> Result<Self, Error> {
        let folder = folder.into();
        fs::create_dir_all(&folder).map_err(files::Error::of("create the folder", &folder))?;
        files::probe(&folder)?;
        Ok(Self { folder })
    }

    /// A stored part, if it is there, readable, and was made from the same key.
    pub fn load<R: DeserializeOwned>(&self, name: &str, key: &impl Serialize) -> Option<R> {
        let bytes = fs::read(self.path(name).ok()?).ok()?;
        let (found, result): (Value, Value) = serde_json::from_slice(&bytes).ok()?;
        // Compared as it is read: both went through the same number formatting.
        let key: Value = serde_json::from_str(&serde_json::to_string(key).ok()?).ok()?;
        (found == key).then(|| serde_json::from_value(result).ok())?
    }

    /// Stores a part, whole or not at all.
    pub fn store(
        &self,
        name: &str,
        key: &impl Serialize,
        result: &impl Serialize,
    ) -> Result<(), Error> {
        let path = self.path(name)?;
        let text = serde_json::to_string_pretty(&(key, result))
            .map_err(|e| Error::file(name, &e.to_string()))?;
        files::write_atomically(path, |out| writeln!(out, "{text}"))?;
        Ok(())
    }

    /// Removes the folder with all its parts, after the final results have been written.
    pub fn remove(self) -> Result<(), Error> {
        fs::remove_dir_all(&self.folder).map_err(files::Error::of("remove", self.folder))?;
        Ok(())
    }

    fn path(&self, name: &str) -> Result<PathBuf, Error> {
        names::check(name)?;
        if name.contains('/') {
            return Err(Error::file(name, "give a name without folders"));
        }
        Ok(self.folder.join(format!("{name}.json")))
    }
}
