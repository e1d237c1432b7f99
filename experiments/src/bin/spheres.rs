//! Spheres by the network for surfaces: mean curvature flow, Willmore energies, and standing still.

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use experiments::method::Method;
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

const PROGRAM: &str = "spheres";
const RADII: [f64; 6] = [0.15, 0.2, 0.25, 0.3, 0.35, 0.4];
/// Steps of mean curvature flow after which errors are reported; the smallest sphere vanishes after 23 at n = 64.
const MCF_STEPS: [usize; 3] = [1, 4, 8];
/// Steps of Willmore flow, which should leave spheres alone.
const WILLMORE_STEPS: usize = 20;
const TAU: f64 = 1.0 / 262_144.0;

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
    /// Errors of mean curvature flow by method, in the order of [`Method::ALL`], for each of the reported steps.
    mcf: Vec<Vec<f64>>,
    /// `w` with the implicit finite-element step and the mass-matrix norm, as the paper measures.
    w_elements: f64,
    /// `w` with the learned operator.
    w_learned: f64,
    /// Radius of the ball with the final volume, less that at the beginning.
    radius_change: f64,
    /// Steps in which the energy did not fall.
    energy_increases: usize,
    hvp_per_step: f64,
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
        let mut losses = quality::table(&["network"]);
        quality::push(&mut losses, &[&spec.name], measured)?;
        losses.write(&output, "quality")?;
    }
    let table = table(&all, n)?;
    table.write(&output, "spheres")?;
    output.write("spheres.json", report::data::to_json(&all)?)?;
    figure(&options.run, &all, n).write(&output, "spheres")?;
    let mut summary = summary(&all, n, since(clock))?;
    if let Some(measured) = &quality {
        quality::insert(&mut summary, &spec.name, measured)?;
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
    for method in Method::ALL {
        let mut flow = method.mean_curvature_flow(Some(network), &initial, &params, device)?;
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
    let w_elements = elements.willmore_energy(&initial)?;
    let mut flow = Method::Hybrid.willmore_flow(
        Some(network),
        &initial,
        params,
        LinearSolver::default(),
        device,
    )?;
    let mut records = Vec::new();
    for _ in 0..willmore_steps {
        records.push(flow.advance(TAU)?);
    }
    let steps = records.len() as f64;
    let first = records.first().map_or(f64::NAN, |r| r.energy_before);
    Ok(Measurement {
        radius,
        mcf,
        w_elements,
        // Standing still costs 2 tau w.
        w_learned: first / (2.0 * TAU),
        radius_change: radius_of(&flow.field()?) - radius_of(&initial),
        energy_increases: records
            .iter()
            .filter(|r| r.energy > r.energy_before)
            .count(),
        hvp_per_step: records.iter().map(|r| r.newton.hvp as f64).sum::<f64>() / steps,
    })
}

fn table(all: &[Measurement], n: usize) -> Result<Table, Error> {
    let head = [Column::number("radius", Format::Fixed(2))];
    let errors = Method::ALL.iter().flat_map(|method| {
        MCF_STEPS.map(|step| {
            let name = format!("MCF error, {}, step {step}", method.label());
            Column::number(name, Format::Fixed(5))
        })
    });
    let tail = [
        Column::number("w, FE measure", Format::Fixed(2)),
        Column::number("w, learned", Format::Fixed(2)),
        Column::number("w / 8π (FE)", Format::Fixed(4)),
        Column::number("change of radius / h", Format::Fixed(4)),
        Column::number("HVP/step", Format::Fixed(1)),
    ];
    let mut table = Table::new(head.into_iter().chain(errors).chain(tail));
    for m in all {
        let errors = m.mcf.iter().flatten().map(|&error| error.into());
        table.push([m.radius.into()].into_iter().chain(errors).chain([
            m.w_elements.into(),
            m.w_learned.into(),
            (m.w_elements / (8.0 * std::f64::consts::PI)).into(),
            (m.radius_change * n as f64).into(),
            m.hvp_per_step.into(),
        ]))?;
    }
    Ok(table)
}

fn figure(run: &RunOptions, all: &[Measurement], n: usize) -> Figure {
    let last = MCF_STEPS.len() - 1;
    let mut errors = LineChart::new(
        format!("Mean curvature flow, {} steps", MCF_STEPS[last]),
        Axis::linear("radius"),
        Axis::log("L² error"),
    );
    for (k, method) in Method::ALL.into_iter().enumerate() {
        let points: Vec<[f64; 2]> = all.iter().map(|m| [m.radius, m.mcf[k][last]]).collect();
        errors = errors.with_series(
            Series::new(method.label(), points)
                .with_colour(k)
                .with_style(method.style())
                .with_marker(Marker::Circle),
        );
    }
    let curve = |f: &dyn Fn(&Measurement) -> f64| -> Vec<[f64; 2]> {
        all.iter().map(|m| [m.radius, f(m)]).collect()
    };
    let sphere = 8.0 * std::f64::consts::PI;
    let energies = LineChart::new("Willmore energy", Axis::linear("radius"), Axis::linear("w"))
        .with_series(
            Series::new("implicit FE step", curve(&|m| m.w_elements))
                .with_colour(1)
                .with_marker(Marker::Square),
        )
        .with_series(
            Series::new("learned operator", curve(&|m| m.w_learned)).with_marker(Marker::Circle),
        )
        .with_series(
            Series::new("exact, 8π", curve(&|_| sphere))
                .with_colour(Colour::Black)
                .with_style(LineStyle::Dashed),
        );
    Figure::new(run.title("Spheres"), 2)
        .with_panel(errors)
        .with_panel(energies)
        .with_note(format!("n = {n}, ε = 2/n, inner step 1/n²."))
}

fn summary(all: &[Measurement], n: usize, seconds: f64) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for m in all {
        let key = format!("spheres.r{:03.0}", 100.0 * m.radius);
        summary.insert(&format!("{key}.w"), m.w_elements)?;
        summary.insert(&format!("{key}.w_learned"), m.w_learned)?;
        let change = m.radius_change * n as f64;
        summary.insert(&format!("{key}.radius_change_over_h"), change)?;
        summary.insert_count(&format!("{key}.energy_increases"), m.energy_increases)?;
        for (method, errors) in Method::ALL.iter().zip(&m.mcf) {
            for (step, error) in MCF_STEPS.iter().zip(errors) {
                summary.insert(&format!("{key}.mcf.{}.l2.step{step}", method.key()), *error)?;
            }
        }
    }
    summary.insert("seconds", seconds)?;
    Ok(summary)
}
