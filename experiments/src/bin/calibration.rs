//! The factors by which the hybrid scheme differs from Willmore flow, predicted and measured on discs.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use experiments::circles;
use experiments::method::Method;
use experiments::networks::checksum;
use experiments::options::RunOptions;
use experiments::{Error, harness};
use fem::LinearSolver;
use geometry::measure::zero_set_volume;
use geometry::shapes::Ball;
use geometry::{Field, Grid, phase_field};
use model::{Calibration, Network, pretrained};
use operators::ComputeDevice;
use report::{
    Axis, Colour, Column, Figure, Format, LineChart, LineStyle, Marker, OutputDir, Series, Summary,
    Table,
};
use serde::Serialize;
use solver::{Factors, FlowParams, NewtonParams};

const PROGRAM: &str = "calibration";
/// Interface width of the discs, as in the convergence tests.
const EPS: f64 = circles::EPS;
/// Inner time step of the discs.
const STEP: f64 = circles::STEP;
/// Time step of the measurement: the disc hardly moves, and its profile relaxes all the same.
const TAU: f64 = STEP / 8.0;
/// Distance of the interface to the box's boundary.
const MARGIN: f64 = 0.3;

/// Calibrates the shipped networks, or others, and compares the predicted Willmore energy of discs of either phase with the
/// one that the scheme finds.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// Calibrate this safetensors file in place of the shipped networks; can be repeated
    #[arg(long, value_name = "FILE")]
    network: Vec<PathBuf>,

    /// Write the networks with their calibration to this folder
    #[arg(long, value_name = "DIR")]
    install: Option<PathBuf>,
}

#[derive(Serialize)]
struct Parameters {
    networks: BTreeMap<String, String>,
    eps: f64,
    inner_step: f64,
    time_step: f64,
    quick: bool,
}

/// A network under its name.
struct Calibrated {
    name: String,
    network: Network,
    calibration: Calibration,
}

/// The Willmore energy that the scheme sees in a disc.
#[derive(Serialize)]
struct DiscRow {
    network: String,
    odd_part: bool,
    /// 1: the phase `u = 1` is the disc; -1: the phases are exchanged.
    phase: i8,
    radius: f64,
    /// `w` without calibration over `pi / R`.
    measured: f64,
    /// `c (1 - kappa_0 R)^2`.
    predicted: f64,
    /// `w` with calibration over `pi / R`.
    calibrated: f64,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let run = &options.run;
    let mut networks = Vec::new();
    if options.network.is_empty() {
        for (name, network) in pretrained::all()? {
            networks.push((name.to_owned(), network));
        }
    }
    for path in &options.network {
        let network = Network::load(path)?;
        networks.push((pretrained::file_name(network.ratios()), network));
    }
    if run.quick {
        networks.truncate(1);
    }
    let device = run.open_device()?;
    let output = run.open_output(PROGRAM)?;
    let install = (options.install.as_ref())
        .map(OutputDir::create)
        .transpose()?;
    let parameters = Parameters {
        networks: (networks.iter())
            .map(|(name, network)| (name.clone(), checksum(network)))
            .collect(),
        eps: EPS,
        inner_step: STEP,
        time_step: TAU,
        quick: run.quick,
    };
    let mut manifest = run.manifest(PROGRAM, &parameters, &device)?;
    let mut all = Vec::new();
    for (name, network) in networks {
        let calibration = manifest.phase(name.clone(), || network.calibrate())?;
        if let Some(install) = &install {
            let network = network.clone().with_calibration(Some(calibration));
            network.save(&install.path(&name)?)?;
        }
        all.push(Calibrated {
            name,
            network,
            calibration,
        });
    }

