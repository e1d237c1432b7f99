//! Time of the methods for the same flow on the same machine.

use std::process::ExitCode;

use clap::Parser;
use engine::{Method, Scheme, StepRule, checksum};
use experiments::meshes::{ARMADILLO, MeshOptions};
use experiments::networks::{Chosen, NetworkOptions, convergence_network};
use experiments::options::RunOptions;
use experiments::session::Session;
use experiments::timing::{self, Timed, take_turns};
use experiments::{Error, harness, surfaces};
use fem::LinearSolver;
use report::{Axis, Figure, Format, LineChart, LineStyle, Marker, Series, Summary, Table};
use serde::Serialize;
use serde_json::json;
use solver::{Method as Newton, StepRecord};

const PROGRAM: &str = "timing_tables";
/// Time steps of the table, until `t = 2^-7`.
const STEPS: usize = 128;

/// Wall time of 128 Willmore steps of the cross (eps = 2^-6, tau = tautilde = 2^-14, until t = 2^-7) by the hybrid scheme and by
/// nested finite elements, taking turns step by step on this machine, with the numbers of Newton steps, Hessian-vector products and
/// inner iterations. Rows that exceed the budget are extrapolated from the steps done, and say so.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    /// Cells per unit length, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = [256, 512])]
    cells: Vec<usize>,

    #[command(flatten)]
    mesh: MeshOptions,

    /// Stop a row after this many seconds and extrapolate; at least three steps are done
    #[arg(long, value_name = "SECONDS", default_value_t = 120.0)]
    budget: f64,
}

/// A row of the table.
struct Variant {
    key: &'static str,
    label: &'static str,
    method: Method,
    newton: Newton,
    linear: LinearSolver,
    /// What the paper reports for 128 steps at n = 256 and 512, in seconds: hybrid on one A100, finite elements (sparse direct
    /// solver) on 64 cores.
    papers_seconds: Option<[f64; 2]>,
}

const VARIANTS: [Variant; 5] = [
    Variant {
        key: "hybrid",
        label: "hybrid",
        method: Method::Hybrid,
        newton: Newton::Preconditioned,
        linear: LinearSolver::ConjugateGradients,
        papers_seconds: None,
    },
    Variant {
        key: "hybrid_plain_newton",
        label: "hybrid, plain Newton-CG",
        method: Method::Hybrid,
        newton: Newton::Paper,
        linear: LinearSolver::ConjugateGradients,
        papers_seconds: Some([122.0, 1020.0]),
    },
    Variant {
        key: "fe_implicit",
        label: "FE implicit, FFT-CG inside",
        method: Method::FeImplicit,
        newton: Newton::Preconditioned,
        linear: LinearSolver::ConjugateGradients,
        papers_seconds: None,
    },
    Variant {
        key: "fe_implicit_direct",
        label: "FE implicit, Cholesky inside",
        method: Method::FeImplicit,
        newton: Newton::Preconditioned,
        linear: LinearSolver::Direct,
        papers_seconds: Some([4970.0, 28622.0]),
    },
    Variant {
        key: "fe_semi",
        label: "FE semi-implicit",
        method: Method::FeSemi,
        newton: Newton::Preconditioned,
        linear: LinearSolver::ConjugateGradients,
        papers_seconds: Some([4307.0, 22045.0]),
    },
];

impl Variant {
    fn papers_seconds(&self, n: usize) -> Option<f64> {
        let column = [256, 512].iter().position(|&m| m == n)?;
        self.papers_seconds.map(|seconds| seconds[column])
    }
}

