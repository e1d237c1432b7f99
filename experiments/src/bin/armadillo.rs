//! A scanned figure under Willmore flow with time steps that double.

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use experiments::evolution::TimeSteps;
use experiments::meshes::{ARMADILLO, About, MeshOptions};
use experiments::method::Method;
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::surfaces::{
    SIDE, Setting, SurfaceRun, View, Workshop, ratios, scales, since, table, write_steps,
};
use experiments::{Error, harness, memory};
use render::Axis;
use report::Summary;
use serde::Serialize;

const PROGRAM: &str = "armadillo";
/// The first time step; every further one is twice as long.
const FIRST_TAU: f64 = 1.0 / 4_194_304.0;
const STEPS: usize = 16;
const SHOWN: [usize; 5] = [0, 1, 8, 11, 16];

/// Willmore flow of the armadillo, n = 128, eps = 2^-6, tautilde = 2^-14, with tau = 2^-22 doubled after every step: pictures and
/// Willmore energies at steps 0, 1, 8, 11 and 16.
///
/// Steps are kept in the folder `fields` of the output; an interrupted run continues.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    #[command(flatten)]
    mesh: MeshOptions,

    /// Cells per unit length; eps = 2/n and tautilde = 1/n^2 follow [default: 128]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,

    /// Number of time steps [default: 16]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,
}

#[derive(Serialize)]
struct Parameters<'a> {
    mesh: &'a About,
    n: usize,
    box_side: f64,
    eps: f64,
    mcf_step: f64,
    first_tau: f64,
    steps: usize,
    network: String,
    quick: bool,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    let n = options.cells.unwrap_or(if quick { 32 } else { 128 });
    let steps = options.steps.unwrap_or(if quick { 2 } else { STEPS });
    if steps == 0 {
        return Err(Error::Options("--steps must be at least 1".to_owned()));
    }
    let device = options.run.open_device()?;
    let networks = options.networks.find(&[ratios()])?;
    let (grid, params) = (options.mesh.grid(&ARMADILLO, n)?, scales(n));
    let mesh = options.mesh.load(&ARMADILLO, &grid)?;
    let output = options.run.open_output(PROGRAM)?;
    let parameters = Parameters {
        mesh: &mesh.about,
        n,
        box_side: grid.side(),
        eps: params.eps,
        mcf_step: params.mcf_step,
        first_tau: FIRST_TAU,
        steps,
        network: checksum(&networks[0]),
        quick,
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let progress = options.run.progress();
    let clock = Instant::now();
    let bar = progress.bar("signed distance".to_owned(), n as u64);
    let initial = manifest.phase("signed distance", || {
        mesh.phase_field(grid, params.eps, &bar)
    })?;
    bar.finish();
    let workshop = Workshop {
        options: &options.run,
        device: &device,
        network: &networks[0],
        output: &output,
        progress: &progress,
        side: SIDE,
    };
    let mut shown: Vec<usize> = SHOWN.into_iter().filter(|&s| s <= steps).collect();
    if !shown.contains(&steps) {
        shown.push(steps);
    }
    let run = workshop.run(
        &mut manifest,
        SurfaceRun {
            key: PROGRAM.to_owned(),
            title: mesh.about.title.clone(),
            method: Method::Hybrid,
            n,
            tau: TimeSteps::Doubling(FIRST_TAU),
            steps,
            setting: Setting::default(),
            shown: shown.into_iter().map(|step| (step, None)).collect(),
            initial: &initial,
            identity: mesh.about.identity(),
            view: View {
                up: Axis::Y,
                azimuth: 205.0,
                elevation: 8.0,
            },
        },
    )?;
    let finished = [run];
    let figure = manifest.phase("pictures", || {
        workshop.figure(
            &format!("Willmore flow: {}", mesh.about.title),
            &finished,
            &|_, s| format!("step {}: w = {:.1}", s.step, s.w),
            &|_, _| Vec::new(),
        )
    })?;
    figure
        .with_note(format!(
            "n = {n}, ε = 2/n, inner step 1/n², first step τ = 2⁻²², doubled after every step. w: Willmore energy with the implicit \
             finite-element step; a sphere has 8π = 25.13."
        ))
        .write(&output, "surfaces")?;
    let table = table(&finished)?;
    table.write(&output, "energies")?;
    write_steps(&finished, &output)?;
    let mut summary = Summary::new();
    finished[0].summarize(PROGRAM, &mut summary)?;
    if let Some(peak) = memory::peak_mib() {
        summary.insert(&format!("{PROGRAM}.peak_mib_with_pictures"), peak)?;
    }
    summary.insert("seconds", since(clock))?;
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\nResults are in {}",
        options
            .run
            .title(&format!("Willmore flow: {}", mesh.about.title)),
        table.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}
