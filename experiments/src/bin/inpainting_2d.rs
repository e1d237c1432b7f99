//! Inpainting in 2D: Willmore flow of the values in a region, the rest of the image held.

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use experiments::circles::Flow;
use experiments::evolution::{Evolution, TimeSteps, Trajectory};
use experiments::inpainting::{self, Inpainted, STILL, Window, division};
use experiments::method::{Method, Scheme};
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::surfaces::since;
use experiments::{Error, harness};
use geometry::contour::{Interpolation, zero_level};
use geometry::shapes::{Ball, Cross, Cuboid};
use geometry::{Field, Grid, SignedDistanceExt, phase_field};
use model::{Network, Ratios};
use operators::ComputeDevice;
use report::{Colour, Curve, Figure, Manifest, OutputDir, Progress, Rgb, Shapes, Summary};
use serde::Serialize;
use solver::{Factors, FlowParams, NewtonParams, Precision};

const PROGRAM: &str = "inpainting_2d";
/// Kernel width of the paper.
const WIDTH: usize = 17;
/// Interface width in cells: 2^-8 at n = 1024.
const EPS_OVER_H: f64 = 4.0;
/// `tautilde / h^2` of the default, 2^-18 at n = 1024: a quarter of `eps^2`, as in the paper's other experiments.
const STEP_OVER_H2: f64 = 4.0;
/// `tautilde` as the paper prints it.
const PRINTED_STEP: f64 = 1.0 / 16384.0;
/// Inside the first step, which is made in parts, the shapes after `2^-k` of it are shown, for these `k`.
const INSIDE: [u32; 4] = [12, 9, 6, 3];
/// Radius of the disk.
const RADIUS: f64 = 0.35;
/// The cut-out corner: everything right of and above this.
const CORNER: f64 = 0.12;
/// The region of the disk reaches from here to the corner of the box.
const DISK_REGION: [f64; 2] = [0.08, 0.42];
/// Half length and half width of the arms of the cross.
const CROSS: [f64; 2] = [0.4, 0.1];
/// Half side of the region of the cross.
const CROSS_REGION: f64 = 0.22;

/// Inpainting: a disk whose corner was cut out grows round again (tau = 2^-7), the middle of a cross is smoothed (tau = 2^-14). Only
/// the values in the region D, outlined in green, move; all others stay bit for bit.
///
/// Steps are made in parts of adaptive size where one minimization would be too much for them. A run ends when nothing moves any more.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    /// Cells per unit length; eps = 4/n and tautilde = 4/n^2 follow [default: 1024, as in the paper]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,

    /// Most steps of the disk [default: 2000, as in the paper; it stands still long before]
    #[arg(long, value_name = "COUNT")]
    disk_steps: Option<usize>,

    /// Use tautilde = 2^-14 as the paper's caption prints it. At the paper's n = 1024 that is 4 eps^2, beyond the bound 8/9 eps^2 of
    /// the scheme, which refuses it; at n = 256 it is the default
    #[arg(long)]
    printed_tautilde: bool,

    /// One image alone
    #[arg(long, value_name = "NAME", value_enum)]
    only: Option<Picture>,

    /// Weights of the energy and network: paper, calibrated or accurate
    #[arg(long, value_name = "NAME", value_enum, default_value_t = Scheme::Accurate)]
    scheme: Scheme,
}

#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum Picture {
    /// The disk with a cut-out corner
    Disk,
    /// The cross with a middle to be smoothed
    Cross,
}

impl Picture {
    const ALL: [Self; 2] = [Self::Disk, Self::Cross];

