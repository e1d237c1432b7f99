//! Programs that let a mesh flow by several schemes.

use std::time::Instant;

use clap::Args;
use render::Tube;
use report::{Manifest, Summary};
use serde::Serialize;

use crate::evolution::TimeSteps;
use crate::meshes::{About, KnownMesh, MeshOptions};
use crate::method::{Method, Scheme};
use crate::networks::{NetworkOptions, checksum};
use crate::options::RunOptions;
use crate::surfaces::{
    Finished, SchemeOptions, Setting, Snapshot, SurfaceRun, View, Workshop, ratios, scales, since,
    table, write_steps,
};
use crate::{Error, memory};

/// Options of the programs.
#[derive(Args, Clone, Debug)]
pub struct MeshFlowOptions {
    /// Common options.
    #[command(flatten)]
    pub run: RunOptions,

    /// Networks.
    #[command(flatten)]
    pub networks: NetworkOptions,

    /// The mesh.
    #[command(flatten)]
    pub mesh: MeshOptions,

    /// The schemes.
    #[command(flatten)]
    pub schemes: SchemeOptions,

    /// Cells per unit length; eps = 2/n and tautilde = 1/n^2 follow [default: that of the paper]
    #[arg(long, value_name = "N")]
    pub cells: Option<usize>,

    /// Number of time steps [default: that of the paper]
    #[arg(long, value_name = "COUNT")]
    pub steps: Option<usize>,
}

/// A program: a mesh of the paper, and how it flows there.
pub struct MeshFlow {
    /// Name of the program, its folder and its metrics.
    pub program: &'static str,
    /// The mesh.
    pub mesh: &'static KnownMesh,
    /// Cells per unit length.
    pub cells: usize,
    /// Number of time steps.
    pub steps: usize,
    /// Their sizes.
    pub tau: TimeSteps,
    /// The same in words, for the figure.
    pub tau_in_words: &'static str,
    /// Steps to be shown, with the energies that the paper reports.
    pub shown: &'static [(usize, Option<f64>)],
    /// Direction of view.
    pub view: View,
}

/// What a program says about the flow of its mesh besides the usual.
pub struct Extras<'a> {
    /// Further lines below a picture: run, what is shown.
    pub caption: Box<dyn Fn(usize, &Snapshot) -> String + 'a>,
    /// Curves drawn into a picture: run, step.
    pub tubes: Box<dyn Fn(usize, usize) -> Vec<Tube> + 'a>,
    /// Further sentences below the figure.
    pub note: String,
    /// Further metrics.
    pub metrics: Vec<(String, f64)>,
    /// Further files.
    pub files: Vec<(&'static str, String)>,
    /// Further lines of the report.
    pub report: String,
}

impl Default for Extras<'_> {
    fn default() -> Self {
        Self {
            caption: Box::new(|_, _| String::new()),
            tubes: Box::new(|_, _| Vec::new()),
            note: String::new(),
            metrics: Vec::new(),
            files: Vec::new(),
            report: String::new(),
        }
    }
}

#[derive(Serialize)]
struct Parameters<'a> {
    mesh: &'a About,
    n: usize,
    box_side: f64,
    eps: f64,
    mcf_step: f64,
    tau: TimeSteps,
    steps: usize,
    schemes: &'a [Scheme],
    network: String,
    quick: bool,
}