/// What was measured for one row.
#[derive(Serialize)]
struct Timing {
    variant: &'static str,
    n: usize,
    /// Steps done.
    measured_steps: usize,
    /// Wall time of those.
    measured_seconds: f64,
    /// The same, step by step.
    step_seconds: Vec<f64>,
    /// Wall time of all steps: measured, or with the mean of the later half of the measured steps for each of the rest.
    seconds: f64,
    extrapolated: bool,
    newton_per_step: f64,
    hvp_per_step: f64,
    inner_cg_per_step: f64,
    factorizations_per_step: f64,
    /// Why the row ended early, if it failed.
    failure: Option<String>,
    #[serde(skip)]
    row: &'static Variant,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let (run, quick) = (&options.run, options.run.quick);
    if !(options.budget.is_finite() && options.budget > 0.0) {
        return Err(Error::Options("--budget must be positive".to_owned()));
    }
    let cells = if quick { &[128][..] } else { &options.cells };
    let budget = if quick { 0.1 } else { options.budget };
    let mut needs =
        (cells.iter().map(|&n| convergence_network(n))).collect::<Result<Vec<_>, _>>()?;
    needs.push(surfaces::needed_network());
    let device = run.open_device()?;
    let networks = options.networks.load(&needs)?;
    let checksums = cells.iter().zip(&needs).map(|(n, needed)| {
        let network = networks.find(Scheme::Paper, needed)?.network;
        Ok((format!("n{n}"), checksum(&network).into()))
    });
    let parameters = json!({
        "networks": checksums.collect::<Result<serde_json::Map<_, _>, Error>>()?,
        "cells": cells,
        "budget": budget,
        "steps": STEPS,
        "quick": quick,
    });
    let mut session = Session::open(PROGRAM, run, device, &parameters)?;
    let mut timings = Vec::new();
    for &n in cells {
        timings.extend(measure(&mut session, &networks, n, budget)?);
    }
    let armadillo = surface_steps(options, &networks, &mut session)?;

    let table = table(&timings)?;
    table.write(&session.output, "timing")?;
    let surface_table = surface_table(&armadillo)?;
    surface_table.write(&session.output, "armadillo")?;
    session.output.write_json("timing.json", &timings)?;
    session.figure(figure(&timings), "timing")?;
    let report = format!(
        "{}\n{}\n{}",
        table.to_markdown(),
        run.title("One Willmore step of a surface"),
        surface_table.to_markdown()
    );
    let title = "128 Willmore steps of the cross: wall time on this machine";
    session.finish(title, summary(&timings, &armadillo)?, &report)
}

/// All rows at a resolution.
fn measure(
    session: &mut Session<'_>,
    networks: &Chosen,
    n: usize,
    budget: f64,
) -> Result<Vec<Timing>, Error> {
    /// The first step costs more than the others: extrapolation needs some of those.
    const LEAST_STEPS: usize = 3;
    let mut contenders = Vec::new();
    for row in &VARIANTS {
        let mut operator = networks.operator((row.method, Scheme::Paper), n)?;
        // All begin their steps on the whole grid, as in the paper.
        operator.half_grids = false;
        operator.linear = row.linear;
        let mut case = timing::plane(&operator, n, STEPS, session.options.quick)?;
        case.scales.newton.method = row.newton;
        let bar = (session.progress).bar(format!("{}, n = {n}", row.label), STEPS as u64);
        contenders.push((row, Timed::new(case, &session.device, bar)?));
    }
    let goes_on = |(_, timed): &(&Variant, Timed<2>)| {
        let seconds = timed.seconds();
        timed.goes_on() && (seconds.len() < LEAST_STEPS || seconds.iter().sum::<f64>() < budget)
    };
    session.phase(format!("n = {n}"), || {
        take_turns(&mut contenders, goes_on, |(_, timed)| timed.step())
    })?;
    let timings = contenders
        .into_iter()
        .map(|(row, timed)| Timing::of(row, n, timed));
    Ok(timings.collect())
}

