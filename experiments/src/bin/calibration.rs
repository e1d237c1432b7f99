//! The factors by which the hybrid scheme differs from Willmore flow, predicted and measured on discs.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use engine::{Operator, Record, Run, Scales, Scheme, StepRule};
use experiments::networks::{EPS, STEP};
use experiments::options::RunOptions;
use experiments::session::Session;
use experiments::surfaces::willmore_flow;
use experiments::{Error, harness};
use fem::FiniteElementStep;
use geometry::measure::zero_set_volume;
use geometry::shapes::{Ball, Torus};
use geometry::{Field, Grid, phase_field};
use model::training::SphereData;
use model::{Calibration, NamedNetwork, Network, Shipped, displacement_errors};
use operators::ComputeDevice;
use report::{
    Axis, Colour, Figure, Format, LineChart, LineStyle, Marker, OutputDir, Progress, Series, Table,
    Tabulated,
};
use serde::Serialize;
use serde_json::json;
use solver::{Factors, NewtonParams};

const PROGRAM: &str = "calibration";

/// Interface width and inner time step of the discs, as in the convergence tests.
const DISC_SCALES: [f64; 2] = [EPS, STEP];
const RADII: [f64; 7] = [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6];
const QUICK_RADII: [f64; 2] = [0.15, 0.3];
/// Distance of a disc to the box's boundary.
const MARGIN: f64 = 0.3;

/// Interface width and inner time step of the surfaces, for `n = 64`.
const SURFACE_SCALES: [f64; 2] = [1.0 / 32.0, 1.0 / 4096.0];
const SURFACE_CELLS: usize = 64;
/// Room for tori whose hole is some interface widths wide.
const SURFACE_SIDE: f64 = 1.5;
const BALLS: [f64; 3] = [0.2, 0.3, 0.34];
/// Outer radii of the Clifford tori.
const TORI: [f64; 3] = [0.40, 0.50, 0.60];

/// The measurement's time step over the inner one: the interface hardly moves, and its profile relaxes all the same.
const STEP_RATIO: f64 = 1.0 / 8.0;

/// `eps/h` and `tautilde/h^2` of the finite-element steps of the experiments.
const ELEMENTS: [[f64; 2]; 2] = [[2.0, 1.0], [4.0, 4.0]];

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

fn main() -> ExitCode {
    harness::main(program)
}

fn program(options: &Options) -> Result<(), Error> {
    let run = &options.run;
    let networks = options.networks()?;
    let device = run.open_device()?;
    let checksums = networks.iter().map(|(name, one)| (name, one.fingerprint()));
    let [eps, inner_step] = DISC_SCALES;
    let parameters = json!({
        "networks": checksums.collect::<BTreeMap<_, _>>(),
        "eps": eps,
        "inner_step": inner_step,
        "time_step": STEP_RATIO * inner_step,
    });
    let mut session = Session::open(PROGRAM, run, device.clone(), parameters)?;
    let install = (options.install.as_ref())
        .map(OutputDir::create)
        .transpose()?;
    let manifest = &mut session.manifest;
    let mut all = Vec::new();
    for (name, network) in networks {
        let calibration = manifest.phase(name.clone(), || network.calibrate())?;
        let network = network.with_calibration(Some(calibration));
        if let Some(install) = &install {
            network.save(&install.path(&name)?)?;
        }
        all.push(Calibrated {
            name,
            network,
            calibration,
        });
    }
    let progress = &session.progress;
    let discs = manifest.phase("discs", || discs(&all, run.quick, &device, progress))?;
    let surfaces = manifest.phase("balls and tori", || surfaces(&all, run.quick, &device))?;
    let diagnosed = manifest.phase("diagnostics", || diagnostics(&all, run.quick, &device))?;

    session.figure(diagnostics_figure(&diagnosed), "diagnostics")?;
    session.figure(discs_figure(&discs), "discs")?;
    let output = &session.output;
    output.write_json("diagnostics.json", &diagnosed)?;
    output.write_json("discs.json", &discs)?;
    output.write_csv("discs.csv", &discs)?;
    output.write_csv("surfaces.csv", &surfaces)?;
    calibration_table(&mut session, &all)?;
    session.table(discs_table(&discs), "discs_table")?;
    session.table(surfaces_table(&surfaces), "surfaces_table")?;
    for one in &all {
        let (key, calibration) = (one.key(), &one.calibration);
        session.summary.insert_record(key, calibration)?;
        session.summary.insert_record(key, &calibration.factors)?;
    }
    session.finish("Calibration of the learned operators and of finite elements")
}

