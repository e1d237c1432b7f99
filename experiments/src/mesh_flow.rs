//! Programs that let a mesh flow by several schemes.

use clap::Args;
use engine::{Method, StepRule};
use geometry::UpAxis;
use serde_json::json;

use crate::Error;
use crate::meshes::{KnownMesh, MeshOptions};
use crate::options::FigureOptions;
use crate::session::Session;
use crate::surfaces::{Flowed, SchemeOptions, Setting, Surface, SurfaceFlows, View};

/// Options of the programs.
#[derive(Args, Clone, Debug)]
pub struct MeshFlowOptions {
    /// Common options.
    #[command(flatten)]
    figure: FigureOptions,

    /// The mesh.
    #[command(flatten)]
    mesh: MeshOptions,

    /// The schemes.
    #[command(flatten)]
    schemes: SchemeOptions,

    /// Number of time steps [default: that of the paper]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,

    /// The axis that points up in the pictures: x, y or z [default: that of the paper's mesh; of another one the usual one of its format, y
    /// in OBJ files, z in PLY and STL files]
    #[arg(long, value_name = "AXIS")]
    up: Option<UpAxis>,
}

/// A program: a mesh of the paper, and how it flows there.
pub struct MeshFlow {
    /// Name of the program, its folder and its metrics.
    pub program: &'static str,
    /// The mesh.
    pub mesh: KnownMesh,
    /// Cells per unit length.
    pub cells: usize,
    /// Number of time steps.
    pub steps: usize,
    /// Their sizes.
    pub tau: StepRule,
    /// The same in words, for the figure.
    pub tau_in_words: &'static str,
    /// Steps to be shown, with the energies that the paper reports.
    pub shown: &'static [(usize, Option<f64>)],
    /// Direction of view.
    pub view: View,
}

impl MeshFlow {
    /// Runs the program. `remarks` is that of [`SurfaceFlows::run`].
    pub fn run(
        &self,
        options: &MeshFlowOptions,
        remarks: impl FnOnce(&mut Session<'_>, &mut [Flowed]) -> Result<String, Error>,
    ) -> Result<(), Error> {
        let run = &options.figure.run;
        let steps = (options.steps).unwrap_or(if run.quick { 2 } else { self.steps });
        if steps == 0 {
            return Err(Error::Options("--steps must be at least 1".to_owned()));
        }
        let device = run.open_device()?;
        let side = options.mesh.box_side(&self.mesh);
        let setting = Setting::new(&options.figure, [32, self.cells], side)?;
        let mesh = options.mesh.load(&self.mesh, &setting.grid)?;
        let up = (options.up).map_or_else(|| options.mesh.up(self.view.up), Ok)?;
        let schemes = options.schemes.schemes();
        let parameters = setting.parameters(json!({
            "mesh": mesh.about, "tau": self.tau, "steps": steps, "schemes": schemes,
        }))?;
        let mut session = Session::open(self.program, run, device, parameters)?;
        let bar = session.progress.bar("signed distance", setting.n as u64);
        let initial = session.phase("signed distance", || {
            mesh.phase_field(setting.grid, setting.scales.eps, &bar)
        })?;
        bar.finish();
        let papers = options.mesh.is_the_papers();
        let shown = (self.shown.iter()).map(|&(step, w)| (step, w.filter(|_| papers)));
        let surface = Surface {
            key: self.program,
            title: mesh.about.title.clone(),
            shown: shown.collect(),
            view: View { up, ..self.view },
        };
        let flows = SurfaceFlows {
            program: self.program,
            title: format!("Willmore flow: {}", surface.title),
            surfaces: vec![(surface, initial)],
            variants: schemes
                .into_iter()
                .map(|scheme| (Method::Hybrid, scheme))
                .collect(),
            time: (self.tau, steps),
            tau_in_words: self.tau_in_words,
        };
        flows.run(session, &setting, remarks)
    }
}
