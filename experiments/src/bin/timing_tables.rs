//! Time of the methods for the same flow on the same machine.

use std::collections::BTreeMap;
use std::process::ExitCode;

use clap::Parser;
use experiments::circles::{EPS, STEP};
use experiments::comparison::cross;
use experiments::meshes::{ARMADILLO, About, MeshOptions};
use experiments::method::Method;
use experiments::networks::{NetworkOptions, checksum, convergence_ratios};
use experiments::options::RunOptions;
use experiments::{Error, harness, surfaces};
use fem::{FiniteElementStep, LinearSolver, Statistics};
use geometry::shapes::Ball;
use geometry::{Field, Grid, phase_field};
use indicatif::ProgressBar;
use model::Network;
use operators::ComputeDevice;
use report::{
    Axis, Column, Figure, Format, LineChart, LineStyle, Marker, OutputDir, Progress, Series,
    Summary, Table,
};
use serde::Serialize;
use solver::{FlowParams, Method as Newton, NewtonParams, StepRecord, WillmoreFlow};

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

#[derive(Serialize)]
struct Parameters {
    cells: Vec<usize>,
    budget: f64,
    steps: usize,
    networks: BTreeMap<String, String>,
    quick: bool,
}

/// A row of the table.
#[derive(Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum Variant {
    Hybrid,
    HybridPlain,
    FeImplicit,
    FeImplicitDirect,
    FeSemi,
}

impl Variant {
    const ALL: [Self; 5] = [
        Self::Hybrid,
        Self::HybridPlain,
        Self::FeImplicit,
        Self::FeImplicitDirect,
        Self::FeSemi,
    ];

    fn key(self) -> &'static str {
        match self {
            Self::Hybrid => "hybrid",
            Self::HybridPlain => "hybrid_plain_newton",
            Self::FeImplicit => "fe_implicit",
            Self::FeImplicitDirect => "fe_implicit_direct",
            Self::FeSemi => "fe_semi",
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Hybrid => "hybrid",
            Self::HybridPlain => "hybrid, plain Newton-CG",
            Self::FeImplicit => "FE implicit, FFT-CG inside",
            Self::FeImplicitDirect => "FE implicit, Cholesky inside",
            Self::FeSemi => "FE semi-implicit",
        }
    }

    /// What the paper reports for 128 steps, in seconds: hybrid on one A100, finite elements (sparse direct solver) on 64 cores.
    fn papers_seconds(self, n: usize) -> Option<f64> {
        match (self, n) {
            (Self::HybridPlain, 256) => Some(122.0),
            (Self::HybridPlain, 512) => Some(1020.0),
            (Self::FeImplicitDirect, 256) => Some(4970.0),
            (Self::FeImplicitDirect, 512) => Some(28622.0),
            (Self::FeSemi, 256) => Some(4307.0),
            (Self::FeSemi, 512) => Some(22045.0),
            _ => None,
        }
    }
}

