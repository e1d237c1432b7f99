//! Smoothings by other programs, which `scripts/other_smoothings` runs in Python.

use std::process::Command;

use serde::Deserialize;

use crate::prelude::*;

/// What other programs made.
#[derive(Deserialize, Default)]
pub struct Others {
    /// Of the programs, by name.
    pub versions: BTreeMap<String, String>,
    pub runs: Vec<OtherRun>,
    #[serde(skip)]
    folder: Option<tempfile::TempDir>,
}

#[derive(Deserialize)]
pub struct OtherRun {
    /// The name of the file that was smoothed, without its ending.
    pub of: String,
    pub method: String,
    /// Empty for the defaults.
    pub parameters: String,
    pub seconds: f64,
    files: Vec<String>,
}

impl Others {
    /// Lets other programs smooth the files that `write` puts into a folder: volumes of labels as NIfTI, or meshes as PLY.
    pub fn smooth(python: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<Self> {
        Self::run(python, "smooth", write)
    }

    /// Lets another program make triangles of equal size of meshes as PLY, and keep their sharp edges.
    pub fn remesh(python: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<Self> {
        Self::run(python, "remesh", write)
    }

    fn run(python: &Path, job: &str, write: impl FnOnce(&Path) -> Result<()>) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        write(folder.path())?;
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/other_smoothings");
        let status = Command::new(python)
            .arg(script)
            .arg(job)
            .arg(folder.path())
            .status()?;
        require(
            status.success(),
            "scripts/other_smoothings failed, as it says",
        )?;
        let told = files::read(folder.path().join("others.json"))?;
        Ok(Self {
            folder: Some(folder),
            ..serde_json::from_slice(&told)?
        })
    }

    /// Says which versions the programs have.
    pub fn tell(&self, session: &mut Session) {
        if !self.versions.is_empty() {
            let versions = self.versions.iter();
            let versions = versions.map(|(name, version)| format!("{name} {version}"));
            let versions: Vec<String> = versions.collect();
            session.remark(format!("Other programs: {}.", versions.join(", ")));
        }
    }

    pub fn meshes(&self, run: &OtherRun) -> Result<Vec<TriangleMesh>> {
        let folder = self.folder.as_ref().map_or(Path::new(""), |f| f.path());
        let read = |file: &String| Ok(surfaces::read(folder.join(file))?);
        run.files.iter().map(read).collect()
    }
}