    let radii: &[f64] = if run.quick {
        &[0.15, 0.3]
    } else {
        &[0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6]
    };
    let progress = run.progress();
    let mut discs = Vec::new();
    for one in &all {
        let Some(n) = one.convergence_cells().filter(|&n| n <= 256) else {
            continue;
        };
        let bar = progress.bar(one.name.clone(), 4 * radii.len() as u64);
        for odd_part in [false, true] {
            let (network, calibration) = if odd_part {
                let odd = one.network.odd_part();
                let calibration = odd.calibrate()?;
                (odd, calibration)
            } else {
                (one.network.clone(), one.calibration)
            };
            let tasks: Vec<(f64, i8)> = radii.iter().flat_map(|&r| [(r, 1), (r, -1)]).collect();
            let order: Vec<usize> = (0..tasks.len()).rev().collect();
            let rows = manifest.phase(format!("discs of {}", one.name), || {
                harness::in_parallel(&order, harness::workers(&device), |i| {
                    let (radius, phase) = tasks[i];
                    let measured =
                        disc_energy(&network, n, radius, phase, Factors::PAPER, &device)?;
                    let calibrated =
                        disc_energy(&network, n, radius, phase, calibration.factors, &device)?;
                    bar.inc(1);
                    let offset = calibration.spontaneous_curvature / EPS * f64::from(phase);
                    let predicted = calibration.factors.energy * (1.0 - offset * radius).powi(2);
                    Ok(DiscRow {
                        network: one.name.clone(),
                        odd_part,
                        phase,
                        radius,
                        measured,
                        predicted,
                        calibrated,
                    })
                })
            })?;
            discs.extend(rows);
        }
        bar.finish();
    }

