//! A cube and a thick disk under Willmore flow.

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use experiments::evolution::TimeSteps;
use experiments::method::{Method, Scheme};
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::surfaces::{
    Finished, SchemeOptions, Setting, SurfaceRun, View, Workshop, centred_box, ratios, scales,
    since, table, write_steps,
};
use experiments::{Error, harness};
use geometry::shapes::{Cuboid, Cylinder};
use geometry::{Field, SignedDistanceExt, UpAxis, phase_field};
use report::Summary;
use serde::Serialize;

const PROGRAM: &str = "disk_and_cube";
/// Size of a time step.
const TAU: f64 = 1.0 / 262_144.0;
const STEPS: usize = 100;

/// Willmore flow of a cube and of a thick disk, n = 64, eps = 2^-5, tautilde = 2^-12, tau = 2^-18, by the hybrid scheme and by
/// nested implicit finite elements: pictures, Willmore energies w and L2 distances after 0, 1 and 100 steps.
///
/// Runs are kept in the folder `fields` of the output; an interrupted one continues.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    /// Cells per unit length; eps = 2/n and tautilde = 1/n^2 follow [default: 64]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,

    /// Number of time steps [default: 100]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,

    /// Half the side of the cube; the paper does not say, but its initial energy fits a cube of side 0.5
    #[arg(long, value_name = "LENGTH", default_value_t = 0.25)]
    cube_half_side: f64,

    /// Radius of the disk; the paper does not say, but its initial energy fits about 0.29
    #[arg(long, value_name = "LENGTH", default_value_t = 0.29)]
    disk_radius: f64,

    /// Half the height of the disk; the paper does not say
    #[arg(long, value_name = "LENGTH", default_value_t = 0.1)]
    disk_half_height: f64,

    /// Methods, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum, default_values_t = [Method::Hybrid, Method::FeImplicit])]
    methods: Vec<Method>,

    #[command(flatten)]
    schemes: SchemeOptions,
}

impl Options {
    /// Finite elements are the paper's reference, unless another scheme is wanted of all.
    fn variants(&self) -> Vec<(Method, Scheme)> {
        let schemes = |method: Method| match (method.is_learned(), self.schemes.scheme) {
            (true, _) => self.schemes.schemes(),
            (false, None | Some(Scheme::Paper)) => vec![Scheme::Paper],
            (false, Some(_)) => vec![Scheme::Calibrated],
        };
        let variants = |&method: &Method| schemes(method).into_iter().map(move |s| (method, s));
        self.methods.iter().flat_map(variants).collect()
    }
}

#[derive(Serialize)]
struct Parameters<'a> {
    n: usize,
    eps: f64,
    mcf_step: f64,
    tau: f64,
    steps: usize,
    variants: &'a [(Method, Scheme)],
    cube_half_side: f64,
    disk_radius: f64,
    disk_half_height: f64,
    network: String,
    quick: bool,
}

/// One of the two solids, with the energies that the paper reports for the hybrid scheme.
struct Solid {
    key: &'static str,
    title: &'static str,
    initial: Field<3>,
    papers: [f64; 3],
    identity: String,
}

