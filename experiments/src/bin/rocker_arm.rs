//! A machine part of genus one under Willmore flow, and the Clifford torus next to it.

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use experiments::clifford::CliffordFit;
use experiments::evolution::TimeSteps;
use experiments::meshes::{About, KnownMesh, MeshOptions};
use experiments::method::Method;
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::surfaces::{
    SIDE, Setting, SurfaceRun, View, Workshop, ratios, scales, since, table, write_steps,
};
use experiments::{Error, harness};
use fem::FiniteElementStep;
use render::{Axis, Tube};
use report::Summary;
use serde::Serialize;

const PROGRAM: &str = "rocker_arm";
const ROCKER_ARM: KnownMesh = KnownMesh {
    file: "rocker-arm.obj",
    title: "rocker arm",
    side_length: 1.0,
    box_side: 1.25,
    procedural: surfaces::samples::lever,
    procedural_title: "built-in lever",
};
const TAU: f64 = 1.0 / 4096.0;
const STEPS: usize = 20;
/// Shown steps with the energies that the paper reports.
const SHOWN: [(usize, f64); 3] = [(0, 276.12), (1, 42.08), (20, 41.46)];
/// What the paper reports for the torus: its distance and its energy.
const PAPERS_L2: f64 = 3.978e-2;
const PAPERS_CLIFFORD: f64 = 41.11;
/// Circles drawn on the torus, and points of each.
const CIRCLES: (usize, usize) = (12, 96);

/// Willmore flow of the rocker arm, n = 64, eps = 2^-5, tau = tautilde = 2^-12: pictures and Willmore energies at steps 0, 1 and 20,
/// and the Clifford torus whose phase field is nearest to the last one in L2.
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

    /// Cells per unit length; eps = 2/n and tautilde = 1/n^2 follow [default: 64]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,

    /// Number of time steps [default: 20]
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
    tau: f64,
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
    let n = options.cells.unwrap_or(if quick { 32 } else { 64 });
    let steps = options.steps.unwrap_or(if quick { 2 } else { STEPS });
    if steps == 0 {
        return Err(Error::Options("--steps must be at least 1".to_owned()));
    }
    let device = options.run.open_device()?;
    let networks = options.networks.find(&[ratios()])?;
    let (grid, params) = (options.mesh.grid(&ROCKER_ARM, n)?, scales(n));
    let mesh = options.mesh.load(&ROCKER_ARM, &grid)?;
    let output = options.run.open_output(PROGRAM)?;
    let parameters = Parameters {
        mesh: &mesh.about,
        n,
        box_side: grid.side(),
        eps: params.eps,
        mcf_step: params.mcf_step,
        tau: TAU,
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
    let papers = options.mesh.is_the_papers();
    let mut shown: Vec<(usize, Option<f64>)> = SHOWN
        .into_iter()
        .filter(|(step, _)| *step <= steps)
        .map(|(step, w)| (step, papers.then_some(w)))
        .collect();
    if shown.iter().all(|(step, _)| *step != steps) {
        shown.push((steps, None));
    }
    let run = workshop.run(
        &mut manifest,
        SurfaceRun {
            key: PROGRAM.to_owned(),
            title: mesh.about.title.clone(),
            method: Method::Hybrid,
            n,
            tau: TimeSteps::Constant(TAU),
            steps,
            setting: Setting::default(),
            shown,
            initial: &initial,
            identity: mesh.about.identity(),
            view: View {
                up: Axis::Z,
                azimuth: 20.0,
                elevation: 20.0,
            },
        },
    )?;
    let fit = manifest.phase("Clifford torus", || {
        CliffordFit::to(&run.trajectory.field(steps)?, params.eps)
    })?;
    let clifford_w = FiniteElementStep::implicit(&grid, params.eps, params.mcf_step)?
        .willmore_energy(&fit.phase_field(&initial, params.eps)?)?;
    let circles = fit.minor_circles(CIRCLES.0, CIRCLES.1)?;
    let finished = [run];
    let figure = manifest.phase("pictures", || {
        workshop.figure(
            &format!("Willmore flow: {}", mesh.about.title),
            &finished,
            &|_, s| {
                let distance = if s.step == steps {
                    format!("\nL² distance to the torus {:.4}", fit.l2)
                } else {
                    String::new()
                };
                format!("step {}: w = {:.2}{distance}", s.step, s.w)
            },
            &|_, step| {
                let drawn = circles.iter().filter(|_| step == steps);
                drawn
                    .map(|c| Tube::new(c.clone(), 0.1 * params.eps).closed())
                    .collect()
            },
        )
    })?;
    figure
        .with_note(format!(
            "n = {n}, ε = 2/n, inner step 1/n², τ = 2⁻¹². w: Willmore energy with the implicit finite-element step; a Clifford torus has \
             4π² = 39.48, its phase field at this resolution {clifford_w:.2}. Circles: of the nearest Clifford torus."
        ))
        .write(&output, "surfaces")?;
    let table = table(&finished)?;
    table.write(&output, "energies")?;
    write_steps(&finished, &output)?;
    let mut summary = Summary::new();
    finished[0].summarize(PROGRAM, &mut summary)?;
    for (name, value) in [
        ("clifford_l2", fit.l2),
        ("clifford_w", clifford_w),
        ("clifford_outer_radius", fit.outer_radius),
    ] {
        summary.insert(&format!("{PROGRAM}.{name}"), value)?;
    }
    output.write("clifford.json", report::data::to_json(&fit)?)?;
    summary.insert("seconds", since(clock))?;
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\nNearest Clifford torus: L2 distance {:.4} (paper {PAPERS_L2:.4}), outer radius {:.3}, w = {clifford_w:.2} (paper \
         {PAPERS_CLIFFORD})\nResults are in {}",
        options
            .run
            .title(&format!("Willmore flow: {}", mesh.about.title)),
        table.to_markdown(),
        fit.l2,
        fit.outer_radius,
        output.as_path().display()
    ));
    Ok(())
}
