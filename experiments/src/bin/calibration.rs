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
use fem::{FiniteElementStep, LinearSolver};
use geometry::measure::zero_set_volume;
use geometry::shapes::{Ball, Torus};
use geometry::{Field, Grid, phase_field};
use model::training::SphereData;
use model::{Calibration, Network, displacement_errors, pretrained};
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

/// Calibrates the shipped networks, or others, and the finite-element steps; compares the predicted Willmore energy of discs of
/// either phase with the one that the scheme finds, and the energy of balls and Clifford tori with the exact one; draws what
/// tells good networks from bad ones.
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
        for (name, network) in pretrained::all()?
            .into_iter()
            .chain(pretrained::all_accurate()?)
        {
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
        let is_odd = one.name.starts_with("accurate");
        for odd_part in [false, true].into_iter().filter(|odd| !(is_odd && *odd)) {
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

    let surfaces = manifest.phase("balls and tori", || {
        surface_energies(&all, run.quick, &device)
    })?;
    let diagnosed = manifest.phase("diagnostics", || diagnostics(&all, run.quick, &device))?;
    diagnostics_figure(run, &diagnosed).write(&output, "diagnostics")?;
    output.write("diagnostics.json", report::data::to_json(&diagnosed)?)?;
    output.write("surfaces.csv", report::data::to_csv(&surfaces)?)?;
    let surfaces = surface_table(&surfaces)?;
    surfaces.write(&output, "surfaces_table")?;
    figure(run, &discs).write(&output, "discs")?;
    output.write("discs.csv", report::data::to_csv(&discs)?)?;
    output.write("discs.json", report::data::to_json(&discs)?)?;
    let table = table(&all, &elements()?)?;
    table.write(&output, "calibration")?;
    let discs = disc_table(&discs)?;
    discs.write(&output, "discs_table")?;
    summary(&all)?.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    run.say(&format!(
        "{}\n{}\n{}\n{}\nResults are in {}",
        run.title("Calibration of the learned operators and of finite elements"),
        table.to_markdown(),
        discs.to_markdown(),
        surfaces.to_markdown(),
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

/// The finite-element steps at the ratios of the experiments.
fn elements() -> Result<Vec<(String, Calibration)>, Error> {
    let mut all = Vec::new();
    for (eps_over_h, step_over_h2) in [(2.0, 1.0), (4.0, 4.0)] {
        let grid = Grid::<2>::centred(16, 16.0)?;
        for (name, step) in [
            (
                "implicit",
                FiniteElementStep::implicit(&grid, eps_over_h, step_over_h2)?,
            ),
            (
                "semi-implicit",
                FiniteElementStep::semi_implicit(&grid, eps_over_h, step_over_h2)?,
            ),
        ] {
            let name = format!("FE {name}, 2D, eps = {eps_over_h} h, step = {step_over_h2} h²");
            all.push((name, step.calibrate()?));
        }
    }
    let grid = Grid::<3>::centred(8, 8.0)?;
    let step = FiniteElementStep::implicit(&grid, 2.0, 1.0)?;
    all.push((
        "FE implicit, 3D, eps = 2 h, step = 1 h²".to_owned(),
        step.calibrate()?,
    ));
    Ok(all)
}

/// The Willmore energy that the scheme sees in a surface whose energy is known.
#[derive(Serialize)]
struct SurfaceRow {
    network: String,
    surface: String,
    /// Over the exact energy, without calibration.
    measured: f64,
    /// The same with calibration.
    calibrated: f64,
}

/// Balls and Clifford tori at `n = 64`, `eps = 2^-5`, after one small step.
fn surface_energies(
    all: &[Calibrated],
    quick: bool,
    device: &ComputeDevice,
) -> Result<Vec<SurfaceRow>, Error> {
    const CELLS: usize = 64;
    let (eps, step) = (1.0 / 32.0, 1.0 / 4096.0);
    // Room for tori whose hole is some interface widths wide.
    let grid = Grid::<3>::per_unit(CELLS, 1.5)?;
    let mut shapes: Vec<(String, Field<3>, f64)> = Vec::new();
    for radius in [0.2, 0.3, 0.34] {
        let ball = phase_field(grid, &Ball::new([0.0; 3], radius)?, eps)?;
        shapes.push((format!("ball, R = {radius}"), ball, 8.0 * PI));
    }
    for outer in [0.40, 0.50, 0.60] {
        let torus = phase_field(grid, &Torus::clifford(outer)?, eps)?;
        shapes.push((format!("Clifford torus, {outer:.2}"), torus, 4.0 * PI * PI));
    }
    if quick {
        shapes.truncate(1);
    }
    let mut rows = Vec::new();
    for one in all.iter().filter(|one| one.network.ratios().dimension == 3) {
        let network = one.network.odd_part();
        for (surface, initial, exact) in &shapes {
            let energy = |calibration: Factors| -> Result<f64, Error> {
                let params = FlowParams {
                    eps,
                    mcf_step: step,
                    newton: NewtonParams::default(),
                    calibration,
                };
                let linear = LinearSolver::default();
                let mut flow = Method::Hybrid.willmore_flow(
                    Some(&network),
                    initial,
                    params,
                    linear,
                    device,
                )?;
                Ok(flow.advance(step / 8.0)?.willmore_energy / exact)
            };
            rows.push(SurfaceRow {
                network: one.name.clone(),
                surface: surface.clone(),
                measured: energy(Factors::PAPER)?,
                calibrated: energy(one.calibration.factors)?,
            });
        }
    }
    Ok(rows)
}

fn surface_table(rows: &[SurfaceRow]) -> Result<Table, Error> {
    let number = |name: &str| Column::number(name, Format::Fixed(4));
    let mut table = Table::new([
        Column::text("network"),
        Column::text("surface"),
        number("w / exact"),
        number("calibrated w / exact"),
    ]);
    for row in rows {
        table.push([
            row.network.as_str().into(),
            row.surface.as_str().into(),
            row.measured.into(),
            row.calibrated.into(),
        ])?;
    }
    Ok(table)
}

/// What tells good networks from bad ones.
#[derive(Serialize)]
struct Diagnostics {
    network: String,
    /// `eps kappa`, positive where the phase `u = 1` is convex, and the relative error of the displacement.
    displacement: Vec<[f64; 2]>,
    /// Eigenvalues of `J` at the flat interface, real and imaginary parts.
    spectrum: Vec<[f64; 2]>,
    /// `w` and `F''(w)`.
    bend: Vec<[f64; 2]>,
}

fn diagnostics(
    all: &[Calibrated],
    quick: bool,
    device: &ComputeDevice,
) -> Result<Vec<Diagnostics>, Error> {
    let count: usize = if quick { 3 } else { 12 };
    // Kernels of width 65 have a thousand planes; surfaces have millions of nodes.
    let small =
        |one: &&Calibrated| one.network.ratios().width < 65 && one.network.ratios().dimension == 2;
    all.iter()
        .filter(small)
        .map(|one| {
            let ratios = one.network.ratios();
            let data = SphereData::new(ratios, one.network.provenance().reference_cells)?;
            let mut displacement = Vec::new();
            for i in 0..count {
                let radius = 0.05 * (0.42_f64 / 0.05).powf(i as f64 / (count - 1) as f64);
                let curvature = data.eps() / radius;
                let errors = displacement_errors(&one.network, &data, radius, device)?;
                displacement.push([curvature, errors[0]]);
                displacement.push([-curvature, errors[1]]);
            }
            displacement.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let bend = (0..=400).map(|i| {
                let w = f64::from(i) / 200.0 - 1.0;
                [w, one.network.activation().jet(w)[2]]
            });
            Ok(Diagnostics {
                network: one.name.trim_end_matches(".safetensors").to_owned(),
                displacement,
                spectrum: one.network.flat_spectrum()?,
                bend: bend.collect(),
            })
        })
        .collect()
}

fn diagnostics_figure(run: &RunOptions, all: &[Diagnostics]) -> Figure {
    let style = |one: &Diagnostics| {
        if one.network.starts_with("accurate") {
            LineStyle::Dashed
        } else {
            LineStyle::Solid
        }
    };
    let mut panels = [
        LineChart::new(
            "Error of one step of mean curvature flow",
            Axis::linear("curvature ε κ (positive: disc)"),
            Axis::linear("relative error of the displacement"),
        ),
        LineChart::new(
            "Spectrum of the flat interface",
            Axis::linear("number of the eigenvalue"),
            Axis::linear("real part"),
        ),
        LineChart::new(
            "Second derivative of F",
            Axis::linear("w"),
            Axis::linear("F''(w)"),
        ),
    ];
    for (k, one) in all.iter().enumerate() {
        let spectrum: Vec<[f64; 2]> = (one.spectrum.iter().take(40).enumerate())
            .map(|(i, value)| [(i + 1) as f64, value[0]])
            .collect();
        let curves = [one.displacement.clone(), spectrum, one.bend.clone()];
        panels = {
            let mut curves = curves.into_iter();
            panels.map(|panel| {
                let points = curves.next().unwrap_or_default();
                panel.with_series(
                    Series::new(one.network.clone(), points)
                        .with_colour(k % 8)
                        .with_style(style(one)),
                )
            })
        };
    }
    let mut figure = Figure::new(run.title("Diagnostics of the learned operators"), 2);
    for panel in panels {
        figure = figure.with_panel(panel);
    }
    figure.with_shared_legend()
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

fn table(all: &[Calibrated], elements: &[(String, Calibration)]) -> Result<Table, Error> {
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
    let learned = all.iter().map(|one| (&one.name, &one.calibration));
    for (name, c) in learned.chain(elements.iter().map(|(name, c)| (name, c))) {
        table.push([
            name.as_str().into(),
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
