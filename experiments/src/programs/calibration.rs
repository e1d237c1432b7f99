use crate::networks::scales;
use crate::prelude::*;
use crate::surfaces;
use fem::FiniteElementStep;
use geometry::shapes::Torus;
use mean_curvature::{Calibration, Factors};
use model::training::SphereData;
use model::{NamedNetwork, Network, Shipped, displacement_errors};

pub const EXPERIMENT: Experiment = Experiment {
    name: "calibration",
    summary: "The factors by which the hybrid scheme differs from Willmore flow, predicted and measured on discs.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "calibration",
        title: "Calibration",
        description: "Not in the paper: by which factors the scheme differs from Willmore flow with each network, \
                 predicted and measured.",
        figures: &[
            (
                "discs",
                "Willmore energy of discs over that of the exact circle, against the radius.",
            ),
            (
                "diagnostics",
                "Displacement errors, spectra and second derivatives of the operators.",
            ),
        ],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Calibration",
    note: "Networks are named by dimension, kernel width, `eps / h` and `tautilde / h^2`; symbols are those of \
         [calibration](../docs/calibration.md).",
    words: &[],
    rows: &[
        (
            "[accurate_]dN_kN_epsN_stepN.energy, [accurate_]dN_kN_epsN_stepN.metric",
            "the factors `c` and `m`",
        ),
        (
            "[accurate_]dN_kN_epsN_stepN.spontaneous_curvature",
            "`eps kappa_0`, the curvature that the operator takes for flat",
        ),
        (
            "[accurate_]dN_kN_epsN_stepN.displacement",
            "displacement of a nearly flat interface in a step over `tautilde kappa`",
        ),
        (
            "[accurate_]dN_kN_epsN_stepN.alignment",
            "`cos^2` of the angle between `psi` and `w'`",
        ),
        (
            "[accurate_]dN_kN_epsN_stepN.eigenvalue",
            "eigenvalue of `J` that belongs to translations, 1 in the limit",
        ),
        (
            "[accurate_]dN_kN_epsN_stepN.position_spread, [accurate_]dN_kN_epsN_stepN.normal_spread",
            "spread of `c` over positions of the interface between two planes of nodes, and over its normals",
        ),
    ],
};

const RADII: [f64; 7] = [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6];
const QUICK_RADII: [f64; 2] = [0.15, 0.3];
/// Distance of a disc to the box's boundary.
const MARGIN: f64 = 0.3;

const SURFACE_CELLS: usize = 64;
/// Room for tori whose hole is some interface widths wide.
const SURFACE_SIDE: f64 = 1.5;
const BALLS: [f64; 3] = [0.2, 0.3, 0.34];
/// Outer radii of the Clifford tori.
const TORI: [f64; 3] = [0.40, 0.50, 0.60];

/// The measurement's time step over the inner one: the interface hardly moves, and its profile relaxes all the same.
const STEP_RATIO: f64 = 1.0 / 8.0;

/// How the names of networks of the accurate recipe begin.
const ACCURATE_PREFIX: &str = "accurate_";

/// `eps/h` and `tautilde/h^2` of the finite-element steps of the experiments.
const ELEMENTS: [[f64; 2]; 2] = [[2.0, 1.0], [4.0, 4.0]];

/// Calibrates the shipped networks, or others, and the finite-element steps; compares the predicted Willmore energy of discs of
/// either phase with the one that the scheme finds, and the energy of balls and Clifford tori with the exact one; draws what
/// tells good networks from bad ones.
#[derive(Parser, Debug)]
#[command(version)]
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

