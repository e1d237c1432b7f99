//! A mesh of the paper under Willmore flow in several formulations.

use crate::meshes::{KnownMesh, MeshOptions};
use crate::prelude::*;
use crate::surfaces::{Flowed, FormulationOptions, Setting, Surface, View};

/// A program: a mesh, and how it flows there.
pub struct MeshFlow {
    /// Name of the experiment, and prefix of the metrics.
    pub program: &'static str,
    /// The help.
    pub about: &'static str,
    pub mesh: KnownMesh,
    pub cells: usize,
    pub steps: usize,
    pub tau: StepRule,
    /// Steps to be shown, with the energies that the paper reports.
    pub shown: &'static [(usize, Option<f64>)],
    pub view: View,
    /// Looks at the flows and says what else the note should say, see [`Setting::run`].
    pub remarks: fn(&mut Session, &mut [Flowed]) -> Result<String>,
}

#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    figure: FigureOptions,

    #[command(flatten)]
    mesh: MeshOptions,

    #[command(flatten)]
    formulations: FormulationOptions,

    /// Number of time steps [default: that of the paper]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,

    /// The axis that points up in the pictures: x, y or z [default: that of the paper's mesh; of another one the one that it names, or else y
    /// in OBJ files, z in PLY and STL files]
    #[arg(long, value_name = "AXIS")]
    up: Option<UpAxis>,
}

impl MeshFlow {
    /// Runs an experiment with this mesh.
    pub fn run(&self, own: &Experiment) -> ExitCode {
        own.run_with_help(self.about, |options| self.compute(options))
    }

    fn compute(&self, options: &Options) -> Result<()> {
        let run = &options.figure.run;
        let side = options.mesh.box_side(&self.mesh);
        let discretizations = options.formulations.learned();
        let usual = [32, self.cells];
        let setting = Setting::new(&options.figure, &discretizations, usual, side)?;
        let (time_steps, more) = self.time_steps(setting.n);
        let steps = (options.steps).unwrap_or(if run.quick { 2 } else { self.steps + more });
        require(steps > 0, "--steps must be at least 1")?;
        let mesh = options.mesh.load(&self.mesh, &setting.grid)?;
        let usual = options.mesh.mesh.as_ref().map(surfaces::up_axis);
        let up = (options.up.or(usual.transpose()?)).unwrap_or(self.view.up);
        let others = json!({ "mesh": mesh.about, "tau": time_steps.rule, "steps": steps });
        let parameters = setting.parameters(others)?;
        let mut session = Session::open(self.program, run, parameters)?;
        let initial = session.phase("signed distance", |stage| {
            mesh.phase_field(setting.grid, setting.scales.eps, &stage.bar)
        })?;
        let energy = |&(step, w): &(usize, Option<f64>)| {
            let step = if step > 1 { step + more } else { step };
            (step, w.filter(|_| mesh.is_papers))
        };
        let surface = Surface {
            key: self.program,
            title: mesh.title.clone(),
            shown: self.shown.iter().map(energy).collect(),
            view: View { up, ..self.view },
        };
        let title = format!("Willmore flow: {}", surface.title);
        let surfaces = [(surface, initial)];
        setting.run(session, &title, &surfaces, time_steps, steps, self.remarks)
    }

    /// The steps on `n` cells per unit length, and how many more than the paper's they are. On finer grids a first step that is
    /// shorter by the fourth power of their ratio moves the interface as many cells as the paper's does: doubling steps begin with it, and so many
    /// more lead to the same time; constant steps are made in substeps that begin with it. Where limbs vanish, a later step is too
    /// long for one minimization there, and is made in substeps, too.
    fn time_steps(&self, n: usize) -> (TimeSteps, usize) {
        let halvings = 4.0 * (n as f64 / self.cells as f64).log2();
        let halvings = halvings.round().max(0.0) as usize;
        if halvings == 0 {
            return (self.tau.into(), 0);
        }
        let first = self.tau.size(1) / 2.0_f64.powi(halvings as i32);
        let (rule, more) = match self.tau {
            StepRule::Doubling(_) => (StepRule::Doubling(first), halvings),
            rule => (rule, 0),
        };
        let steps = TimeSteps {
            first_substep: Some(first),
            ..rule.into()
        };
        (steps, more)
    }
}