/// What was measured for one row.
#[derive(Serialize, Clone, Debug)]
struct Timing {
    variant: Variant,
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
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    if !(options.budget.is_finite() && options.budget > 0.0) {
        return Err(Error::Options("--budget must be positive".to_owned()));
    }
    let cells = if quick {
        vec![128]
    } else {
        options.cells.clone()
    };
    let budget = if quick { 0.1 } else { options.budget };
    let mut ratios = cells
        .iter()
        .map(|&n| convergence_ratios(n))
        .collect::<Result<Vec<_>, _>>()?;
    ratios.push(surfaces::ratios());
    let device = options.run.open_device()?;
    let networks = options.networks.find(&ratios)?;
    let output = options.run.open_output(PROGRAM)?;
    let parameters = Parameters {
        networks: cells
            .iter()
            .zip(&networks)
            .map(|(n, network)| (format!("n{n}"), checksum(network)))
            .collect(),
        cells: cells.clone(),
        budget,
        steps: STEPS,
        quick,
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let progress = options.run.progress();
    let mut timings = Vec::new();
    for (&n, network) in cells.iter().zip(&networks) {
        let initial = initial(n, quick)?;
        let mut contenders = Variant::ALL
            .into_iter()
            .map(|variant| {
                let bar = progress.bar(format!("{}, n = {n}", variant.label()), STEPS as u64);
                Contender::new(variant, &initial, network, &device, bar)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let measured =
            manifest.phase(format!("n = {n}"), || measure(&mut contenders, n, budget))?;
        for contender in &contenders {
            contender.bar.finish();
        }
        timings.extend(measured);
    }
    let surface = manifest.phase("armadillo", || {
        surface_steps(options, &networks[networks.len() - 1], &device, &progress)
    })?;
    let table = table(&timings)?;
    table.write(&output, "timing")?;
    let surface_table = surface_table(&surface)?;
    surface_table.write(&output, "armadillo")?;
    output.write("timing.json", report::data::to_json(&timings)?)?;
    figure(&options.run, &timings).write(&output, "timing")?;
    let mut summary = summary(&timings)?;
    for step in &surface.steps {
        let key = format!("timing.armadillo.{}", step.method.key());
        summary.insert(&format!("{key}.seconds"), step.seconds)?;
        summary.insert_count(&format!("{key}.hvp"), step.hvp)?;
    }
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\n{}\n{}\nResults are in {}",
        options
            .run
            .title("128 Willmore steps of the cross: wall time on this machine"),
        table.to_markdown(),
        options.run.title(&format!(
            "One Willmore step of a surface: {}",
            surface.about.title
        )),
        surface_table.to_markdown(),
        output_path(&output)
    ));
    Ok(())
}

/// One step of a surface by one method.
#[derive(Serialize, Clone, Debug)]
struct SurfaceStep {
    method: Method,
    seconds: f64,
    newton: usize,
    hvp: usize,
    /// What the paper reports.
    papers_seconds: f64,
}

#[derive(Serialize, Clone, Debug)]
struct SurfaceSteps {
    about: About,
    n: usize,
    tau: f64,
    steps: Vec<SurfaceStep>,
}

/// One step of tau = 2^-18 of the armadillo at n = 64, eps = 2^-5, tautilde = 2^-12, by the hybrid scheme and nested finite elements.
fn surface_steps(
    options: &Options,
    network: &Network,
    device: &ComputeDevice,
    progress: &Progress,
) -> Result<SurfaceSteps, Error> {
    const TAU: f64 = 1.0 / 262_144.0;
    let n = if options.run.quick { 32 } else { 64 };
    let bar = progress.bar("signed distance".to_owned(), n as u64);
    let params = surfaces::scales(n);
    let grid = options.mesh.grid(&ARMADILLO, n)?;
    let mesh = options.mesh.load_or_built_in(&ARMADILLO, &grid)?;
    let initial = mesh.phase_field(grid, params.eps, &bar)?;
    bar.finish();
    let mut steps = Vec::new();
    for (method, papers_seconds) in [(Method::Hybrid, 807.0), (Method::FeImplicit, 14589.0)] {
        let mut flow = method.willmore_flow(
            Some(network),
            &initial,
            params,
            LinearSolver::default(),
            device,
        )?;
        let record = flow.advance(TAU)?;
        steps.push(SurfaceStep {
            method,
            seconds: record.seconds,
            newton: record.newton.newton,
            hvp: record.newton.hvp,
            papers_seconds,
        });
    }
    Ok(SurfaceSteps {
        about: mesh.about,
        n,
        tau: TAU,
        steps,
    })
}

fn surface_table(surface: &SurfaceSteps) -> Result<Table, Error> {
    let mut table = Table::new([
        Column::text("surface"),
        Column::text("method"),
        Column::number("n", Format::Shortest),
        Column::number("one step [s]", Format::Fixed(2)),
        Column::number("Newton", Format::Shortest),
        Column::number("HVP", Format::Shortest),
        Column::number("paper, other machines [s]", Format::Shortest),
    ]);
    for step in &surface.steps {
        table.push([
            surface.about.title.as_str().into(),
            step.method.label().into(),
            surface.n.into(),
            step.seconds.into(),
            step.newton.into(),
            step.hvp.into(),
            step.papers_seconds.into(),
        ])?;
    }
    Ok(table)
}

fn output_path(output: &OutputDir) -> String {
    output.as_path().display().to_string()
}

/// The cross, or for a smoke test a disc on a small box.
fn initial(n: usize, quick: bool) -> Result<Field<2>, Error> {
    if quick {
        let grid = Grid::per_unit(n, 0.75)?;
        return Ok(phase_field(grid, &Ball::new([0.0, 0.0], 0.2)?, EPS)?);
    }
    cross(Grid::per_unit(n, 2.0)?, EPS)
}

/// A method at work.
struct Contender {
    variant: Variant,
    flow: WillmoreFlow<2>,
    elements: Option<FiniteElementStep<2>>,
    records: Vec<StepRecord>,
    spent: f64,
    failure: Option<String>,
    bar: ProgressBar,
}

impl Contender {
    fn new(
        variant: Variant,
        initial: &Field<2>,
        network: &Network,
        device: &ComputeDevice,
        bar: ProgressBar,
    ) -> Result<Self, Error> {
        let grid = initial.grid();
        let method = match variant {
            Variant::HybridPlain => Newton::Paper,
            _ => Newton::Preconditioned,
        };
        let params = FlowParams {
            eps: EPS,
            mcf_step: STEP,
            newton: NewtonParams {
                method,
                ..NewtonParams::default()
            },
            calibration: solver::Factors::PAPER,
        };
        let elements = match variant {
            Variant::Hybrid | Variant::HybridPlain => None,
            Variant::FeImplicit => Some(FiniteElementStep::implicit(grid, EPS, STEP)?),
            Variant::FeImplicitDirect => Some(FiniteElementStep::implicit_with(
                grid,
                EPS,
                STEP,
                LinearSolver::Direct,
            )?),
            Variant::FeSemi => Some(FiniteElementStep::semi_implicit(grid, EPS, STEP)?),
        };
        let flow = match &elements {
            Some(step) => WillmoreFlow::new(step.clone(), initial, params, device)?,
            None => WillmoreFlow::with_network(network, initial, params, device)?,
        };
        Ok(Self {
            variant,
            flow,
            elements,
            records: Vec::new(),
            spent: 0.0,
            failure: None,
            bar,
        })
    }

