//! `willmore fair`.

use std::path::{Path, PathBuf};

use engine::StepRule;

use super::flow::{FlowCommand, Shared};
use crate::cli::{FairOptions, MeshFormat};
use crate::error::Error;
use crate::input::{self, Loaded};

impl FlowCommand for FairOptions {
    const NAME: &'static str = "fair";

    fn shared(&mut self) -> Shared<'_> {
        self.flow.shared()
    }

    fn check(&mut self) -> Result<(), Error> {
        let flow = &self.flow;
        if flow.time.is_none() && flow.energy.is_none() && flow.steps.is_none() {
            return Err(Error::options(
                "say how smooth the mesh is to become: give --time, --energy or --steps",
            ));
        }
        if let Some(save) = &self.save {
            let refused = |reason| Error::options(format!("--save {}{reason}", save.display()));
            if !["ply", "obj", "stl"].contains(&&*input::extension(save)) {
                return Err(refused(" must end in .ply, .obj or .stl"));
            }
            let absolute = input::absolute(save)?;
            if !absolute.parent().is_some_and(Path::is_dir) {
                return Err(refused(": there is no such folder"));
            }
            self.save = Some(absolute);
        }
        Ok(())
    }

    fn prepare(&self, input: Loaded) -> Result<Loaded, Error> {
        match input {
            Loaded::Space(..) => Ok(input),
            Loaded::Plane(..) => Err(Error::options(
                "`fair` is for surfaces in space; for images and shapes in the plane there is `willmore flow`",
            )),
        }
    }

    fn rule(&mut self, mcf_step: f64) -> StepRule {
        self.flow.rule(mcf_step)
    }

    fn mesh(&self) -> (MeshFormat, Option<PathBuf>) {
        (self.format, self.save.clone())
    }
}
