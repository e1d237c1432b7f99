//! Inpainting in 2D: Willmore flow of the values in a region, the rest of the image held.

use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use experiments::circles::Flow;
use experiments::evolution::{Evolution, NamedRegion, TimeSteps, Trajectory};
use experiments::method::{Method, Scheme};
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::surfaces::since;
use experiments::{Error, harness};
use geometry::contour::{Interpolation, zero_level};
use geometry::measure::l2_distance;
use geometry::shapes::{Ball, Cross, Cuboid};
use geometry::{Field, Grid, SignedDistanceExt, phase_field};
use model::{Network, Ratios};
use operators::ComputeDevice;
use report::{
    Axis, Colour, Column, Curve, Figure, Format, LineChart, Manifest, OutputDir, Progress, Rgb,
    Series, Shapes, Summary, Table,
};
use serde::Serialize;
use solver::{Factors, FlowParams, NewtonParams};

const PROGRAM: &str = "inpainting_2d";
/// Kernel width of the paper.
const WIDTH: usize = 17;
/// Interface width in cells: 2^-8 at n = 1024.
const EPS_OVER_H: f64 = 4.0;
/// `tautilde / h^2` of the default, 2^-18 at n = 1024: a quarter of `eps^2`, as in the paper's other experiments.
const STEP_OVER_H2: f64 = 4.0;
/// `tautilde` as the paper prints it.
const PRINTED_STEP: f64 = 1.0 / 16384.0;
/// The first time step is divided into a ramp that starts this many times halved.
const HALVINGS: usize = 12;
/// Parts of the ramp that are shown, too.
const RAMP_FRAMES: [usize; 4] = [1, 4, 7, 10];
/// A shape stands still once a step moves it by less than this part of the way it has come.
const STILL: f64 = 1e-5;
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
/// The paper has n = 1024, eps = 2^-8. From n = 512 on a part of the first step is too large for the minimization, which says so.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    /// Cells per unit length; eps = 4/n and tautilde = 4/n^2 follow [default: 256; paper: 1024]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,

    /// Steps of the disk [default: 100; the paper shows 2000, but here it stands still after a few]
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

    /// Lower left and upper right corner of D.
    fn region(self) -> [[f64; 2]; 2] {
        match self {
            Self::Disk => DISK_REGION.map(|x| [x, x]),
            Self::Cross => [-CROSS_REGION, CROSS_REGION].map(|x| [x, x]),
        }
    }

    fn nodes(self, grid: &Grid<2>) -> Vec<bool> {
        let [low, high] = self.region();
        (0..grid.len())
            .map(|i| {
                let x = grid.node(i);
                (0..2).all(|axis| low[axis] < x[axis] && x[axis] < high[axis])
            })
            .collect()
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
    halvings: usize,
    network: String,
    quick: bool,
}

/// One step of a picture's flow.
#[derive(Serialize)]
struct Row {
    picture: Picture,
    /// In units of the paper's step, fractions belong to the ramp.
    step: f64,
    time: f64,
    willmore_energy: f64,
    energy: f64,
    energy_before: f64,
    area: f64,
    newton: usize,
    hvp: usize,
    seconds: f64,
}

/// A finished picture.
struct Finished {
    picture: Picture,
    /// Steps of the paper's size that were made.
    steps: usize,
    trajectory: Trajectory<2>,
    /// Distance to the whole disk, at the shown steps.
    distances: Vec<(usize, f64)>,
    /// The first shown step from which the shape moved less than [`STILL`] per step.
    still: Option<usize>,
    /// Nodes outside D whose bits changed.
    changed_outside: usize,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    let n = options.cells.unwrap_or(if quick { 128 } else { 256 });
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
        newton: NewtonParams::default(),
        calibration: Factors::PAPER,
    };
    let pictures: Vec<Picture> = (Picture::ALL.into_iter())
        .filter(|p| options.only.is_none_or(|only| only == *p))
        .collect();
    let steps_of = |picture: Picture| match (picture, quick) {
        (_, true) => 2,
        (Picture::Disk, false) => options.disk_steps.unwrap_or(100),
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
        halvings: HALVINGS,
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
    for one in &finished {
        frames(&options.run, one)?.write(&output, &format!("{}_frames", one.picture.key()))?;
    }
    energies(&options.run, &finished).write(&output, "energies")?;
    let rows: Vec<Row> = finished.iter().flat_map(rows).collect();
    output.write("steps.csv", report::data::to_csv(&rows)?)?;
    let table = table(&finished)?;
    table.write(&output, "inpainting")?;
    summary(&finished, since(clock))?.write(&output)?;
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
            tau: TimeSteps::Ramp {
                tau: picture.tau(),
                halvings: HALVINGS,
            },
            region: None,
            // After the ramp, whole steps of the paper.
            sample_every: 100,
            also_sample: Vec::new(),
            steps: self.steps + HALVINGS,
            pause_after: None,
        };
        let shown = || {
            picture
                .shown()
                .iter()
                .filter(|&&k| k > 0 && k <= self.steps)
        };
        evolution.also_sample = shown().map(|k| k + HALVINGS).collect();
        evolution.also_sample.extend(RAMP_FRAMES);
        let grid = evolution.grid()?;
        let nodes = picture.nodes(&grid);
        evolution.region = Some(NamedRegion {
            name: format!("{:?}", picture.region()),
            nodes: nodes.clone().into(),
        });
        let bar = progress.bar(picture.title().to_owned(), evolution.steps as u64);
        let store = store.subfolder(picture.key())?;
        let trajectory = manifest.phase(picture.title(), || {
            let initial = |grid, eps| picture.initial(grid, eps);
            evolution.run(&initial, Some(network), device, &store, &bar)
        })?;
        bar.finish();
        let initial = trajectory.field(0)?;
        let whole = match picture {
            Picture::Disk => phase_field(grid, &Ball::new([0.0, 0.0], RADIUS)?, self.params.eps)?,
            Picture::Cross => initial.clone(),
        };
        let mut distances = vec![(0, l2_distance(&initial, &whole)?)];
        for &k in shown() {
            distances.push((k, l2_distance(&trajectory.field(k + HALVINGS)?, &whole)?));
        }
        let last = trajectory.field(self.steps + HALVINGS)?;
        if distances.last().is_none_or(|(k, _)| *k < self.steps) {
            distances.push((self.steps, l2_distance(&last, &whole)?));
        }
        // Per step, from one kept field to the next.
        let way = l2_distance(&last, &initial)?;
        let kept: Vec<usize> = (evolution.sampled_steps().into_iter())
            .filter(|&k| k > HALVINGS)
            .collect();
        let mut still = None;
        for pair in kept.windows(2).rev() {
            let moved = l2_distance(&trajectory.field(pair[0])?, &trajectory.field(pair[1])?)?;
            if moved / (pair[1] - pair[0]) as f64 > STILL * way {
                break;
            }
            still = Some(pair[0] - HALVINGS);
        }
        let changed_outside = (last.values().iter().zip(initial.values()).zip(&nodes))
            .filter(|((u, start), inside)| !**inside && u.to_bits() != start.to_bits())
            .count();
        Ok(Finished {
            picture,
            steps: self.steps,
            trajectory,
            distances,
            still,
            changed_outside,
        })
    }
}

