//! Spheres by the network for surfaces: mean curvature flow, Willmore energies, and standing still.

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use experiments::circles::Flow;
use experiments::method::{Method, Scheme};
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::surfaces::{centred_box, ratios, scales, since};
use experiments::training::{NetworkSpec, held_out_radii};
use experiments::{Error, harness, quality};
use fem::{FiniteElementStep, LinearSolver};
use geometry::measure::{l2_distance, zero_set_volume};
use geometry::shapes::Ball;
use geometry::{Field, phase_field};
use model::{Network, Quality};
use operators::ComputeDevice;
use report::{
    Axis, Colour, Column, Figure, Format, LineChart, LineStyle, Marker, Series, Summary, Table,
};
use serde::Serialize;
use solver::StepRecord;

const PROGRAM: &str = "spheres";
const RADII: [f64; 6] = [0.15, 0.2, 0.25, 0.3, 0.35, 0.4];
/// Steps of mean curvature flow after which errors are reported; the smallest sphere vanishes after 23 at n = 64.
const MCF_STEPS: [usize; 3] = [1, 4, 8];
/// Steps of Willmore flow, which should leave spheres alone.
const WILLMORE_STEPS: usize = 20;
const TAU: f64 = 1.0 / 262_144.0;
/// Willmore energy of a sphere.
const SPHERE: f64 = 8.0 * std::f64::consts::PI;

/// The network for surfaces on spheres, n = 64, eps = 2^-5, tautilde = 2^-12: L2 errors of mean curvature flow against
/// R^2 = r^2 - 4t beside finite elements, Willmore energies w against 8 pi, and the change of the radius in 20 steps of Willmore
/// flow, tau = 2^-18, which leaves spheres alone.
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
}

#[derive(Serialize)]
struct Parameters {
    n: usize,
    eps: f64,
    mcf_step: f64,
    tau: f64,
    willmore_steps: usize,
    network: String,
    quick: bool,
}

/// What was measured for one radius.
#[derive(Serialize, Clone, Debug)]
struct Measurement {
    radius: f64,
    /// Errors of mean curvature flow, in the order of [`variants`], for each of the reported steps.
    mcf: Vec<Vec<f64>>,
    /// `w` with the implicit finite-element step and the mass-matrix norm, as the paper measures.
    w_elements: f64,
    /// Willmore flow by the learned operator, in every scheme.
    willmore: Vec<Still>,
}

/// A sphere under Willmore flow.
#[derive(Serialize, Clone, Copy, Debug)]
struct Still {
    scheme: Scheme,
    /// `w` of the start as the scheme measures it, by its factors of calibration.
    w_learned: f64,
    /// `w` of the end: the profile is now the one of the scheme, which the calibration is about.
    w_relaxed: f64,
    /// Radius of the ball with the final volume, less that at the beginning.
    radius_change: f64,
    /// Steps in which the energy rose.
    energy_increases: usize,
    hvp_per_step: f64,
}