    fn key(self) -> &'static str {
        match self {
            Self::Disk => "disk",
            Self::Cross => "cross",
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Disk => "disk with a cut-out corner",
            Self::Cross => "cross",
        }
    }

    fn tau(self) -> f64 {
        match self {
            Self::Disk => 1.0 / 128.0,
            Self::Cross => 1.0 / 16384.0,
        }
    }

    /// The paper's frames.
    fn shown(self) -> &'static [usize] {
        match self {
            Self::Disk => &[0, 1, 100, 500, 1000, 1500, 2000],
            Self::Cross => &[0, 1, 5, 10, 20, 35, 50],
        }
    }

    fn initial(self, grid: Grid<2>, eps: f64) -> Result<Field<2>, Error> {
        let [length, width] = CROSS;
        Ok(match self {
            Self::Disk => {
                let middle = 0.5 * (CORNER + 0.5);
                let half = 0.5 * (0.5 - CORNER);
                let corner = Cuboid::new([half, half])?.translated([middle, middle]);
                phase_field(
                    grid,
                    &Ball::new([0.0, 0.0], RADIUS)?.difference(corner),
                    eps,
                )?
            }
            Self::Cross => phase_field(grid, &Cross::new(length, width)?, eps)?,
        })
    }

    /// D.
    fn region(self) -> Window<2> {
        let [low, high] = match self {
            Self::Disk => DISK_REGION,
            Self::Cross => [-CROSS_REGION, CROSS_REGION],
        };
        Window {
            low: [low; 2],
            high: [high; 2],
        }
    }
}

#[derive(Serialize)]
struct Parameters {
    n: usize,
    eps: f64,
    mcf_step: f64,
    scheme: Scheme,
    pictures: Vec<Picture>,
    steps: Vec<usize>,
    first_part: f64,
    still: f64,
    network: String,
    quick: bool,
}

/// A picture that has flowed.
struct Finished {
    picture: Picture,
    trajectory: Trajectory<2>,
    nodes: Arc<[bool]>,
    /// The whole disk.
    whole: Option<Field<2>>,
}