/// The shapes over time, D outlined in green.
fn frames(run: &RunOptions, one: &Finished) -> Result<Figure, Error> {
    let tau = one.picture.tau();
    let times = &one.trajectory.evolution.tau;
    // Steps of the run, under the names that the paper would give them.
    let mut shown: Vec<(usize, String)> = vec![(0, "step 0".to_owned())];
    for k in RAMP_FRAMES {
        let part = (times.time(k) / tau).log2().round();
        shown.push((k, format!("2^{part} of a step")));
    }
    let later = |k: &&usize| **k > 0 && **k < one.steps;
    for &k in one.picture.shown().iter().filter(later).chain([&one.steps]) {
        shown.push((k + HALVINGS, format!("step {k}")));
    }
    let title = format!("Inpainting: {}", one.picture.title());
    let mut figure = Figure::new(run.title(&title), 4);
    let [[x0, y0], [x1, y1]] = one.picture.region();
    for (step, name) in shown {
        let curves = zero_level(&one.trajectory.field(step)?, Interpolation::Profile);
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
    let tau = format!("2^{}", tau.log2());
    Ok(figure.with_note(format!(
        "n = {}, τ = {tau}; only the values inside the green frame move. The first step is made in {} parts of growing size.",
        one.trajectory.evolution.n,
        HALVINGS + 1
    )))
}

fn energies(run: &RunOptions, all: &[Finished]) -> Figure {
    let mut figure = Figure::new(run.title("Willmore energy while inpainting"), 2);
    for one in all {
        let points: Vec<[f64; 2]> = (one.trajectory.records.iter())
            .map(|r| [r.time, r.willmore_energy])
            .collect();
        figure = figure.with_panel(
            LineChart::new(
                one.picture.title(),
                Axis::log("time t"),
                Axis::linear("Willmore energy w"),
            )
            .with_series(Series::new("w", points)),
        );
    }
    figure
}

fn rows(one: &Finished) -> Vec<Row> {
    (one.trajectory
        .records
        .iter()
        .zip(&one.trajectory.measures[1..]))
    .map(|(r, m)| Row {
        picture: one.picture,
        step: r.time / one.picture.tau(),
        time: r.time,
        willmore_energy: r.willmore_energy,
        energy: r.energy,
        energy_before: r.energy_before,
        area: m.volume,
        newton: r.newton.newton,
        hvp: r.newton.hvp,
        seconds: r.seconds,
    })
    .collect()
}

fn table(all: &[Finished]) -> Result<Table, Error> {
    let mut table = Table::new([
        Column::text("picture"),
        Column::number("step", Format::Shortest),
        Column::number(
            "distance to the whole disk, or to the start",
            Format::Fixed(5),
        ),
        Column::number("Willmore energy", Format::Fixed(3)),
    ]);
    for one in all {
        for &(k, distance) in &one.distances {
            let record = match k {
                0 => None,
                k => one.trajectory.records.get(k + HALVINGS - 1),
            };
            table.push([
                one.picture.title().into(),
                k.into(),
                distance.into(),
                record.map(|r| r.willmore_energy).into(),
            ])?;
        }
    }
    Ok(table)
}

fn summary(all: &[Finished], seconds: f64) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for one in all {
        let key = one.picture.key();
        for &(k, distance) in &one.distances {
            summary.insert(&format!("{key}.distance.step{k}"), distance)?;
        }
        let records = &one.trajectory.records;
        // Where nothing moves any more, the energy stays.
        let rises = records.iter().filter(|r| r.energy > r.energy_before);
        summary.insert_count(&format!("{key}.energy_increases"), rises.count())?;
        summary.insert_count(&format!("{key}.changed_outside"), one.changed_outside)?;
        summary.insert_count(&format!("{key}.steps"), one.steps)?;
        if let Some(still) = one.still {
            summary.insert_count(&format!("{key}.still_from_step"), still)?;
        }
        let hvp: f64 = records.iter().map(|r| r.newton.hvp as f64).sum();
        summary.insert(
            &format!("{key}.hvp_per_step"),
            hvp / records.len().max(1) as f64,
        )?;
        summary.insert(&format!("{key}.seconds"), one.trajectory.seconds)?;
    }
    summary.insert("seconds", seconds)?;
    Ok(summary)
}
