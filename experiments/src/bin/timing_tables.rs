//! Time of the methods for the same flow on the same machine.

use std::process::ExitCode;

use clap::Parser;
use engine::{Method, Operator, Scheme, StepRule};
use experiments::meshes::{ARMADILLO, MeshOptions};
use experiments::networks::{Chosen, NetworkOptions, convergence_network};
use experiments::options::RunOptions;
use experiments::session::Session;
use experiments::timing::{self, Columns, Numbers, Timed, take_turns};
use experiments::{Error, harness, surfaces};
use fem::LinearSolver;
use report::{Axis, Figure, Format, LineChart, LineStyle, Marker, Series, Summary, Table};
use serde_json::json;
use solver::Method as Newton;

const PROGRAM: &str = "timing_tables";
/// Time steps of the table, until `t = 2^-7`.
const STEPS: usize = 128;
/// Heading of the column with the paper's times.
const PAPERS: &str = "paper, other machines [s]";

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

/// A row at work, and what was measured.
struct Timing {
    row: &'static Variant,
    n: usize,
    timed: Timed<2>,
    /// Why the row ended early, if it failed.
    failure: Option<String>,
}

const COLUMNS: &Columns = &[
    ("Newton/step", Format::Fixed(1), "newton_per_step"),
    ("HVP/step", Format::Fixed(0), "hvp_per_step"),
    ("inner CG/step", Format::Fixed(0), "inner_cg_per_step"),
    ("Cholesky/step", Format::Fixed(1), "factorizations_per_step"),
];

fn main() -> ExitCode {
    harness::main(program)
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
        Ok((format!("n{n}"), network.fingerprint().into()))
    });
    let parameters = json!({
        "networks": checksums.collect::<Result<serde_json::Map<_, _>, Error>>()?,
        "cells": cells,
        "budget": budget,
        "steps": STEPS,
    });
    let mut session = Session::open(PROGRAM, run, device, parameters)?;
    let mut timings = Vec::new();
    for &n in cells {
        timings.extend(measure(&mut session, &networks, n, budget)?);
    }
    let armadillo = surface_steps(options, &networks, &mut session)?;

    table(&mut session, &timings)?;
    session.remark(run.title("One Willmore step of a surface"));
    surface_table(&mut session, &armadillo)?;
    let json = timings.iter().map(|t| {
        let (row, seconds) = (t.row.key, t.timed.seconds());
        json!({ "variant": row, "n": t.n, "numbers": t.numbers(), "step_seconds": seconds, "failure": t.failure })
    });
    session
        .output
        .write_json("timing.json", &json.collect::<Vec<_>>())?;
    session.figure(figure(&timings), "timing")?;
    summarize(&mut session.summary, &timings, &armadillo)?;
    session.finish("128 Willmore steps of the cross: wall time on this machine")
}

/// All rows at a resolution.
fn measure(
    session: &mut Session<'_>,
    networks: &Chosen,
    n: usize,
    budget: f64,
) -> Result<Vec<Timing>, Error> {
    let mut contenders = Vec::new();
    for row in &VARIANTS {
        let mut operator = networks.operator((row.method, Scheme::Paper), n)?;
        // All begin their steps on the whole grid, as in the paper.
        operator.half_grids = false;
        operator.linear = row.linear;
        let mut case = timing::plane(&operator, n, STEPS, session.options.quick)?;
        case.scales.newton.method = row.newton;
        let bar = (session.progress).bar(format!("{}, n = {n}", row.label), STEPS as u64);
        let timed = Timed::new(case, &session.device, bar)?;
        contenders.push(Timing {
            row,
            n,
            timed,
            failure: None,
        });
    }
    session.phase(format!("n = {n}"), || {
        take_turns(
            &mut contenders,
            |timing| timing.goes_on(budget),
            Timing::step,
        )
    })?;
    Ok(contenders)
}

impl Timing {
    fn goes_on(&self, budget: f64) -> bool {
        /// The first step costs more than the others: extrapolation needs some of those.
        const LEAST_STEPS: usize = 3;
        let seconds = self.timed.seconds();
        let more = seconds.len() < LEAST_STEPS || seconds.iter().sum::<f64>() < budget;
        self.failure.is_none() && seconds.len() < STEPS && more
    }

    fn step(&mut self) -> Result<(), Error> {
        match self.timed.step() {
            Err(Error::Engine(engine::Error::Step { source, .. }))
                if matches!(*source, solver::Error::NotConverged { .. }) =>
            {
                self.failure = Some(source.to_string());
                Ok(())
            }
            other => other.map(drop),
        }
    }

    /// Time and work, with the time of all steps in seconds: measured, or with the mean of the later half of the measured steps for each
    /// of the rest. Steps become cheaper as corners smooth out: the later ones say most about what is to come.
    fn numbers(&self) -> Numbers {
        let (mut numbers, seconds) = (self.timed.numbers(), self.timed.seconds());
        let (count, measured) = (seconds.len(), seconds.iter().sum::<f64>());
        let later = &seconds[count / 2..];
        let late = later.iter().sum::<f64>() / later.len().max(1) as f64;
        let inner = self.timed.run.statistics().unwrap_or_default();
        let per_step = |total: usize| total as f64 / count.max(1) as f64;
        numbers.extend([
            ("measured_steps", count as f64),
            ("measured_seconds", measured),
            ("seconds", measured + late * (STEPS - count) as f64),
            ("inner_cg_per_step", per_step(inner.cg)),
            ("factorizations_per_step", per_step(inner.factorizations)),
        ]);
        numbers
    }