impl Finished {
    fn measure(&self) -> Result<Inpainted<'_, 2>, Error> {
        let picture = self.picture;
        let names = (picture.key(), picture.title());
        let (nodes, shown) = (&self.nodes, picture.shown());
        Inpainted::measure(names, &self.trajectory, nodes, shown, self.whole.as_ref())
    }
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    let n = options.cells.unwrap_or(if quick { 256 } else { 1024 });
    let eps = EPS_OVER_H / n as f64;
    let step_over_h2 = if options.printed_tautilde {
        PRINTED_STEP * (n * n) as f64
    } else {
        STEP_OVER_H2
    };
    let ratios = Ratios {
        dimension: 2,
        width: WIDTH,
        eps_over_h: EPS_OVER_H,
        step_over_h2,
    };
    ratios.validate()?;
    let device = options.run.open_device()?;
    let networks = options.networks.find(&[ratios])?;
    let output = options.run.open_output(PROGRAM)?;
    let params = FlowParams {
        eps,
        mcf_step: step_over_h2 / (n * n) as f64,
        // Steps are large here, tau/tautilde^2 up to 2^29: in single precision products would lose the slow modes of the Hessian.
        newton: NewtonParams {
            precision: Precision::Device,
            ..NewtonParams::default()
        },
        calibration: Factors::PAPER,
    };
    let pictures: Vec<Picture> = (Picture::ALL.into_iter())
        .filter(|p| options.only.is_none_or(|only| only == *p))
        .collect();
    let steps_of = |picture: Picture| match (picture, quick) {
        (_, true) => 5,
        (Picture::Disk, false) => options.disk_steps.unwrap_or(2000),
        (Picture::Cross, false) => 50,
    };
    if pictures.iter().any(|&p| steps_of(p) == 0) {
        return Err(Error::Options("--disk-steps must be at least 1".to_owned()));
    }
    let parameters = Parameters {
        n,
        eps,
        mcf_step: params.mcf_step,
        scheme: options.scheme,
        steps: pictures.iter().map(|&p| steps_of(p)).collect(),
        pictures: pictures.clone(),
        first_part: division(eps, &INSIDE).first,
        still: STILL,
        network: checksum(&networks[0]),
        quick,
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let progress = options.run.progress();
    let store = output.subfolder("fields")?;
    let clock = Instant::now();
    let mut finished = Vec::new();
    for picture in pictures {
        let run = Run {
            picture,
            n,
            params,
            scheme: options.scheme,
            steps: steps_of(picture),
        };
        finished.push(run.execute(&networks[0], &device, &store, &progress, &mut manifest)?);
    }
    let measured = (finished.iter().map(Finished::measure)).collect::<Result<Vec<_>, Error>>()?;
    for (one, measured) in finished.iter().zip(&measured) {
        let name = format!("{}_frames", one.picture.key());
        frames(&options.run, one, measured.still_from())?.write(&output, &name)?;
    }
    inpainting::energies(&options.run, &measured).write(&output, "energies")?;
    output.write("steps.csv", inpainting::steps_csv(&measured)?)?;
    let table = inpainting::table(&measured)?;
    table.write(&output, "inpainting")?;
    let mut summary = Summary::new();
    for one in &measured {
        one.summarize(&mut summary)?;
    }
    summary.insert("seconds", since(clock))?;
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\nResults are in {}",
        options.run.title("Inpainting"),
        table.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

struct Run {
    picture: Picture,
    n: usize,
    params: FlowParams,
    scheme: Scheme,
    steps: usize,
}

impl Run {
    fn execute(
        &self,
        network: &Network,
        device: &ComputeDevice,
        store: &OutputDir,
        progress: &Progress,
        manifest: &mut Manifest,
    ) -> Result<Finished, Error> {
        let picture = self.picture;
        let mut evolution = Evolution {
            shape: format!("inpainted {}", picture.title()),
            flow: Flow::Willmore,
            method: Method::Hybrid,
            scheme: self.scheme,
            n: self.n,
            side: 1.0,
            centre: 0.0,
            params: self.params,
            tau: TimeSteps::Constant(picture.tau()),
            division: Some(division(self.params.eps, &INSIDE)),
            still: Some(STILL),
            region: None,
            sample_every: self.steps,
            also_sample: picture.shown().to_vec(),
            steps: self.steps,
            pause_after: None,
        };
        let grid = evolution.grid()?;
        let region = picture.region().nodes(&grid);
        let nodes = region.nodes.clone();
        evolution.region = Some(region);
        let bar = progress.bar(picture.title().to_owned(), evolution.steps as u64);
        let store = store.subfolder(picture.key())?;
        let trajectory = manifest.phase(picture.title(), || {
            let initial = |grid, eps| picture.initial(grid, eps);
            evolution.run(&initial, Some(network), device, &store, &bar)
        })?;
        bar.finish();
        let whole = match picture {
            Picture::Disk => Some(phase_field(
                grid,
                &Ball::new([0.0, 0.0], RADIUS)?,
                self.params.eps,
            )?),
            Picture::Cross => None,
        };
        Ok(Finished {
            picture,
            trajectory,
            nodes,
            whole,
        })
    }
}

/// The shapes over time, D outlined in green.
fn frames(run: &RunOptions, one: &Finished, still: Option<f64>) -> Result<Figure, Error> {
    let (picture, trajectory) = (one.picture, &one.trajectory);
    let mut shown = vec![("step 0".to_owned(), trajectory.field(0)?)];
    for k in INSIDE {
        if let Some(field) = trajectory.part_field(k)? {
            shown.push((format!("2^-{k} of a step"), field));
        }
    }
    let last = trajectory.steps();
    let later = |k: &usize| (1..last).contains(k);
    for k in (picture.shown().iter().copied().filter(later)).chain([last]) {
        let time = trajectory.record(k).map_or(0.0, |r| r.time / picture.tau());
        let name = if time < k as f64 - 1e-9 {
            format!("{time:.3} steps")
        } else {
            format!("step {k}")
        };
        shown.push((name, trajectory.field(k)?));
    }
    let title = format!("Inpainting: {}", picture.title());
    let mut figure = Figure::new(run.title(&title), 4);
    let Window {
        low: [x0, y0],
        high: [x1, y1],
    } = picture.region();
    for (name, field) in shown {
        let curves = zero_level(&field, Interpolation::Profile);
        let loops: Vec<Vec<[f64; 2]>> = curves.into_iter().map(|curve| curve.points).collect();
        let region = Curve::new(vec![vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]]])
            .with_colour(Colour::Custom(Rgb(0, 140, 60)))
            .with_width(1.6);
        figure = figure.with_panel(
            Shapes::new(name)
                .with_curve(Curve::new(loops).filled(Colour::LightGrey))
                .with_curve(region)
                .with_window([-0.5, 0.5], [-0.5, 0.5]),
        );
    }
    let end = still.map_or(String::new(), |still| {
        format!(" The shape stands still after {still:.3} steps.")
    });
    Ok(figure.with_note(format!(
        "n = {}, τ = 2^{}; only the values inside the green frame move. The first step is made in {} parts.{end}",
        trajectory.evolution.n,
        picture.tau().log2(),
        trajectory.parts(1).len(),
    )))
}