impl MeshFlow {
    /// Runs the program. `extras` looks at the finished flows.
    ///
    /// # Errors
    /// What the options, the mesh and the flows raise.
    pub fn run(
        &self,
        options: &MeshFlowOptions,
        extras: impl for<'a> FnOnce(&'a [Finished<'a>], &mut Manifest) -> Result<Extras<'a>, Error>,
    ) -> Result<(), Error> {
        let quick = options.run.quick;
        let n = options.cells.unwrap_or(if quick { 32 } else { self.cells });
        let steps = options.steps.unwrap_or(if quick { 2 } else { self.steps });
        if steps == 0 {
            return Err(Error::Options("--steps must be at least 1".to_owned()));
        }
        let device = options.run.open_device()?;
        let networks = options.networks.find(&[ratios()])?;
        let (grid, params) = (options.mesh.grid(self.mesh, n)?, scales(n));
        let mesh = options.mesh.load(self.mesh, &grid)?;
        let output = options.run.open_output(self.program)?;
        let schemes = options.schemes.schemes();
        let parameters = Parameters {
            mesh: &mesh.about,
            n,
            box_side: grid.side(),
            eps: params.eps,
            mcf_step: params.mcf_step,
            tau: self.tau,
            steps,
            schemes: &schemes,
            network: checksum(&networks[0]),
            quick,
        };
        let mut manifest = options.run.manifest(self.program, &parameters, &device)?;
        let progress = options.run.progress();
        let clock = Instant::now();
        let bar = progress.bar("signed distance".to_owned(), n as u64);
        let initial = manifest.phase("signed distance", || {
            mesh.phase_field(grid, params.eps, &bar)
        })?;
        bar.finish();
        let workshop = Workshop::new(&options.run, &device, &networks[0], &output, &progress);
        let papers = options.mesh.is_the_papers();
        let within = self.shown.iter().filter(|(step, _)| *step <= steps);
        let mut shown: Vec<(usize, Option<f64>)> = within.copied().collect();
        if shown.iter().all(|(step, _)| *step != steps) {
            shown.push((steps, None));
        }
        let mut finished = Vec::new();
        for &scheme in &schemes {
            // The paper reports energies of its own scheme.
            let comparable = papers && scheme == Scheme::Paper;
            let shown = shown.iter().map(|&(k, w)| (k, w.filter(|_| comparable)));
            finished.push(workshop.run(
                &mut manifest,
                SurfaceRun {
                    key: self.program.to_owned(),
                    title: mesh.about.title.clone(),
                    method: Method::Hybrid,
                    setting: Setting {
                        scheme,
                        ..Setting::default()
                    },
                    n,
                    tau: self.tau,
                    steps,
                    shown: shown.collect(),
                    initial: &initial,
                    identity: mesh.about.identity(),
                    view: self.view,
                },
            )?);
        }
        let extras = extras(&finished, &mut manifest)?;
        let title = format!("Willmore flow: {}", mesh.about.title);
        let figure = manifest.phase("pictures", || {
            workshop.figure(
                &title,
                &finished,
                &|run, s| {
                    let more = (extras.caption)(run, s);
                    format!("step {}: w = {:.2}{more}", s.step, s.w)
                },
                &extras.tubes,
            )
        })?;
        figure
            .with_note(format!(
                "n = {n}, ε = 2/n, inner step 1/n², {}. w: Willmore energy with the implicit finite-element step; a sphere has 8π = 25.13.{}",
                self.tau_in_words, extras.note
            ))
            .write(&output, "surfaces")?;
        let table = table(&finished)?;
        table.write(&output, "energies")?;
        write_steps(&finished, &output)?;
        let mut summary = Summary::new();
        for one in &finished {
            one.summarize(&mut summary)?;
        }
        for (name, value) in &extras.metrics {
            summary.insert(name, *value)?;
        }
        if let Some(peak) = memory::peak_mib() {
            summary.insert(&format!("{}.peak_mib_with_pictures", self.program), peak)?;
        }
        for (name, text) in &extras.files {
            output.write(name, text.as_bytes())?;
        }
        summary.insert("seconds", since(clock))?;
        summary.write(&output)?;
        manifest.write(&output)?;
        progress.clear();
        options.run.say(&format!(
            "{}\n{}{}\nResults are in {}",
            options.run.title(&title),
            table.to_markdown(),
            extras.report,
            output.as_path().display()
        ));
        Ok(())
    }
}