    /// Whether there is a time worth showing.
    fn usable(&self) -> bool {
        self.failure.is_none() && self.timed.run.steps() > 1
    }

    fn seconds(&self) -> Option<f64> {
        self.usable().then(|| self.numbers()["seconds"])
    }

    /// How it was measured.
    fn measured(&self) -> String {
        let steps = self.timed.run.steps();
        match &self.failure {
            Some(reason) => format!("stopped after {steps} steps: {reason}"),
            None if steps < STEPS => format!("extrapolated from {steps} steps"),
            None => "all steps".to_owned(),
        }
    }

    /// Time of all steps, and of those measured by both, over that of the hybrid scheme.
    fn over_hybrid(&self, all: &[Self]) -> Option<[f64; 2]> {
        let hybrid = (all.iter()).find(|t| t.n == self.n && t.row.key == "hybrid")?;
        let (own, its) = (self.timed.seconds(), hybrid.timed.seconds());
        let common = own.len().min(its.len());
        let measured = own[..common].iter().sum::<f64>() / its[..common].iter().sum::<f64>();
        Some([self.seconds()? / hybrid.seconds()?, measured])
    }
}

/// One step of a surface, and what the paper reports in seconds.
struct SurfaceStep {
    surface: String,
    method: Method,
    n: usize,
    numbers: Numbers,
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
        let (surface, initial) = (&mesh.about.title, mesh.phase_field(grid, scales.eps, &bar)?);
        let step = |(method, papers_seconds)| {
            let (variant, source) = ((method, Scheme::Paper), networks.of(Scheme::Paper));
            let operator = Operator::new(variant, &source, &needed, &grid, &scales)?;
            let case = surfaces::willmore_flow(surface, initial.clone(), operator, scales, time);
            let mut timed = Timed::new(case, &device, bar.clone())?;
            timed.step()?;
            Ok(SurfaceStep {
                surface: surface.clone(),
                method,
                n,
                numbers: timed.numbers(),
                papers_seconds,
            })
        };
        METHODS.into_iter().map(step).collect()
    })
}

fn surface_table(session: &mut Session<'_>, steps: &[SurfaceStep]) -> Result<(), Error> {
    const COLUMNS: &Columns = &[
        ("one step [s]", Format::Fixed(2), "seconds"),
        ("Newton", Format::Fixed(0), "newton_per_step"),
        ("HVP", Format::Fixed(0), "hvp_on_this_grid"),
    ];
    let table = Table::of(steps)
        .text("surface", |s| &s.surface)
        .text("method", |s| s.method.label())
        .number("n", Format::Shortest, |s| s.n);
    let table = timing::with_columns(table, COLUMNS, |s| &s.numbers);
    let papers = |s: &SurfaceStep| s.papers_seconds;
    session.table(table.number(PAPERS, Format::Shortest, papers), "armadillo")
}

fn table(session: &mut Session<'_>, timings: &[Timing]) -> Result<(), Error> {
    let numbers: Vec<Numbers> = timings.iter().map(Timing::numbers).collect();
    let rows: Vec<(&Timing, Numbers)> = timings.iter().zip(numbers).collect();
    let times = |t: &Timing, k: usize| t.over_hybrid(timings).map(|times| times[k]);
    let table = Table::of(&rows)
        .text("method", |(t, _)| t.row.label)
        .number("n", Format::Shortest, |(t, _)| t.n)
        .number("128 steps [s]", Format::Fixed(1), |(t, _)| t.seconds())
        .text("measured", |(t, _)| t.measured())
        .number("times hybrid", Format::Fixed(1), |(t, _)| times(t, 0))
        .number(
            "times hybrid, measured steps",
            Format::Fixed(1),
            |(t, _)| times(t, 1),
        );
    let papers = |(t, _): &(&Timing, Numbers)| t.row.papers_seconds(t.n);
    let table = timing::with_columns(table, COLUMNS, |(_, numbers)| numbers);
    session.table(table.number(PAPERS, Format::Shortest, papers), "timing")
}

fn figure(timings: &[Timing]) -> Figure {
    let axes = (
        Axis::log("cells per unit length n"),
        Axis::log("seconds for 128 steps"),
    );
    let mut chart = LineChart::new("", axes.0, axes.1);
    for (k, row) in VARIANTS.iter().enumerate() {
        let marker = [Marker::Circle, Marker::Square, Marker::Triangle][k % 3];
        let own = || timings.iter().filter(|t| t.row.key == row.key);
        let points = |seconds: &dyn Fn(&Timing) -> Option<f64>| -> Vec<[f64; 2]> {
            own()
                .filter_map(|t| Some([t.n as f64, seconds(t)?]))
                .collect()
        };
        let (ours, papers) = (
            points(&Timing::seconds),
            points(&|t| row.papers_seconds(t.n)),
        );
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

fn summarize(
    summary: &mut Summary,
    timings: &[Timing],
    armadillo: &[SurfaceStep],
) -> Result<(), Error> {
    for timing in timings.iter().filter(|t| t.usable()) {
        let mut numbers = timing.numbers();
        let factor = timing.over_hybrid(timings);
        numbers.extend(factor.map(|[_, measured]| ("times_hybrid_measured_steps", measured)));
        let key = format!("timing.n{}.{}", timing.n, timing.row.key);
        timing::summarize(summary, &key, &numbers)?;
    }
    for step in armadillo {
        let key = format!("timing.armadillo.{}", step.method.key());
        summary.insert(&format!("{key}.seconds"), step.numbers["seconds"])?;
        summary.insert(&format!("{key}.hvp"), step.numbers["hvp_on_this_grid"])?;
    }
    Ok(())
}