    /// Whether there is a next step within the budget.
    fn goes_on(&self, budget: f64) -> bool {
        /// The first step costs more than the others: extrapolation needs some of those.
        const LEAST_STEPS: usize = 3;
        let done = self.records.len();
        self.failure.is_none() && done < STEPS && (done < LEAST_STEPS || self.spent < budget)
    }

    fn advance(&mut self) -> Result<(), Error> {
        match self.flow.advance(STEP) {
            Ok(record) => {
                self.spent += record.seconds;
                self.records.push(record);
            }
            Err(error @ solver::Error::NotConverged { .. }) => {
                self.failure = Some(error.to_string());
            }
            Err(error) => return Err(error.into()),
        }
        self.bar.inc(1);
        Ok(())
    }

    fn timing(&self, n: usize) -> Timing {
        let records = &self.records;
        let inner: Statistics = (self.elements.as_ref())
            .map_or_else(Statistics::default, FiniteElementStep::statistics);
        let count = records.len();
        let mean = |total: f64| total / count.max(1) as f64;
        let per_step = |total: usize| mean(total as f64);
        let step_seconds: Vec<f64> = records.iter().map(|r| r.seconds).collect();
        // Steps become cheaper as corners smooth out: the later ones say most about what is to come.
        let later = &step_seconds[count / 2..];
        let late = later.iter().sum::<f64>() / later.len().max(1) as f64;
        Timing {
            variant: self.variant,
            n,
            measured_steps: count,
            measured_seconds: self.spent,
            seconds: self.spent + late * (STEPS - count) as f64,
            step_seconds,
            extrapolated: count < STEPS,
            newton_per_step: per_step(records.iter().map(|r| r.newton.newton).sum()),
            hvp_per_step: mean(records.iter().map(StepRecord::hvp).sum()),
            inner_cg_per_step: per_step(inner.cg),
            factorizations_per_step: per_step(inner.factorizations),
            failure: self.failure.clone(),
        }
    }
}

/// All methods take turns, step by step, so that whatever else the machine does burdens them alike.
fn measure(contenders: &mut [Contender], n: usize, budget: f64) -> Result<Vec<Timing>, Error> {
    while contenders.iter().any(|c| c.goes_on(budget)) {
        for contender in contenders.iter_mut().filter(|c| c.goes_on(budget)) {
            contender.advance()?;
        }
    }
    Ok(contenders.iter().map(|c| c.timing(n)).collect())
}

/// Time of the measured steps over that of the same steps by the hybrid scheme.
fn over_hybrid(timing: &Timing, timings: &[Timing]) -> Option<f64> {
    let hybrid = timings
        .iter()
        .find(|t| t.n == timing.n && t.variant == Variant::Hybrid && usable(t))?;
    let common = timing.measured_steps.min(hybrid.measured_steps);
    let sum = |t: &Timing| t.step_seconds[..common].iter().sum::<f64>();
    usable(timing).then(|| sum(timing) / sum(hybrid))
}

/// Whether a row has a time worth showing.
fn usable(timing: &Timing) -> bool {
    timing.failure.is_none() && timing.measured_steps > 1
}

fn table(timings: &[Timing]) -> Result<Table, Error> {
    let mut table = Table::new([
        Column::text("method"),
        Column::number("n", Format::Shortest),
        Column::number("128 steps [s]", Format::Fixed(1)),
        Column::text("measured"),
        Column::number("times hybrid", Format::Fixed(1)),
        Column::number("times hybrid, measured steps", Format::Fixed(1)),
        Column::number("Newton/step", Format::Fixed(1)),
        Column::number("HVP/step", Format::Fixed(0)),
        Column::number("inner CG/step", Format::Fixed(0)),
        Column::number("Cholesky/step", Format::Fixed(1)),
        Column::number("paper, other machines [s]", Format::Shortest),
    ]);
    for timing in timings {
        let hybrid = timings
            .iter()
            .find(|t| t.n == timing.n && t.variant == Variant::Hybrid && usable(t));
        let seconds = usable(timing).then_some(timing.seconds);
        let factor = seconds.zip(hybrid).map(|(s, hybrid)| s / hybrid.seconds);
        let measured = match &timing.failure {
            Some(reason) => format!("stopped after {} steps: {reason}", timing.measured_steps),
            None if timing.extrapolated => {
                format!("extrapolated from {} steps", timing.measured_steps)
            }
            None => "all steps".to_owned(),
        };
        table.push([
            timing.variant.label().into(),
            timing.n.into(),
            seconds.into(),
            measured.into(),
            factor.into(),
            over_hybrid(timing, timings).into(),
            timing.newton_per_step.into(),
            timing.hvp_per_step.into(),
            timing.inner_cg_per_step.into(),
            timing.factorizations_per_step.into(),
            timing.variant.papers_seconds(timing.n).into(),
        ])?;
    }
    Ok(table)
}

fn figure(run: &RunOptions, timings: &[Timing]) -> Figure {
    let mut chart = LineChart::new(
        "",
        Axis::log("cells per unit length n"),
        Axis::log("seconds for 128 steps"),
    );
    for (k, variant) in Variant::ALL.into_iter().enumerate() {
        let marker = [Marker::Circle, Marker::Square, Marker::Triangle][k % 3];
        let of_variant = || timings.iter().filter(move |t| t.variant == variant);
        let ours: Vec<[f64; 2]> = of_variant()
            .filter(|t| usable(t))
            .map(|t| [t.n as f64, t.seconds])
            .collect();
        let papers: Vec<[f64; 2]> = of_variant()
            .filter_map(|t| Some([t.n as f64, variant.papers_seconds(t.n)?]))
            .collect();
        if !ours.is_empty() {
            chart = chart.with_series(
                Series::new(variant.label(), ours)
                    .with_colour(k)
                    .with_marker(marker),
            );
        }
        if !papers.is_empty() {
            let name = format!("{} (paper, other machines)", variant.label());
            chart = chart.with_series(
                Series::new(name, papers)
                    .with_colour(k)
                    .with_style(LineStyle::Dashed)
                    .with_marker(marker),
            );
        }
    }
    Figure::new(run.title("Willmore flow of a cross: wall time"), 1)
        .with_panel(chart)
        .with_shared_legend()
        .with_note(
            "Solid: this machine, one run, long rows extrapolated (see the table). Dashed: the paper's times on an A100 (hybrid) and \
             on 64 cores (finite elements).",
        )
}

fn summary(timings: &[Timing]) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for timing in timings.iter().filter(|t| usable(t)) {
        let key = format!("timing.n{}.{}", timing.n, timing.variant.key());
        summary.insert(&format!("{key}.seconds"), timing.seconds)?;
        summary.insert_count(&format!("{key}.measured_steps"), timing.measured_steps)?;
        if let Some(factor) = over_hybrid(timing, timings) {
            summary.insert(&format!("{key}.times_hybrid_measured_steps"), factor)?;
        }
        summary.insert(&format!("{key}.newton_per_step"), timing.newton_per_step)?;
        summary.insert(&format!("{key}.hvp_per_step"), timing.hvp_per_step)?;
        summary.insert(
            &format!("{key}.inner_cg_per_step"),
            timing.inner_cg_per_step,
        )?;
    }
    Ok(summary)
}
