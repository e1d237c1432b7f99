//! Results of finished parts, kept so that an interrupted run continues where it was.

use std::path::Path;

use report::OutputDir;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::Error;

/// A folder of finished parts. Each is stored with everything it depends on and only used if that is the same.
#[derive(Clone, Debug)]
pub struct Partial {
    folder: OutputDir,
}

#[derive(Serialize)]
struct Stored<'a, K, R> {
    key: &'a K,
    result: &'a R,
}

#[derive(Deserialize)]
struct Found<R> {
    key: serde_json::Value,
    result: R,
}

impl Partial {
    /// The folder `name` inside the output folder.
    ///
    /// # Errors
    /// [`Error::Report`] if it cannot be written.
    pub fn open(output: &OutputDir, name: &str) -> Result<Self, Error> {
        Ok(Self {
            folder: output.subfolder(name)?,
        })
    }

    /// A stored part, if it is there, readable, and was made from the same `key`.
    pub fn load<R: DeserializeOwned>(&self, name: &str, key: &impl Serialize) -> Option<R> {
        let path = self.folder.path(&format!("{name}.json")).ok()?;
        let found: Found<R> = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
        let key = serde_json::to_string(key).ok()?;
        // Compared as text: both went through the same number formatting.
        let key: serde_json::Value = serde_json::from_str(&key).ok()?;
        (found.key == key).then_some(found.result)
    }

    /// Stores a part, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Report`] if it cannot be written.
    pub fn store(
        &self,
        name: &str,
        key: &impl Serialize,
        result: &impl Serialize,
    ) -> Result<(), Error> {
        let text = report::data::to_json(&Stored { key, result })?;
        self.folder.write(&format!("{name}.json"), text)?;
        Ok(())
    }

    /// Removes one part, if it is there.
    pub fn forget(&self, name: &str) {
        if let Ok(path) = self.folder.path(&format!("{name}.json")) {
            // Nothing to remove is as good.
            let _ = std::fs::remove_file(path);
        }
    }

    /// Removes the folder with all its parts, after the final results have been written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove(self) -> Result<(), Error> {
        let path: &Path = self.folder.as_path();
        std::fs::remove_dir_all(path).map_err(|source| Error::Io {
            action: "remove",
            path: path.to_owned(),
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_used_for_the_same_key_only() {
        let root = tempfile::tempdir().unwrap();
        let output = OutputDir::create(root.path()).unwrap();
        let partial = Partial::open(&output, "partial").unwrap();
        let (key, result) = (("radius", 0.1 + 0.2), vec![1.0 / 3.0, 1e-17]);
        assert_eq!(partial.load::<Vec<f64>>("a", &key), None);
        partial.store("a", &key, &result).unwrap();
        assert_eq!(partial.load("a", &key), Some(result));
        assert_eq!(partial.load::<Vec<f64>>("a", &("radius", 0.3)), None);
        std::fs::write(root.path().join("partial/a.json"), "{\"key\": [").unwrap();
        assert_eq!(partial.load::<Vec<f64>>("a", &key), None);
        partial.forget("a");
        partial.remove().unwrap();
        assert!(!root.path().join("partial").exists());
    }
}