    figure(run, &discs).write(&output, "discs")?;
    output.write("discs.csv", report::data::to_csv(&discs)?)?;
    output.write("discs.json", report::data::to_json(&discs)?)?;
    let table = table(&all)?;
    table.write(&output, "calibration")?;
    let discs = disc_table(&discs)?;
    discs.write(&output, "discs_table")?;
    summary(&all)?.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    run.say(&format!(
        "{}\n{}\n{}\nResults are in {}",
        run.title("Calibration of the learned operators"),
        table.to_markdown(),
        discs.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

impl Calibrated {
    /// Cells per unit length at which the network has the scales of the convergence tests.
    fn convergence_cells(&self) -> Option<usize> {
        let ratios = self.network.ratios();
        let n = (ratios.eps_over_h / EPS).round();
        let fits = ratios.dimension == 2 && (ratios.step_over_h2 - n * n * STEP).abs() < 1e-9;
        fits.then_some(n as usize)
    }
}

/// Willmore energy of a relaxed disc over that of its zero level set, `pi / R`.
fn disc_energy(
    network: &Network,
    n: usize,
    radius: f64,
    phase: i8,
    calibration: Factors,
    device: &ComputeDevice,
) -> Result<f64, Error> {
    let half = ((radius + MARGIN) * n as f64).ceil();
    let grid = Grid::<2>::centred(2 * half as usize, 2.0 * half / n as f64)?;
    let sign = f64::from(phase);
    let disc = phase_field(grid, &Ball::new([0.0, 0.0], radius)?, EPS)?;
    let values = disc.values().iter().map(|u| sign * u).collect();
    let disc = Field::from_values(grid, values)?;
    let params = FlowParams {
        eps: EPS,
        mcf_step: STEP,
        newton: NewtonParams::default(),
        calibration,
    };
    let linear = LinearSolver::default();
    let mut flow = Method::Hybrid.willmore_flow(Some(network), &disc, params, linear, device)?;
    let record = flow.advance(TAU)?;
    let field = flow.field()?;
    let inside = zero_set_volume(&field);
    let area = if phase > 0 {
        inside
    } else {
        grid.side().powi(2) - inside
    };
    Ok(record.willmore_energy * (area / PI).sqrt() / PI)
}

fn table(all: &[Calibrated]) -> Result<Table, Error> {
    let number = |name: &str| Column::number(name, Format::Fixed(4));
    let small = |name: &str| Column::number(name, Format::Scientific(1));
    let mut table = Table::new([
        Column::text("network"),
        number("c"),
        number("m"),
        number("c/m"),
        number("displacement"),
        number("cos² of ψ and w'"),
        small("ε κ₀"),
        small("eigenvalue - 1"),
        small("spread over positions"),
        small("spread over normals"),
    ]);
    for one in all {
        let c = &one.calibration;
        table.push([
            one.name.as_str().into(),
            c.factors.energy.into(),
            c.factors.metric.into(),
            c.factors.speed().into(),
            c.displacement.into(),
            c.alignment.into(),
            c.spontaneous_curvature.into(),
            (c.eigenvalue - 1.0).into(),
            c.position_spread.into(),
            c.normal_spread.into(),
        ])?;
    }
    Ok(table)
}

fn disc_table(discs: &[DiscRow]) -> Result<Table, Error> {
    let number = |name: &str| Column::number(name, Format::Fixed(4));
    let mut table = Table::new([
        Column::text("network"),
        Column::text("F"),
        Column::number("phase", Format::Shortest),
        Column::number("R", Format::Shortest),
        number("w R/π"),
        number("predicted"),
        number("calibrated w R/π"),
    ]);
    for row in discs {
        table.push([
            row.network.as_str().into(),
            if row.odd_part { "odd part" } else { "whole" }.into(),
            f64::from(row.phase).into(),
            row.radius.into(),
            row.measured.into(),
            row.predicted.into(),
            row.calibrated.into(),
        ])?;
    }
    Ok(table)
}

fn summary(all: &[Calibrated]) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for one in all {
        let key = one.name.trim_end_matches(".safetensors");
        let c = &one.calibration;
        for (name, value) in [
            ("energy", c.factors.energy),
            ("metric", c.factors.metric),
            ("spontaneous_curvature", c.spontaneous_curvature),
            ("displacement", c.displacement),
            ("alignment", c.alignment),
            ("eigenvalue", c.eigenvalue),
            ("position_spread", c.position_spread),
            ("normal_spread", c.normal_spread),
        ] {
            summary.insert(&format!("{key}.{name}"), value)?;
        }
    }
    Ok(summary)
}

/// Measured and predicted energies over the radius; colour: phase.
fn figure(run: &RunOptions, discs: &[DiscRow]) -> Figure {
    let mut panels: Vec<(&str, bool)> = Vec::new();
    for row in discs {
        if !panels.contains(&(&row.network[..], row.odd_part)) {
            panels.push((&row.network, row.odd_part));
        }
    }
    let mut figure = Figure::new(run.title("Willmore energy of discs, w R/π"), 2);
    for (network, odd_part) in panels {
        let title = if odd_part { "odd part of F" } else { "F" };
        let mut chart = LineChart::new(
            format!("{network}, {title}"),
            Axis::linear("radius R"),
            Axis::linear("w R/π"),
        );
        for (k, phase) in [1, -1].into_iter().enumerate() {
            let points = |f: fn(&DiscRow) -> f64| -> Vec<[f64; 2]> {
                let rows = discs.iter().filter(|row| {
                    row.network == network && row.odd_part == odd_part && row.phase == phase
                });
                rows.map(|row| [row.radius, f(row)]).collect()
            };
            let name = if phase > 0 {
                "disc"
            } else {
                "complement of a disc"
            };
            chart = chart
                .with_series(
                    Series::new(
                        format!("{name}: without calibration"),
                        points(|r| r.measured),
                    )
                    .with_colour(k)
                    .with_style(LineStyle::None)
                    .with_marker(Marker::Circle),
                )
                .with_series(
                    Series::new(format!("{name}: predicted"), points(|r| r.predicted))
                        .with_colour(k),
                )
                .with_series(
                    Series::new(format!("{name}: calibrated"), points(|r| r.calibrated))
                        .with_colour(k)
                        .with_style(LineStyle::None)
                        .with_marker(Marker::Square),
                );
        }
        let ends = [0.0, 0.65].map(|r| [r, 1.0]).to_vec();
        figure = figure.with_panel(
            chart.with_series(
                Series::new("exact", ends)
                    .with_colour(Colour::Black)
                    .with_style(LineStyle::Dashed),
            ),
        );
    }
    figure.with_shared_legend()
}