fn program(options: &Options) -> Result<()> {
    let run = &options.run;
    let mut networks: Vec<(String, Network)> = Vec::new();
    for path in &options.network {
        let network = Network::load(path)?;
        // The name tells the recipe.
        let is_accurate = (path.file_name())
            .is_some_and(|name| name.to_string_lossy().starts_with(ACCURATE_PREFIX));
        let prefix = if is_accurate { ACCURATE_PREFIX } else { "" };
        networks.push((format!("{prefix}{}", network.ratios().file_name()), network));
    }
    if networks.is_empty() {
        for (name, network) in [Shipped::Paper.all()?, Shipped::Accurate.all()?].concat() {
            networks.push((name.to_owned(), network));
        }
    }
    let names: BTreeSet<&str> = networks.iter().map(|(name, _)| &**name).collect();
    let message = "two networks have the same recipe and ratios: give them in runs of their own";
    require(names.len() == networks.len(), message)?;
    networks.truncate(run.either(1, usize::MAX));
    let checksums = (networks.iter()).map(|(name, network)| (name, network.fingerprint()));
    let parameters = json!({
        "networks": checksums.collect::<BTreeMap<_, _>>(),
        "eps": EPS,
        "inner_step": STEP,
        "time_step": STEP_RATIO * STEP,
    });
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let install = options.install.as_ref().map(OutputDir::create);
    let install = install.transpose()?;
    let (mut all, mut rows) = (Vec::new(), Vec::new());
    for (name, mut network) in networks {
        let calibration = session.phase(&name, |_| Ok(network.calibrate()?))?;
        network.calibration = Some(calibration);
        if let Some(install) = &install {
            network.save(&install.path(&name)?)?;
        }
        let (summary, key) = (&mut session.summary, key(&name));
        summary.insert_record(key, &calibration)?;
        summary.insert_record(key, &calibration.factors)?;
        rows.push((name.clone(), calibration));
        all.push(NamedNetwork { name, network });
    }
    rows.extend(elements()?);
    let discs = session.phase("discs", |stage| discs(&all, stage))?;
    let surfaces = session.phase("balls and tori", |stage| balls_and_tori(&all, stage))?;
    let diagnosed = session.phase("diagnostics", |stage| diagnostics(&all, stage))?;

    // None are of networks for surfaces.
    if !diagnosed.is_empty() {
        session.figure(diagnostics_figure(&diagnosed), "diagnostics")?;
    }
    if !discs.is_empty() {
        session.figure(discs_figure(&discs), "discs")?;
    }
    session.output.write_json("diagnostics.json", &diagnosed)?;
    let small = Scientific(1);
    let factors = Sheet::of(&rows)
        .text("network", |(name, _)| name)
        .column("c", Fixed(4), |(_, c)| c.factors.energy)
        .column("m", Fixed(4), |(_, c)| c.factors.metric)
        .column("c/m", Fixed(4), |(_, c)| c.factors.speed())
        .column("displacement", Fixed(4), |(_, c)| c.displacement)
        .column("cos² of ψ and w'", Fixed(4), |(_, c)| c.alignment)
        .column("ε κ₀", small, |(_, c)| c.spontaneous_curvature)
        .column("eigenvalue - 1", small, |(_, c)| c.eigenvalue - 1.0)
        .column("spread over positions", small, |(_, c)| c.position_spread)
        .column("spread over normals", small, |(_, c)| c.normal_spread);
    session.sheet(factors, "calibration")?;
    let of_discs = Sheet::of(&discs)
        .text("network", |r| &r.network)
        .text("F", |r| if r.odd_part { "odd part" } else { "whole" })
        .column("phase", Shortest, |r| f64::from(r.phase))
        .column("R", Shortest, |r| r.radius)
        .column("w R/π", Fixed(4), |r| r.measured)
        .column("predicted", Fixed(4), |r| r.predicted)
        .column("calibrated w R/π", Fixed(4), |r| r.calibrated);
    session.sheet(of_discs, "discs")?;
    let of_surfaces = Sheet::of(&surfaces)
        .text("network", |r| &r.network)
        .text("surface", |r| &r.surface)
        .column("w / exact", Fixed(4), |r| r.measured)
        .column("calibrated w / exact", Fixed(4), |r| r.calibrated);
    session.sheet(of_surfaces, "surfaces")?;
    session.finish("Calibration of the learned operators and of finite elements")
}

/// Name of a network in metrics.
fn key(name: &str) -> &str {
    name.trim_end_matches(".safetensors")
}

/// The same network with the odd part of its activation.
fn odd_part(one: &NamedNetwork) -> NamedNetwork {
    let (name, network) = (one.name.clone(), one.network.odd_part());
    NamedNetwork { name, network }
}

/// Willmore energy and phase field after one small step with these factors.
fn relaxed<const D: usize>(
    named: &NamedNetwork,
    factors: Factors,
    initial: &Field<D>,
    scales: Scales,
    device: &ComputeDevice,
) -> Result<(f64, Field<D>)> {
    let mut operator = Operator::learned(Formulation::Paper, named.clone())?;
    operator.factors = factors;
    let (title, initial) = ("surface at rest", initial.clone());
    let rule = StepRule::Constant(STEP_RATIO * scales.mcf_step);
    let case = Case::willmore(title, initial, operator, scales, rule, 1);
    let mut run = Run::new(case, device)?;
    let energy = run.step()?.and_then(Record::willmore_energy);
    Ok((energy.unwrap_or(f64::NAN), run.field().clone()))
}