/// Methods and schemes of mean curvature flow.
fn variants() -> impl Iterator<Item = (Method, Scheme)> {
    let schemes = |method: Method| method.schemes(Flow::MeanCurvature).iter();
    Method::ALL
        .into_iter()
        .flat_map(move |method| schemes(method).map(move |&scheme| (method, scheme)))
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    let n = options.cells.unwrap_or(if quick { 32 } else { 64 });
    let radii: &[f64] = if quick { &RADII[2..4] } else { &RADII };
    let willmore_steps = if quick { 2 } else { WILLMORE_STEPS };
    let device = options.run.open_device()?;
    let networks = options.networks.find(&[ratios()])?;
    let network = &networks[0];
    centred_box(n, 1.0)?;
    let output = options.run.open_output(PROGRAM)?;
    let params = scales(n);
    let parameters = Parameters {
        n,
        eps: params.eps,
        mcf_step: params.mcf_step,
        tau: TAU,
        willmore_steps,
        network: checksum(network),
        quick,
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let progress = options.run.progress();
    let clock = Instant::now();
    let bar = progress.bar("radii".to_owned(), radii.len() as u64);
    let mut all = Vec::new();
    for &radius in radii {
        all.push(manifest.phase(format!("radius {radius}"), || {
            measure(radius, n, willmore_steps, network, &device)
        })?);
        bar.inc(1);
    }
    bar.finish();
    let spec = NetworkSpec::surfaces();
    let quality = if quick {
        None
    } else {
        let data = spec.data(false)?;
        Some(manifest.phase("quality of the network", || {
            Quality::measure(network, &data, held_out_radii(quick), &device)
        })?)
    };
    if let Some(measured) = &quality {
        let name = Table::of(std::slice::from_ref(measured)).text("network", |_| &spec.name);
        let losses = quality::columns(name, |measured| measured);
        losses.finish()?.write(&output, "quality")?;
    }
    let table = table(&all, n)?;
    table.write(&output, "spheres")?;
    output.write("spheres.json", report::data::to_json(&all)?)?;
    figure(&options.run, &all, n).write(&output, "spheres")?;
    let mut summary = summary(&all, n, since(clock))?;
    if let Some(measured) = &quality {
        summary.insert_record(&spec.name, measured)?;
    }
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\nResults are in {}",
        options.run.title("Spheres by the network for surfaces"),
        table.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

fn ball(radius: f64, n: usize) -> Result<Field<3>, Error> {
    let shape = Ball::new([0.5; 3], radius)?;
    Ok(phase_field(centred_box(n, 1.0)?, &shape, scales(n).eps)?)
}

/// Radius of the ball with the volume of `{u > 0}`.
fn radius_of(u: &Field<3>) -> f64 {
    (0.75 * zero_set_volume(u) / std::f64::consts::PI).cbrt()
}

fn measure(
    radius: f64,
    n: usize,
    willmore_steps: usize,
    network: &Network,
    device: &ComputeDevice,
) -> Result<Measurement, Error> {
    let params = scales(n);
    let initial = ball(radius, n)?;
    let mut mcf = Vec::new();
    for (method, scheme) in variants() {
        let (network, _) = method.prepare(scheme, Some(network), initial.grid(), &params)?;
        let mut flow = method.mean_curvature_flow(network.as_ref(), &initial, &params, device)?;
        let mut errors = Vec::new();
        for step in 1..=MCF_STEPS[MCF_STEPS.len() - 1] {
            flow.advance()?;
            if MCF_STEPS.contains(&step) {
                let time = step as f64 * params.mcf_step;
                let exact = ball((radius * radius - 4.0 * time).max(0.0).sqrt(), n)?;
                errors.push(l2_distance(&flow.field()?, &exact)?);
            }
        }
        mcf.push(errors);
    }
    let elements = FiniteElementStep::implicit(initial.grid(), params.eps, params.mcf_step)?;
    let still = |&scheme: &Scheme| stand_still(&initial, scheme, willmore_steps, network, device);
    let schemes = Method::Hybrid.schemes(Flow::Willmore);
    Ok(Measurement {
        radius,
        mcf,
        w_elements: elements.willmore_energy(&initial)?,
        willmore: schemes.iter().map(still).collect::<Result<_, _>>()?,
    })
}

/// Willmore flow from a sphere.
fn stand_still(
    initial: &Field<3>,
    scheme: Scheme,
    steps: usize,
    network: &Network,
    device: &ComputeDevice,
) -> Result<Still, Error> {
    let method = Method::Hybrid;
    let mut params = scales(initial.grid().spacing().recip().round() as usize);
    let (network, factors) = method.prepare(scheme, Some(network), initial.grid(), &params)?;
    params.calibration = factors;
    let linear = LinearSolver::default();
    let mut flow = method.willmore_flow(network.as_ref(), initial, params, linear, device)?;
    let mut records = Vec::new();
    for _ in 0..steps {
        records.push(flow.advance(TAU)?);
    }
    let count = records.len() as f64;
    let first = records.first().map_or(f64::NAN, |r| r.energy_before);
    let rises = records.iter().filter(|r| r.energy > r.energy_before);
    Ok(Still {
        scheme,
        // Standing still costs 2 tau w.
        w_learned: first / (2.0 * TAU),
        w_relaxed: records.last().map_or(f64::NAN, |r| r.willmore_energy),
        radius_change: radius_of(&flow.field()?) - radius_of(initial),
        energy_increases: rises.count(),
        hvp_per_step: records.iter().map(StepRecord::hvp).sum::<f64>() / count,
    })
}

fn table(all: &[Measurement], n: usize) -> Result<Table, Error> {
    let head = [Column::number("radius", Format::Fixed(2))];
    let errors = variants().flat_map(|(method, scheme)| {
        MCF_STEPS.map(|step| {
            let name = format!("MCF error, {}, step {step}", method.label_in(scheme));
            Column::number(name, Format::Fixed(5))
        })
    });
    let energies = [
        Column::number("w, FE measure", Format::Fixed(2)),
        Column::number("w / 8π (FE)", Format::Fixed(4)),
    ];
    let schemes = Method::Hybrid.schemes(Flow::Willmore).iter();
    let tail = schemes.flat_map(|&scheme| {
        let label = Method::Hybrid.label_in(scheme);
        [
            Column::number(format!("w, {label}"), Format::Fixed(2)),
            Column::number(format!("w in the end, {label}"), Format::Fixed(2)),
            Column::number(format!("change of radius / h, {label}"), Format::Fixed(4)),
            Column::number(format!("HVP/step, {label}"), Format::Fixed(1)),
        ]
    });
    let mut table = Table::new(head.into_iter().chain(errors).chain(energies).chain(tail));
    for m in all {
        let errors = m.mcf.iter().flatten().map(|&error| error.into());
        let flows = m.willmore.iter().flat_map(|still| {
            [
                still.w_learned.into(),
                still.w_relaxed.into(),
                (still.radius_change * n as f64).into(),
                still.hvp_per_step.into(),
            ]
        });
        let energies = [m.w_elements, m.w_elements / SPHERE].map(Into::into);
        let cells = [m.radius.into()].into_iter().chain(errors);
        table.push(cells.chain(energies).chain(flows))?;
    }
    Ok(table)
}

/// Tells schemes apart where lines are short.
fn marker(scheme: Scheme) -> Marker {
    match scheme {
        Scheme::Paper => Marker::Circle,
        Scheme::Calibrated => Marker::Triangle,
        Scheme::Accurate => Marker::Diamond,
    }
}

fn figure(run: &RunOptions, all: &[Measurement], n: usize) -> Figure {
    let last = MCF_STEPS.len() - 1;
    let mut errors = LineChart::new(
        format!("Mean curvature flow, {} steps", MCF_STEPS[last]),
        Axis::linear("radius"),
        Axis::log("L² error"),
    );
    for (k, (method, scheme)) in variants().enumerate() {
        let points: Vec<[f64; 2]> = all.iter().map(|m| [m.radius, m.mcf[k][last]]).collect();
        errors = errors.with_series(
            Series::new(method.label_in(scheme), points)
                .with_colour(method.colour_in(scheme))
                .with_marker(marker(scheme)),
        );
    }
    let curve = |f: &dyn Fn(&Measurement) -> f64| -> Vec<[f64; 2]> {
        all.iter().map(|m| [m.radius, f(m)]).collect()
    };
    let mut energies = LineChart::new("Willmore energy", Axis::linear("radius"), Axis::linear("w"))
        .with_series(
            Series::new("implicit FE measure", curve(&|m| m.w_elements))
                .with_colour(1)
                .with_marker(Marker::Square),
        );
    let schemes = Method::Hybrid.schemes(Flow::Willmore).iter();
    for (k, &scheme) in schemes.enumerate() {
        energies = energies.with_series(
            Series::new(
                Method::Hybrid.label_in(scheme),
                curve(&|m| m.willmore[k].w_relaxed),
            )
            .with_colour(Method::Hybrid.colour_in(scheme))
            .with_marker(marker(scheme)),
        );
    }
    energies = energies.with_series(
        Series::new("exact, 8π", curve(&|_| SPHERE))
            .with_colour(Colour::Black)
            .with_style(LineStyle::Dashed),
    );
    Figure::new(run.title("Spheres"), 2)
        .with_panel(errors)
        .with_panel(energies)
        .with_note(format!(
            "n = {n}, ε = 2/n, inner step 1/n². Energies by the schemes are those after the steps of Willmore flow, of the relaxed profile."
        ))
}

fn summary(all: &[Measurement], n: usize, seconds: f64) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for m in all {
        let sphere = format!("spheres.r{:03.0}", 100.0 * m.radius);
        summary.insert(&format!("{sphere}.w"), m.w_elements)?;
        for still in &m.willmore {
            let key = match still.scheme {
                Scheme::Paper => sphere.clone(),
                other => format!("{sphere}.{}", Method::Hybrid.key_in(other)),
            };
            summary.insert(&format!("{key}.w_learned"), still.w_learned)?;
            summary.insert(&format!("{key}.w_relaxed"), still.w_relaxed)?;
            let change = still.radius_change * n as f64;
            summary.insert(&format!("{key}.radius_change_over_h"), change)?;
            summary.insert_count(&format!("{key}.energy_increases"), still.energy_increases)?;
        }
        for ((method, scheme), errors) in variants().zip(&m.mcf) {
            for (step, error) in MCF_STEPS.iter().zip(errors) {
                let method = method.key_in(scheme);
                summary.insert(&format!("{sphere}.mcf.{method}.l2.step{step}"), *error)?;
            }
        }
    }
    summary.insert("seconds", seconds)?;
    Ok(summary)
}