impl Timing {
    fn of(row: &'static Variant, n: usize, timed: Timed<2>) -> Self {
        let step_seconds = timed.seconds();
        let (count, measured) = (step_seconds.len(), step_seconds.iter().sum::<f64>());
        // Steps become cheaper as corners smooth out: the later ones say most about what is to come.
        let later = &step_seconds[count / 2..];
        let late = later.iter().sum::<f64>() / later.len().max(1) as f64;
        let inner = timed.run.statistics().unwrap_or_default();
        let per_step = |total: usize| total as f64 / count.max(1) as f64;
        Self {
            variant: row.key,
            n,
            measured_steps: count,
            measured_seconds: measured,
            seconds: measured + late * (STEPS - count) as f64,
            step_seconds,
            extrapolated: count < STEPS,
            newton_per_step: timed.mean(|r| r.newton.newton as f64),
            hvp_per_step: timed.mean(StepRecord::hvp),
            inner_cg_per_step: per_step(inner.cg),
            factorizations_per_step: per_step(inner.factorizations),
            failure: timed.failure,
            row,
        }
    }

    /// Whether there is a time worth showing.
    fn usable(&self) -> bool {
        self.failure.is_none() && self.measured_steps > 1
    }

    /// How it was measured.
    fn measured(&self) -> String {
        let steps = self.measured_steps;
        match &self.failure {
            Some(reason) => format!("stopped after {steps} steps: {reason}"),
            None if self.extrapolated => format!("extrapolated from {steps} steps"),
            None => "all steps".to_owned(),
        }
    }

    /// Time of all steps, and of those measured by both, over that of the hybrid scheme.
    fn over_hybrid(&self, all: &[Self]) -> Option<[f64; 2]> {
        let hybrid = |t: &&Self| t.n == self.n && t.variant == "hybrid" && t.usable();
        let hybrid = all.iter().find(hybrid).filter(|_| self.usable())?;
        let common = self.measured_steps.min(hybrid.measured_steps);
        let sum = |t: &Self| t.step_seconds[..common].iter().sum::<f64>();
        Some([self.seconds / hybrid.seconds, sum(self) / sum(hybrid)])
    }
}

/// One step of a surface.
struct SurfaceStep {
    surface: String,
    method: Method,
    n: usize,
    made: StepRecord,
    /// What the paper reports.
    papers_seconds: f64,
}

/// One step of tau = 2^-18 of the armadillo at n = 64, eps = 2^-5, tautilde = 2^-12, by the hybrid scheme and nested finite elements.
fn surface_steps(
    options: &Options,
    networks: &Chosen,
    session: &mut Session<'_>,
) -> Result<Vec<SurfaceStep>, Error> {
    const METHODS: [(Method, f64); 2] = [(Method::Hybrid, 807.0), (Method::FeImplicit, 14589.0)];
    let n = if options.run.quick { 32 } else { 64 };
    let time = (StepRule::Constant(0.5_f64.powi(18)), 1);
    let (scales, needed) = (surfaces::scales(n), surfaces::needed_network());
    let bar = session.progress.bar("signed distance".to_owned(), n as u64);
    let grid = options.mesh.grid(&ARMADILLO, n)?;
    let device = session.device.clone();
    session.phase("armadillo", || {
        let mesh = options.mesh.load_or_built_in(&ARMADILLO, &grid)?;
        let initial = mesh.phase_field(grid, scales.eps, &bar)?;
        let step = |(method, papers_seconds)| {
            let source = networks.of(Scheme::Paper);
            let variant = (method, Scheme::Paper);
            let operator = engine::Operator::new(variant, &source, &needed, &grid, &scales)?;
            let title = &mesh.about.title;
            let case = surfaces::willmore_flow(title, initial.clone(), operator, scales, time);
            let mut timed = Timed::new(case, &device, bar.clone())?;
            timed.step()?;
            let made = timed.minimizations().next().copied();
            let failed = || Error::Options(timed.failure.clone().unwrap_or_default());
            Ok(SurfaceStep {
                surface: title.clone(),
                method,
                n,
                made: made.ok_or_else(failed)?,
                papers_seconds,
            })
        };
        METHODS.into_iter().map(step).collect()
    })
}

fn surface_table(steps: &[SurfaceStep]) -> Result<Table, Error> {
    Ok(Table::of(steps)
        .text("surface", |s| &s.surface)
        .text("method", |s| s.method.label())
        .number("n", Format::Shortest, |s| s.n)
        .number("one step [s]", Format::Fixed(2), |s| s.made.seconds)
        .number("Newton", Format::Shortest, |s| s.made.newton.newton)
        .number("HVP", Format::Shortest, |s| s.made.newton.hvp)
        .number("paper, other machines [s]", Format::Shortest, |s| {
            s.papers_seconds
        })
        .finish()?)
}