fn solids(options: &Options, n: usize) -> Result<[Solid; 2], Error> {
    let Options {
        cube_half_side,
        disk_radius,
        disk_half_height,
        ..
    } = *options;
    let (grid, eps) = (centred_box(n, 1.0)?, scales(n).eps);
    let centre = [0.5; 3];
    let cube = Cuboid::new([cube_half_side; 3])?.translated(centre);
    let disk = Cylinder::new(disk_radius, disk_half_height)?.translated(centre);
    Ok([
        Solid {
            key: "cube",
            title: "cube",
            initial: phase_field(grid, &cube, eps)?,
            papers: [132.65, 52.26, 25.78],
            identity: format!("cube, half side {cube_half_side}"),
        },
        Solid {
            key: "disk",
            title: "thick disk",
            initial: phase_field(grid, &disk, eps)?,
            papers: [87.15, 50.49, 25.59],
            identity: format!("disk, radius {disk_radius}, half height {disk_half_height}"),
        },
    ])
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    let n = options.cells.unwrap_or(if quick { 24 } else { 64 });
    let steps = options.steps.unwrap_or(if quick { 2 } else { STEPS });
    if steps == 0 || options.methods.is_empty() {
        return Err(Error::Options(
            "--steps must be at least 1, and --methods must name a method".to_owned(),
        ));
    }
    let device = options.run.open_device()?;
    let networks = options.networks.find(&[ratios()])?;
    let solids = solids(options, n)?;
    let output = options.run.open_output(PROGRAM)?;
    let params = scales(n);
    let variants = options.variants();
    let parameters = Parameters {
        n,
        eps: params.eps,
        mcf_step: params.mcf_step,
        tau: TAU,
        steps,
        variants: &variants,
        cube_half_side: options.cube_half_side,
        disk_radius: options.disk_radius,
        disk_half_height: options.disk_half_height,
        network: checksum(&networks[0]),
        quick,
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let progress = options.run.progress();
    let clock = Instant::now();
    let workshop = Workshop::new(&options.run, &device, &networks[0], &output, &progress);
    let mut finished: Vec<Finished<'_>> = Vec::new();
    for solid in &solids {
        for &(method, scheme) in &variants {
            // The paper reports energies of the hybrid scheme only.
            let papers = (method, scheme) == (Method::Hybrid, Scheme::Paper);
            let paper = |k: usize| papers.then_some(solid.papers[k]);
            let mut shown = vec![(0, paper(0)), (1, paper(1))];
            if steps > 1 {
                shown.push((steps, paper(2).filter(|_| steps == STEPS)));
            }
            finished.push(workshop.run(
                &mut manifest,
                SurfaceRun {
                    key: solid.key.to_owned(),
                    title: solid.title.to_owned(),
                    method,
                    n,
                    tau: TimeSteps::Constant(TAU),
                    steps,
                    setting: Setting {
                        scheme,
                        ..Setting::default()
                    },
                    shown,
                    initial: &solid.initial,
                    identity: solid.identity.clone(),
                    view: View {
                        up: UpAxis::Z,
                        azimuth: 30.0,
                        elevation: 25.0,
                    },
                },
            )?);
        }
    }
    let distances = distances(&finished)?;
    let distance = |run: usize, step: usize| {
        let found = distances.iter().find(|d| d.run == run && d.step == step);
        found.map(|d| d.l2)
    };
    let caption = |run: usize, snapshot: &experiments::surfaces::Snapshot| {
        let l2 = distance(run, snapshot.step)
            .map_or(String::new(), |l2| format!("\nL² distance to FE {l2:.4}"));
        format!("step {}: w = {:.2}{l2}", snapshot.step, snapshot.w)
    };
    let figure = manifest.phase("pictures", || {
        workshop.figure(
            "Willmore flow of a cube and of a thick disk",
            &finished,
            &caption,
            &|_, _| Vec::new(),
        )
    })?;
    figure
        .with_note(format!(
            "n = {n}, ε = 2/n, inner step 1/n², τ = 2⁻¹⁸. w: Willmore energy with the implicit finite-element step; a sphere has 8π = 25.13."
        ))
        .write(&output, "surfaces")?;
    let table = table(&finished)?;
    table.write(&output, "energies")?;
    write_steps(&finished, &output)?;
    let mut summary = Summary::new();
    for f in &finished {
        f.summarize(&mut summary)?;
    }
    for d in &distances {
        let key = finished[d.run].key();
        summary.insert(&format!("{key}.l2_to_fe.step{}", d.step), d.l2)?;
    }
    summary.insert("seconds", since(clock))?;
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\nResults are in {}",
        options
            .run
            .title("Willmore flow of a cube and of a thick disk"),
        table.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

/// Distance of a run of the hybrid scheme to finite elements.
struct Distance {
    run: usize,
    step: usize,
    l2: f64,
}

fn distances(finished: &[Finished<'_>]) -> Result<Vec<Distance>, Error> {
    let mut distances = Vec::new();
    for (run, hybrid) in finished.iter().enumerate() {
        let is_partner =
            |f: &&Finished<'_>| f.run.key == hybrid.run.key && f.run.method == Method::FeImplicit;
        if !hybrid.run.method.is_learned() {
            continue;
        }
        let Some(elements) = finished.iter().find(is_partner) else {
            continue;
        };
        for step in hybrid.snapshots.iter().map(|s| s.step).filter(|&s| s > 0) {
            let l2 = hybrid.trajectory.distance(&elements.trajectory, step)?;
            distances.push(Distance { run, step, l2 });
        }
    }
    Ok(distances)
}