/// The Willmore energy that the scheme sees in a disc.
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
fn discs(all: &[NamedNetwork], stage: &Stage<'_>) -> Result<Vec<DiscRow>> {
    let radii = stage.options.either(&QUICK_RADII[..], &RADII);
    let mut variants = Vec::new();
    for one in all {
        let ratios = one.network.ratios();
        // At which the network has the scales of the convergence tests, if it does at all.
        let n = (ratios.eps_over_h / EPS).round();
        let fits = ratios.dimension == 2 && (ratios.step_over_h2 - n * n * STEP).abs() < 1e-9;
        if !fits || n > 256.0 {
            continue;
        }
        variants.push((n, false, one.clone()));
        if !one.name.starts_with(ACCURATE_PREFIX) {
            variants.push((n, true, odd_part(one)));
        }
    }
    let mut tasks = Vec::new();
    for (n, odd, one) in &variants {
        let calibration = one.network.calibration()?;
        for &radius in radii {
            tasks.extend([1, -1].map(|phase| (*n, *odd, one, calibration, radius, phase)));
        }
    }
    stage.bar.set_length(tasks.len() as u64);
    harness::in_parallel(tasks.len(), harness::workers(stage.device), |i| {
        let (n, odd_part, one, calibration, radius, phase) = tasks[i];
        let (sign, factors) = (f64::from(phase), calibration.factors);
        let offset = calibration.spontaneous_curvature / EPS * sign;
        let half = ((radius + MARGIN) * n).ceil();
        let grid = Grid::<2>::centred(2 * half as usize, 2.0 * half / n)?;
        let disc = phase_field(grid, &Ball::new([0.0, 0.0], radius)?, EPS)?;
        let disc = disc.map(|u| sign * u);
        // Over that of the zero level set of the relaxed disc, `pi / R`.
        let energy = |factors| -> Result<f64> {
            let (energy, field) = relaxed(one, factors, &disc, scales(), stage.device)?;
            let inside = zero_set_volume(&field);
            let outside = grid.side().powi(2) - inside;
            let area = if phase > 0 { inside } else { outside };
            Ok(energy * (area / PI).sqrt() / PI)
        };
        let row = DiscRow {
            network: one.name.clone(),
            odd_part,
            phase,
            radius,
            measured: energy(Factors::PAPER)?,
            predicted: factors.energy * (1.0 - offset * radius).powi(2),
            calibrated: energy(factors)?,
        };
        stage.bar.inc(1);
        Ok(row)
    })
}

/// Measured and predicted energies over the radius; colour: phase.
fn discs_figure(discs: &[DiscRow]) -> Figure {
    let panel = |rows: &[DiscRow]| {
        let part = ["F", "odd part of F"][usize::from(rows[0].odd_part)];
        let title = format!("{}, {part}", rows[0].network);
        let mut chart = LineChart::new(title, Axis::linear("radius R"), Axis::linear("w R/π"));
        for (colour, phase, name) in [(0, 1, "disc"), (1, -1, "complement of a disc")] {
            let curve = |label, value: fn(&DiscRow) -> f64| {
                let rows = rows.iter().filter(|row| row.phase == phase);
                let point = |row: &DiscRow| [row.radius, value(row)];
                Series::of(format!("{name}: {label}"), rows, point).with_colour(colour)
            };
            let measured = curve("without calibration", |row| row.measured);
            let calibrated = curve("calibrated", |row| row.calibrated);
            chart = chart.with_curves([
                measured.with_symbols(Marker::Circle),
                curve("predicted", |row| row.predicted),
                calibrated.with_symbols(Marker::Square),
            ]);
        }
        let exact = Series::new("exact", [[0.0, 1.0], [0.65, 1.0]]).with_colour(Colour::Black);
        chart.with_curves([exact.with_style(LineStyle::Dashed)])
    };
    let same = |a: &DiscRow, b: &DiscRow| a.network == b.network && a.odd_part == b.odd_part;
    Figure::new("Willmore energy of discs, w R/π", 2)
        .with_panels(discs.chunk_by(same).map(panel))
        .with_shared_legend()
        .with_note("Of operators that treat both phases alike only the complements are seen, which cover the discs.")
}

/// The Willmore energy that the scheme sees in a surface whose energy is known.
struct SurfaceRow {
    network: String,
    surface: String,
    /// Over the exact energy, without calibration.
    measured: f64,
    calibrated: f64,
}