fn table(timings: &[Timing]) -> Result<Table, Error> {
    let times = |t: &Timing, k: usize| t.over_hybrid(timings).map(|times| times[k]);
    Ok(Table::of(timings)
        .text("method", |t| t.row.label)
        .number("n", Format::Shortest, |t| t.n)
        .number("128 steps [s]", Format::Fixed(1), |t| {
            t.usable().then_some(t.seconds)
        })
        .text("measured", Timing::measured)
        .number("times hybrid", Format::Fixed(1), |t| times(t, 0))
        .number("times hybrid, measured steps", Format::Fixed(1), |t| {
            times(t, 1)
        })
        .number("Newton/step", Format::Fixed(1), |t| t.newton_per_step)
        .number("HVP/step", Format::Fixed(0), |t| t.hvp_per_step)
        .number("inner CG/step", Format::Fixed(0), |t| t.inner_cg_per_step)
        .number("Cholesky/step", Format::Fixed(1), |t| {
            t.factorizations_per_step
        })
        .number("paper, other machines [s]", Format::Shortest, |t| {
            t.row.papers_seconds(t.n)
        })
        .finish()?)
}

fn figure(timings: &[Timing]) -> Figure {
    let axes = (
        Axis::log("cells per unit length n"),
        Axis::log("seconds for 128 steps"),
    );
    let mut chart = LineChart::new("", axes.0, axes.1);
    for (k, row) in VARIANTS.iter().enumerate() {
        let marker = [Marker::Circle, Marker::Square, Marker::Triangle][k % 3];
        let own = || timings.iter().filter(|t| t.variant == row.key);
        let ours: Vec<[f64; 2]> = (own().filter(|t| t.usable()))
            .map(|t| [t.n as f64, t.seconds])
            .collect();
        let papers: Vec<[f64; 2]> =
            (own().filter_map(|t| Some([t.n as f64, row.papers_seconds(t.n)?]))).collect();
        let ours = Series::new(row.label, ours);
        let papers = Series::new(format!("{} (paper, other machines)", row.label), papers)
            .with_style(LineStyle::Dashed);
        let curves = [ours, papers].map(|curve| curve.with_colour(k).with_marker(marker));
        chart = chart.with_curves(curves.into_iter().filter(|curve| !curve.points.is_empty()));
    }
    Figure::new("Willmore flow of a cross: wall time", 1)
        .with_panel(chart)
        .with_shared_legend()
        .with_note(
            "Solid: this machine, one run, long rows extrapolated (see the table). Dashed: the paper's times on an A100 (hybrid) and \
             on 64 cores (finite elements).",
        )
}

fn summary(timings: &[Timing], armadillo: &[SurfaceStep]) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for timing in timings.iter().filter(|t| t.usable()) {
        let key = format!("timing.n{}.{}", timing.n, timing.variant);
        summary.insert(&format!("{key}.seconds"), timing.seconds)?;
        summary.insert_count(&format!("{key}.measured_steps"), timing.measured_steps)?;
        if let Some([_, factor]) = timing.over_hybrid(timings) {
            summary.insert(&format!("{key}.times_hybrid_measured_steps"), factor)?;
        }
        summary.insert(&format!("{key}.newton_per_step"), timing.newton_per_step)?;
        summary.insert(&format!("{key}.hvp_per_step"), timing.hvp_per_step)?;
        summary.insert(
            &format!("{key}.inner_cg_per_step"),
            timing.inner_cg_per_step,
        )?;
    }
    for step in armadillo {
        let key = format!("timing.armadillo.{}", step.method.key());
        summary.insert(&format!("{key}.seconds"), step.made.seconds)?;
        summary.insert_count(&format!("{key}.hvp"), step.made.newton.hvp)?;
    }
    Ok(summary)
}