impl Options {
    /// File names and networks.
    fn networks(&self) -> Result<Vec<(String, Network)>, Error> {
        let mut networks = Vec::new();
        for path in &self.network {
            let network = Network::load(path)?;
            networks.push((network.ratios().file_name(), network));
        }
        if networks.is_empty() {
            let shipped = [Shipped::Paper.all()?, Shipped::Accurate.all()?].concat();
            networks.extend(
                shipped
                    .into_iter()
                    .map(|(name, one)| (name.to_owned(), one)),
            );
        }
        if self.run.quick {
            networks.truncate(1);
        }
        Ok(networks)
    }
}

/// A network under its name.
#[derive(Clone)]
struct Calibrated {
    name: String,
    network: Network,
    calibration: Calibration,
}

impl Calibrated {
    fn key(&self) -> &str {
        self.name.trim_end_matches(".safetensors")
    }

    /// Cells per unit length at which the network has the scales of the convergence tests.
    fn convergence_cells(&self) -> Option<usize> {
        let ratios = self.network.ratios();
        let [eps, step] = DISC_SCALES;
        let n = (ratios.eps_over_h / eps).round();
        let fits = ratios.dimension == 2 && (ratios.step_over_h2 - n * n * step).abs() < 1e-9;
        fits.then_some(n as usize)
    }
}

/// Willmore energy and phase field after one small step.
fn relaxed<const D: usize>(
    network: &Network,
    initial: &Field<D>,
    [eps, mcf_step]: [f64; 2],
    calibration: Factors,
    device: &ComputeDevice,
) -> Result<(f64, Field<D>), Error> {
    let network = NamedNetwork {
        name: String::new(),
        network: network.clone(),
    };
    let mut operator = Operator::learned(Scheme::Paper, network)?;
    operator.factors = calibration;
    let scales = Scales {
        eps,
        mcf_step,
        newton: NewtonParams::default(),
    };
    let time = (StepRule::Constant(STEP_RATIO * mcf_step), 1);
    let case = willmore_flow("surface at rest", initial.clone(), operator, scales, time);
    let mut run = Run::new(case, device)?;
    let energy = run.step()?.and_then(Record::willmore_energy);
    Ok((energy.unwrap_or(f64::NAN), run.field().clone()))
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

/// Discs of either phase by every network with the scales of the convergence tests up to `n = 256`, and by its odd part.
fn discs(
    all: &[Calibrated],
    quick: bool,
    device: &ComputeDevice,
    progress: &Progress,
) -> Result<Vec<DiscRow>, Error> {
    let radii = if quick { &QUICK_RADII[..] } else { &RADII };
    let mut variants = Vec::new();
    for one in all {
        let Some(n) = one.convergence_cells().filter(|&n| n <= 256) else {
            continue;
        };
        variants.push((n, false, one.clone()));
        if !one.name.starts_with("accurate") {
            let mut odd = one.clone();
            odd.network = one.network.odd_part();
            odd.calibration = odd.network.calibrate()?;
            variants.push((n, true, odd));
        }
    }
    let mut tasks = Vec::new();
    for variant in &variants {
        for &radius in radii {
            tasks.extend([1, -1].map(|phase| (variant, radius, phase)));
        }
    }
    let order: Vec<usize> = (0..tasks.len()).rev().collect();
    let bar = progress.bar("discs", tasks.len() as u64);
    let rows = harness::in_parallel(&order, harness::workers(device), |i| {
        let ((n, odd_part, one), radius, phase) = tasks[i];
        let factors = one.calibration.factors;
        let offset = one.calibration.spontaneous_curvature / EPS * f64::from(phase);
        let energy = |factors| disc_energy(&one.network, *n, radius, phase, factors, device);
        let row = DiscRow {
            network: one.name.clone(),
            odd_part: *odd_part,
            phase,
            radius,
            measured: energy(Factors::PAPER)?,
            predicted: factors.energy * (1.0 - offset * radius).powi(2),
            calibrated: energy(factors)?,
        };
        bar.inc(1);
        Ok(row)
    });
    bar.finish();
    rows
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
    let disc = phase_field(grid, &Ball::new([0.0, 0.0], radius)?, DISC_SCALES[0])?;
    let disc = disc.map(|u| sign * u);
    let (energy, field) = relaxed(network, &disc, DISC_SCALES, calibration, device)?;
    let inside = zero_set_volume(&field);
    let area = if phase > 0 {
        inside
    } else {
        grid.side().powi(2) - inside
    };
    Ok(energy * (area / PI).sqrt() / PI)
}

fn discs_table(discs: &[DiscRow]) -> Tabulated<'_, DiscRow> {
    let fixed = Format::Fixed(4);
    Table::of(discs)
        .text("network", |r| &r.network)
        .text("F", |r| if r.odd_part { "odd part" } else { "whole" })
        .number("phase", Format::Shortest, |r| f64::from(r.phase))
        .number("R", Format::Shortest, |r| r.radius)
        .number("w R/π", fixed, |r| r.measured)
        .number("predicted", fixed, |r| r.predicted)
        .number("calibrated w R/π", fixed, |r| r.calibrated)
}

