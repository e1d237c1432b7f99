//! Programs that let a mesh flow by several schemes.

use clap::Args;
use engine::{Method, Operator, Scheme, StepRule, checksum};
use geometry::UpAxis;
use serde_json::json;

use crate::meshes::{KnownMesh, MeshOptions};
use crate::options::FigureOptions;
use crate::session::Session;
use crate::surfaces::{self, Flowed, SchemeOptions, Surface, View, needed_network, scales};
use crate::{Error, memory};

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

/// What a program says about its flows besides the usual.
#[derive(Default)]
pub struct Remarks {
    /// Below the figure.
    pub note: String,
    /// Below the table on standard output.
    pub report: String,
}

impl MeshFlow {
    /// Runs the program. `remarks` looks at the flows, and may add to captions, pictures and metrics.
    ///
    /// # Errors
    /// What the options, the mesh and the flows raise.
    pub fn run(
        &self,
        options: &MeshFlowOptions,
        remarks: impl FnOnce(&mut Session<'_>, &mut [Flowed]) -> Result<Remarks, Error>,
    ) -> Result<(), Error> {
        let run = &options.figure.run;
        let n = options.figure.cells([32, self.cells]);
        let steps = options
            .steps
            .unwrap_or(if run.quick { 2 } else { self.steps });
        if steps == 0 {
            return Err(Error::Options("--steps must be at least 1".to_owned()));
        }
        let device = run.open_device()?;
        let networks = options.figure.networks.load(&[needed_network()])?;
        let network = networks.find(Scheme::Paper, &needed_network())?.network;
        let (grid, scales) = (options.mesh.grid(&self.mesh, n)?, scales(n));
        let mesh = options.mesh.load(&self.mesh, &grid)?;
        let up = options
            .up
            .map_or_else(|| options.mesh.up(self.view.up), Ok)?;
        let schemes = options.schemes.schemes();
        let parameters = json!({
            "mesh": mesh.about, "n": n, "box_side": grid.side(), "eps": scales.eps, "mcf_step": scales.mcf_step, "tau": self.tau,
            "steps": steps, "schemes": schemes, "network": checksum(&network), "quick": run.quick,
        });
        let mut session = Session::open(self.program, run, device, &parameters)?;
        let bar = session.progress.bar("signed distance".to_owned(), n as u64);
        let initial = session.phase("signed distance", || {
            mesh.phase_field(grid, scales.eps, &bar)
        })?;
        bar.finish();
        let mut flowed = Vec::new();
        for scheme in schemes {
            // The paper reports energies of its own scheme.
            let comparable = options.mesh.is_the_papers() && scheme == Scheme::Paper;
            let shown = self
                .shown
                .iter()
                .map(|&(k, w)| (k, w.filter(|_| comparable)));
            let operator = Operator::new(
                (Method::Hybrid, scheme),
                &networks.of(scheme),
                &needed_network(),
                &grid,
                &scales,
            )?;
            let title = &mesh.about.title;
            let time = (self.tau, steps);
            let case = surfaces::willmore_flow(title, initial.clone(), operator, scales, time);
            let surface = Surface {
                key: self.program,
                title: title.clone(),
                shown: shown.collect(),
                view: View { up, ..self.view },
            };
            flowed.push(surface.flow(case, &mut session)?);
        }
        let remarks = remarks(&mut session, &mut flowed)?;
        let title = format!("Willmore flow: {}", mesh.about.title);
        let note = format!(
            "n = {n}, ε = 2/n, inner step 1/n², {}. w: Willmore energy with the implicit finite-element step; a sphere has 8π = 25.13.{}",
            self.tau_in_words, remarks.note
        );
        let table = surfaces::write(&mut session, &title, note, &flowed)?;
        let mut summary = surfaces::summary(&flowed)?;
        if let Some(peak) = memory::peak_mib() {
            summary.insert(&format!("{}.peak_mib_with_pictures", self.program), peak)?;
        }
        session.finish(&title, summary, &(table + &remarks.report))
    }
}
