//! `willmore fair`.

use std::path::PathBuf;

use super::flow::Willmore;
use crate::cli::{FairOptions, FlowOptions, MeshFormat};
use crate::error::Error;
use crate::input::Loaded;

impl Willmore for FairOptions {
    const COMMAND: &'static str = "fair";

    fn flow(&mut self) -> &mut FlowOptions {
        &mut self.flow
    }

    fn check(&mut self) -> Result<(), Error> {
        let steps = &self.flow.steps;
        if steps.time.is_none() && steps.energy.is_none() && steps.steps.is_none() {
            return Err(Error::options(
                "say how smooth the mesh is to become: give --time, --energy or --steps",
            ));
        }
        if let Some(save) = &self.save {
            let extension = save.extension().and_then(|e| e.to_str()).unwrap_or("");
            if !["ply", "obj", "stl"].contains(&extension.to_ascii_lowercase().as_str()) {
                return Err(Error::options(format!(
                    "--save {} must end in .ply, .obj or .stl",
                    save.display()
                )));
            }
            let absolute = std::path::absolute(save).map_err(|source| Error::Io {
                action: "find",
                path: save.clone(),
                source,
            })?;
            if !absolute.parent().is_some_and(std::path::Path::is_dir) {
                return Err(Error::options(format!(
                    "--save {}: there is no such folder",
                    save.display()
                )));
            }
            self.save = Some(absolute);
        }
        Ok(())
    }

    fn prepare(&self, input: Loaded, _: f64) -> Result<Loaded, Error> {
        match input {
            Loaded::Space(..) => Ok(input),
            Loaded::Plane(..) => Err(Error::options(
                "`fair` is for surfaces in space; for images and shapes in the plane there is `willmore flow`",
            )),
        }
    }

    fn mesh(&self) -> (MeshFormat, Option<PathBuf>) {
        (self.format, self.save.clone())
    }
}