/// Measured and predicted energies over the radius; colour: phase.
fn discs_figure(discs: &[DiscRow]) -> Figure {
    let panel = |rows: &[DiscRow]| {
        let part = if rows[0].odd_part {
            "odd part of F"
        } else {
            "F"
        };
        let curve = |(phase, name): (i8, &str), label, value: fn(&DiscRow) -> f64| {
            let rows = rows.iter().filter(|row| row.phase == phase);
            let point = |row: &DiscRow| [row.radius, value(row)];
            Series::of(format!("{name}: {label}"), rows, point).with_colour(usize::from(phase < 0))
        };
        let curves = |phase| {
            let measured = curve(phase, "without calibration", |row| row.measured);
            let calibrated = curve(phase, "calibrated", |row| row.calibrated);
            [
                measured.with_symbols(Marker::Circle),
                curve(phase, "predicted", |row| row.predicted),
                calibrated.with_symbols(Marker::Square),
            ]
        };
        let exact = Series::new("exact", [[0.0, 1.0], [0.65, 1.0]])
            .with_colour(Colour::Black)
            .with_style(LineStyle::Dashed);
        let title = format!("{}, {part}", rows[0].network);
        LineChart::new(title, Axis::linear("radius R"), Axis::linear("w R/π"))
            .with_curves(curves((1, "disc")))
            .with_curves(curves((-1, "complement of a disc")))
            .with_series(exact)
    };
    let same = |a: &DiscRow, b: &DiscRow| a.network == b.network && a.odd_part == b.odd_part;
    Figure::new("Willmore energy of discs, w R/π", 2)
        .with_panels(discs.chunk_by(same).map(panel))
        .with_shared_legend()
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

/// Balls and Clifford tori.
fn surfaces(
    all: &[Calibrated],
    quick: bool,
    device: &ComputeDevice,
) -> Result<Vec<SurfaceRow>, Error> {
    let grid = Grid::<3>::per_unit(SURFACE_CELLS, SURFACE_SIDE)?;
    let eps = SURFACE_SCALES[0];
    let mut shapes: Vec<(String, Field<3>, f64)> = Vec::new();
    for radius in BALLS {
        let ball = phase_field(grid, &Ball::new([0.0; 3], radius)?, eps)?;
        shapes.push((format!("ball, R = {radius}"), ball, 8.0 * PI));
    }
    for outer in TORI {
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
            let energy = |factors| -> Result<f64, Error> {
                Ok(relaxed(&network, initial, SURFACE_SCALES, factors, device)?.0 / exact)
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

fn surfaces_table(rows: &[SurfaceRow]) -> Tabulated<'_, SurfaceRow> {
    let fixed = Format::Fixed(4);
    Table::of(rows)
        .text("network", |r| &r.network)
        .text("surface", |r| &r.surface)
        .number("w / exact", fixed, |r| r.measured)
        .number("calibrated w / exact", fixed, |r| r.calibrated)
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
    let diagnose = |one: &Calibrated| {
        let cells = one.network.provenance().reference_cells;
        let data = SphereData::new(one.network.ratios(), cells)?;
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
            network: one.key().to_owned(),
            displacement,
            spectrum: one.network.flat_spectrum()?,
            bend: bend.collect(),
        })
    };
    all.iter().filter(small).map(diagnose).collect()
}

fn diagnostics_figure(all: &[Diagnostics]) -> Figure {
    let chart = |title, x, y, points: fn(&Diagnostics) -> Vec<[f64; 2]>| {
        let curves = all.iter().enumerate().map(|(k, one)| {
            let accurate = one.network.starts_with("accurate");
            let style = if accurate {
                LineStyle::Dashed
            } else {
                LineStyle::Solid
            };
            Series::new(one.network.clone(), points(one))
                .with_colour(k % 8)
                .with_style(style)
        });
        LineChart::new(title, Axis::linear(x), Axis::linear(y)).with_curves(curves)
    };
    let displacement = chart(
        "Error of one step of mean curvature flow",
        "curvature ε κ (positive: disc)",
        "relative error of the displacement",
        |one| one.displacement.clone(),
    );
    let spectrum = chart(
        "Spectrum of the flat interface",
        "number of the eigenvalue",
        "real part",
        |one| {
            let first = one.spectrum.iter().take(40).enumerate();
            first.map(|(i, value)| [(i + 1) as f64, value[0]]).collect()
        },
    );
    let bend = chart("Second derivative of F", "w", "F''(w)", |one| {
        one.bend.clone()
    });
    Figure::new("Diagnostics of the learned operators", 2)
        .with_panels([displacement, spectrum, bend])
        .with_shared_legend()
}

/// The finite-element steps of the experiments.
fn elements() -> Result<Vec<(String, Calibration)>, Error> {
    let (plane, space) = (Grid::<2>::centred(16, 16.0)?, Grid::<3>::centred(8, 8.0)?);
    let mut all = Vec::new();
    let mut add = |kind, dimension, [eps, step]: [f64; 2], calibration| {
        let name = format!("FE {kind}, {dimension}D, eps = {eps} h, step = {step} h²");
        all.push((name, calibration));
    };
    for ratios @ [eps, step] in ELEMENTS {
        let implicit = FiniteElementStep::implicit(&plane, eps, step)?;
        add("implicit", 2, ratios, implicit.calibrate()?);
        let semi_implicit = FiniteElementStep::semi_implicit(&plane, eps, step)?;
        add("semi-implicit", 2, ratios, semi_implicit.calibrate()?);
    }
    let [eps, step] = ELEMENTS[0];
    let implicit = FiniteElementStep::implicit(&space, eps, step)?;
    add("implicit", 3, ELEMENTS[0], implicit.calibrate()?);
    Ok(all)
}

fn calibration_table(session: &mut Session<'_>, all: &[Calibrated]) -> Result<(), Error> {
    let learned = all.iter().map(|one| (one.name.clone(), one.calibration));
    let rows: Vec<(String, Calibration)> = learned.chain(elements()?).collect();
    let (fixed, small) = (Format::Fixed(4), Format::Scientific(1));
    let table = Table::of(&rows)
        .text("network", |(name, _)| name)
        .number("c", fixed, |(_, c)| c.factors.energy)
        .number("m", fixed, |(_, c)| c.factors.metric)
        .number("c/m", fixed, |(_, c)| c.factors.speed())
        .number("displacement", fixed, |(_, c)| c.displacement)
        .number("cos² of ψ and w'", fixed, |(_, c)| c.alignment)
        .number("ε κ₀", small, |(_, c)| c.spontaneous_curvature)
        .number("eigenvalue - 1", small, |(_, c)| c.eigenvalue - 1.0)
        .number("spread over positions", small, |(_, c)| c.position_spread)
        .number("spread over normals", small, |(_, c)| c.normal_spread);
    session.table(table, "calibration")
}