fn balls_and_tori(all: &[NamedNetwork], stage: &Stage<'_>) -> Result<Vec<SurfaceRow>> {
    let grid = Grid::<3>::per_unit(SURFACE_CELLS, SURFACE_SIDE)?;
    let scales = surfaces::scales(SURFACE_CELLS);
    let mut shapes: Vec<(String, Field<3>, f64)> = Vec::new();
    for radius in BALLS {
        let ball = phase_field(grid, &Ball::new([0.0; 3], radius)?, scales.eps)?;
        shapes.push((format!("ball, R = {radius}"), ball, 8.0 * PI));
    }
    for outer in TORI {
        let torus = phase_field(grid, &Torus::clifford(outer)?, scales.eps)?;
        shapes.push((format!("Clifford torus, {outer:.2}"), torus, 4.0 * PI * PI));
    }
    if stage.options.quick {
        shapes.truncate(1);
    }
    let mut rows = Vec::new();
    let is_solid = |one: &&NamedNetwork| one.network.ratios().dimension == 3;
    for one in all.iter().filter(is_solid) {
        let (odd, factors) = (odd_part(one), one.network.calibration()?.factors);
        for (surface, initial, exact) in &shapes {
            let energy = |factors| -> Result<f64> {
                Ok(relaxed(&odd, factors, initial, scales, stage.device)?.0 / exact)
            };
            rows.push(SurfaceRow {
                network: one.name.clone(),
                surface: surface.clone(),
                measured: energy(Factors::PAPER)?,
                calibrated: energy(factors)?,
            });
        }
    }
    Ok(rows)
}

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

fn diagnostics(all: &[NamedNetwork], stage: &Stage<'_>) -> Result<Vec<Diagnostics>> {
    let count: usize = if stage.options.quick { 3 } else { 12 };
    // Kernels of width 65 have a thousand planes; surfaces have millions of nodes.
    let small = all.iter().filter(|one| {
        let ratios = one.network.ratios();
        ratios.width < 65 && ratios.dimension == 2
    });
    let diagnose = |NamedNetwork { name, network }: &NamedNetwork| {
        let data = SphereData::new(network.ratios(), network.provenance.reference_cells)?;
        let mut displacement = Vec::new();
        for i in 0..count {
            let radius = 0.05 * (0.42_f64 / 0.05).powf(i as f64 / (count - 1) as f64);
            let curvature = data.eps() / radius;
            let [convex, concave] = displacement_errors(network, &data, radius, stage.device)?;
            displacement.extend([[curvature, convex], [-curvature, concave]]);
        }
        displacement.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let bend = (0..=400).map(|i| f64::from(i) / 200.0 - 1.0);
        Ok(Diagnostics {
            network: key(name).to_owned(),
            displacement,
            spectrum: network.flat_spectrum()?,
            bend: bend.map(|w| [w, network.activation().jet(w)[2]]).collect(),
        })
    };
    small.map(diagnose).collect()
}

fn diagnostics_figure(all: &[Diagnostics]) -> Figure {
    let chart = |title, x, y, points: fn(&Diagnostics) -> Vec<[f64; 2]>| {
        let curves = all.iter().enumerate().map(|(k, one)| {
            let accurate = one.network.starts_with(ACCURATE_PREFIX);
            let style = [LineStyle::Solid, LineStyle::Dashed][usize::from(accurate)];
            let curve = Series::new(one.network.clone(), points(one));
            // Earlier ones show on both sides of later ones with which they coincide.
            let width = 1.6 + 0.8 * (all.len() - 1 - k) as f64;
            curve.with_colour(k % 8).with_style(style).with_width(width)
        });
        LineChart::new(title, Axis::linear(x), Axis::linear(y)).with_curves(curves)
    };
    let displacement = chart(
        "Error of one step of mean curvature flow",
        "curvature ε κ (positive: disc)",
        "relative error of the displacement",
        // Where a flat interface does not stay, the relative error has a pole at zero.
        |one| {
            let (concave, convex) = one.displacement.split_at(one.displacement.len() / 2);
            [concave, &[[0.0, f64::NAN]], convex].concat()
        },
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
    let bend = |one: &Diagnostics| one.bend.clone();
    let bend = chart("Second derivative of F", "w", "F''(w)", bend);
    Figure::new("Diagnostics of the learned operators", 2)
        .with_panels([displacement, spectrum, bend])
        .with_shared_legend()
}

fn elements() -> Result<Vec<(String, Calibration)>> {
    let (plane, space) = (Grid::<2>::centred(16, 16.0)?, Grid::<3>::centred(8, 8.0)?);
    let name = |kind, [eps, step]: [f64; 2]| format!("FE {kind}, eps = {eps} h, step = {step} h²");
    let mut all = Vec::new();
    for ratios @ [eps, step] in ELEMENTS {
        let implicit = FiniteElementStep::implicit(&plane, eps, step)?.calibrate()?;
        let semi = FiniteElementStep::semi_implicit(&plane, eps, step)?.calibrate()?;
        all.push((name("implicit, 2D", ratios), implicit));
        all.push((name("semi-implicit, 2D", ratios), semi));
    }
    let [eps, step] = ELEMENTS[0];
    let implicit = FiniteElementStep::implicit(&space, eps, step)?.calibrate()?;
    all.push((name("implicit, 3D", ELEMENTS[0]), implicit));
    Ok(all)
}
