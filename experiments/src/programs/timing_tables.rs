use crate::meshes::{ARMADILLO, MeshOptions};
use crate::prelude::*;
use crate::{surfaces, timing};
use engine::Method::{FeImplicit, FeSemi, Hybrid};
use fem::LinearSolver::{self, ConjugateGradients, Direct};
use solver::NewtonVariant::{self, Paper, Preconditioned};

pub const EXPERIMENT: Experiment = Experiment {
    name: "timing_tables",
    summary: "Time of the methods for the same flow on the same machine.",
    program: |own| own.run(program),
    quick: Some(&["--procedural"]),
    results: &[ResultFolder {
        name: "timing_tables",
        title: "Computing time",
        description: "128 Willmore steps of the cross by every method, which take turns on one machine, and one step of \
                 the armadillo.",
        figures: &[(
            "timing",
            "Wall time against cells per unit length, beside the paper's on other machines.",
        )],
        options: Some("--budget 100"),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Times",
    note: "",
    words: &[
        METHOD,
        (
            "ROW",
            "`hybrid`; `hybrid_plain_newton`, with the paper's Newton-CG; `fe_implicit`, conjugate gradients inside; \
             `fe_implicit_direct`, Cholesky inside; `fe_semi`",
        ),
    ],
    rows: &[
        (
            "timing.nN.ROW.seconds",
            "wall time of 128 steps of the cross; those that were not measured count as the hybrid scheme's, times \
             the ratio of both over the later half of the measured ones",
        ),
        (
            "timing.nN.ROW.measured_steps, timing.nN.ROW.measured_seconds",
            "steps that were measured, and their wall time",
        ),
        (
            "timing.nN.ROW.hvp_per_step, timing.nN.ROW.newton_per_step, timing.nN.ROW.inner_cg_per_step, \
             timing.nN.ROW.factorizations_per_step",
            "Hessian-vector products, Newton steps, iterations of inner conjugate gradients, Cholesky factorizations \
             per step",
        ),
        (
            "timing.nN.ROW.steps, timing.nN.ROW.seconds_per_step, timing.nN.ROW.hvp_on_this_grid, \
             timing.nN.ROW.hvp_on_coarser_grids, timing.nN.ROW.ms_per_product",
            "as for `performance`, of the steps that were measured",
        ),
        (
            "timing.nN.ROW.times_hybrid_measured_steps",
            "wall time over that of the hybrid scheme for the same steps",
        ),
        (
            "timing.armadillo.METHOD.seconds, timing.armadillo.METHOD.hvp",
            "wall time and Hessian-vector products of one step of the armadillo, n = 64",
        ),
    ],
};

/// Time steps of the table, until `t = 2^-7`.
const STEPS: usize = 128;
/// Headings of the columns with the times over those of the hybrid scheme, and with the paper's.
const MEASURED: &str = "times hybrid, measured steps";
const PAPERS: &str = "paper, other machines [s]";

/// Wall time of 128 Willmore steps of the cross (eps = 2^-6, tau = tautilde = 2^-14, until t = 2^-7) by the hybrid scheme and by
/// nested finite elements, taking turns step by step on this machine, with the numbers of Newton steps, Hessian-vector products and
/// inner iterations. Rows that exceed the budget are extrapolated from the steps done, by the times that the hybrid scheme takes, and say so.
#[derive(Parser, Debug)]
#[command(version)]
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

struct Variant {
    key: &'static str,
    label: &'static str,
    method: Method,
    newton: NewtonVariant,
    linear: LinearSolver,
    /// What the paper reports for 128 steps at n = 256 and 512, in seconds: hybrid on one A100, finite elements (sparse direct
    /// solver) on 64 cores.
    papers_seconds: Option<[f64; 2]>,
}

const HYBRID: Variant = Variant {
    key: "hybrid",
    label: "hybrid",
    method: Hybrid,
    newton: Preconditioned,
    linear: ConjugateGradients,
    papers_seconds: None,
};

const VARIANTS: [Variant; 5] = [
    HYBRID,
    Variant {
        key: "hybrid_plain_newton",
        label: "hybrid, plain Newton-CG",
        newton: Paper,
        papers_seconds: Some([122.0, 1020.0]),
        ..HYBRID
    },
    Variant {
        key: "fe_implicit",
        label: "FE implicit, FFT-CG inside",
        method: FeImplicit,
        ..HYBRID
    },
    Variant {
        key: "fe_implicit_direct",
        label: "FE implicit, Cholesky inside",
        method: FeImplicit,
        linear: Direct,
        papers_seconds: Some([4970.0, 28622.0]),
        ..HYBRID
    },
    Variant {
        key: "fe_semi",
        label: "FE semi-implicit",
        method: FeSemi,
        papers_seconds: Some([4307.0, 22045.0]),
        ..HYBRID
    },
];

/// A row at work, and what was measured.
struct Timing {
    row: &'static Variant,
    n: usize,
    run: Run<2>,
    /// Why the row ended early, if it failed.
    failure: Option<String>,
    numbers: Numbers,
}

const COLUMNS: [(&str, Format, &str); 4] = [
    ("Newton/step", Fixed(1), "newton_per_step"),
    ("HVP/step", Fixed(0), "hvp_per_step"),
    ("inner CG/step", Fixed(0), "inner_cg_per_step"),
    ("Cholesky/step", Fixed(1), "factorizations_per_step"),
];

fn program(options: &Options) -> Result<()> {
    let (run, quick) = (&options.run, options.run.quick);
    let possible = options.budget.is_finite() && options.budget > 0.0;
    require(possible, "--budget must be positive")?;
    let cells = &distinct(if quick { &[128] } else { &options.cells });
    let budget = if quick { 0.1 } else { options.budget };
    let networks = timing::networks(&options.networks, cells)?;
    let checksum = |&n| {
        let found = networks.find(Formulation::Paper, &convergence_network(n)?)?;
        Ok((format!("n{n}"), found.network.fingerprint().into()))
    };
    let checksums = cells.iter().map(checksum);
    let n = if quick { 32 } else { 64 };
    let grid = surfaces::centred_box(n, options.mesh.box_side(&ARMADILLO))?;
    let mesh = options.mesh.load_or_built_in(&ARMADILLO, &grid)?;
    let parameters = json!({
        "networks": checksums.collect::<Result<serde_json::Map<_, _>>>()?,
        "cells": cells, "budget": budget, "steps": STEPS, "mesh": mesh.about,
    });
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let shape = run.either("a disc", "the cross");
    let mut timings = Vec::new();
    for &n in cells {
        timings.extend(measure(&mut session, &networks, n, budget)?);
    }
    // One step of tau = 2^-18 of the armadillo by the hybrid scheme and nested finite elements, eps = 2h, tautilde = h^2.
    let rule = StepRule::Constant(0.5_f64.powi(18));
    let (scales, needed) = (surfaces::scales(n), surfaces::needed_network());
    let steps = session.phase("armadillo", |stage| {
        let initial = mesh.phase_field(grid, scales.eps, &stage.bar)?;
        let mut steps = Vec::new();
        for (method, papers_seconds) in [(Hybrid, 807.0), (FeImplicit, 14589.0)] {
            let discretization = Discretization::new(method, Formulation::Paper);
            let source = networks.of(Formulation::Paper);
            let operator = Operator::new(discretization, &source, &needed, &grid, &scales)?;
            let (title, initial) = (&mesh.title, initial.clone());
            let run = stage.run(Case::willmore(title, initial, operator, scales, rule, 1))?;
            let papers_seconds = (mesh.is_papers && !quick).then_some(papers_seconds);
            steps.push((method, timing::numbers(&run, stage.device), papers_seconds));
        }
        Ok(steps)
    })?;

    let times = |t: &Timing, k: usize| t.over_hybrid(&timings).map(|times| times[k]);
    let table = Sheet::of(&timings)
        .text("method", |t| t.row.label)
        .column("n", Shortest, |t| t.n)
        .column("128 steps [s]", Fixed(1), Timing::seconds)
        .text("measured", Timing::measured)
        .column("times hybrid", Fixed(1), |t| times(t, 0))
        .column(MEASURED, Fixed(1), |t| times(t, 1))
        .columns(&COLUMNS, |t| &t.numbers)
        .column(PAPERS, Shortest, Timing::papers_seconds);
    session.sheet(table, "timing")?;
    session.remark(run.title("One Willmore step of a surface"));
    let steps = Sheet::of(&steps)
        .keyed(|(method, ..), name| format!("timing.armadillo.{method}.{name}"))
        .text("surface", |_| &mesh.title)
        .text("method", |(method, ..)| method.label())
        .column("n", Shortest, |_| n)
        .measure("seconds", "one step [s]", Fixed(2), |s| s.1["seconds"])
        .column("Newton", Fixed(0), |s| s.1["newton_per_step"])
        .measure("hvp", "HVP", Fixed(0), |s| s.1["hvp_on_this_grid"])
        .column(PAPERS, Shortest, |s| s.2);
    session.sheet(steps, "armadillo")?;
    let json = timings.iter().map(|t| {
        let (row, seconds) = (t.row.key, timing::seconds(&t.run));
        json!({ "variant": row, "n": t.n, "numbers": t.numbers, "step_seconds": seconds, "failure": t.failure })
    });
    let json: Vec<_> = json.collect();
    session.output.write_json("timing.json", &json)?;
    session.figure(figure(&timings, shape), "timing")?;
    for timing in timings.iter().filter(|timing| timing.usable()) {
        let key = format!("timing.n{}.{}", timing.n, timing.row.key);
        let times = times(timing, 1).map(|times| ("times_hybrid_measured_steps", times));
        for (name, value) in timing.numbers.clone().into_iter().chain(times) {
            session.metric(&format!("{key}.{name}"), value)?;
        }
    }
    session.finish(&format!(
        "128 Willmore steps of {shape}: wall time on this machine"
    ))
}

fn measure(session: &mut Session, networks: &Chosen, n: usize, budget: f64) -> Result<Vec<Timing>> {
    let mut contenders = Vec::new();
    for row in &VARIANTS {
        let mut operator =
            networks.operator(Discretization::new(row.method, Formulation::Paper), n)?;
        // All begin their steps on the whole grid, as in the paper.
        operator.half_grids = false;
        operator.linear = row.linear;
        let mut case = timing::plane(&operator, n, STEPS, session.options.quick)?;
        case.scales.newton.variant = row.newton;
        contenders.push(Timing {
            row,
            n,
            run: Run::new(case, &session.device)?,
            failure: None,
            numbers: Numbers::new(),
        });
    }
    // The first step costs more than the others: extrapolation needs some of those.
    let goes_on = |timing: &Timing| {
        let seconds = timing::seconds(&timing.run);
        let more = seconds.len() < 3 || seconds.iter().sum::<f64>() < budget;
        timing.failure.is_none() && seconds.len() < STEPS && more
    };
    session.phase(format!("n = {n}"), |stage| {
        stage.bar.set_length((VARIANTS.len() * STEPS) as u64);
        // In turns, so that whatever else the machine does burdens all alike.
        while contenders.iter().any(goes_on) {
            for timing in contenders.iter_mut().filter(|timing| goes_on(timing)) {
                stage.bar.inc(1);
                match timing.run.step() {
                    Err(engine::Error::Step { source, .. })
                        if matches!(*source, solver::Error::NotConverged { .. }) =>
                    {
                        timing.failure = Some(source.to_string());
                    }
                    other => other.map(drop)?,
                }
            }
        }
        Ok(())
    })?;
    // The first row is that of the hybrid scheme.
    let hybrid = timing::seconds(&contenders[0].run);
    for timing in &mut contenders {
        timing.numbers = timing.numbers(&hybrid, &session.device);
    }
    Ok(contenders)
}

/// Seconds of the steps that were not measured: those of the hybrid scheme, times the ratio of both over the later half of the measured ones. Steps
/// become cheaper as corners smooth out, so that the later ones say most about what is to come.
fn seconds_left(seconds: &[f64], hybrid: &[f64]) -> f64 {
    let sum = |seconds: &[f64]| seconds.iter().sum::<f64>();
    // Where not all of its steps are measured either, steps are taken to be alike.
    let profile = if hybrid.len() == STEPS {
        hybrid
    } else {
        &[1.0; STEPS]
    };
    let (count, late) = (seconds.len(), seconds.len() / 2..seconds.len());
    let ratio = sum(&seconds[late.clone()]) / sum(&profile[late]).max(f64::MIN_POSITIVE);
    ratio * sum(&profile[count..])
}

impl Timing {
    /// Time and work, with the time of all steps in seconds: measured, and for the rest [extrapolated](seconds_left).
    fn numbers(&self, hybrid: &[f64], device: &ComputeDevice) -> Numbers {
        let mut numbers = timing::numbers(&self.run, device);
        let seconds = timing::seconds(&self.run);
        let (count, measured) = (seconds.len(), seconds.iter().sum::<f64>());
        let inner = self.run.statistics().unwrap_or_default();
        let per_step = |total: usize| total as f64 / count.max(1) as f64;
        numbers.extend([
            ("measured_steps", count as f64),
            ("measured_seconds", measured),
            ("seconds", measured + seconds_left(&seconds, hybrid)),
            ("inner_cg_per_step", per_step(inner.cg)),
            ("factorizations_per_step", per_step(inner.factorizations)),
        ]);
        numbers
    }

    fn usable(&self) -> bool {
        self.failure.is_none() && self.run.steps() > 1
    }

    fn seconds(&self) -> Option<f64> {
        self.usable().then(|| self.numbers["seconds"])
    }

    fn papers_seconds(&self) -> Option<f64> {
        let column = [256, 512].iter().position(|&n| n == self.n)?;
        self.row.papers_seconds.map(|seconds| seconds[column])
    }

    fn measured(&self) -> String {
        let steps = self.run.steps();
        match &self.failure {
            Some(reason) => format!("stopped after {steps} steps: {reason}"),
            None if steps < STEPS => format!("extrapolated from {steps} steps"),
            None => "all steps".to_owned(),
        }
    }

    /// Time of all steps, and of those measured by both, over that of the hybrid scheme.
    fn over_hybrid(&self, all: &[Self]) -> Option<[f64; 2]> {
        let hybrid = (all.iter()).find(|t| t.n == self.n && t.row.key == "hybrid")?;
        let (own, its) = (timing::seconds(&self.run), timing::seconds(&hybrid.run));
        let common = own.len().min(its.len());
        let measured = own[..common].iter().sum::<f64>() / its[..common].iter().sum::<f64>();
        Some([self.seconds()? / hybrid.seconds()?, measured])
    }
}

/// Seconds over the resolution: solid lines for this machine, dashed ones for the paper.
fn figure(timings: &[Timing], shape: &str) -> Figure {
    let mut curves = Vec::new();
    for (k, row) in VARIANTS.iter().enumerate() {
        let marker = [Marker::Circle, Marker::Square, Marker::Triangle][k % 3];
        let mut curve = |name: String, style, seconds: fn(&Timing) -> Option<f64>| {
            let own = timings.iter().filter(|t| t.row.key == row.key);
            let points = own.filter_map(|t| Some([t.n as f64, seconds(t)?]));
            let curve = Series::new(name, points.collect::<Vec<_>>()).with_style(style);
            curves.push(curve.with_colour(k).with_marker(marker));
        };
        curve(row.label.to_owned(), LineStyle::Solid, Timing::seconds);
        let papers = format!("{} (paper, other machines)", row.label);
        curve(papers, LineStyle::Dashed, Timing::papers_seconds);
    }
    curves.retain(|curve| !curve.points.is_empty());
    let n = Axis::log("cells per unit length n");
    let chart = LineChart::new("", n, Axis::log("seconds for 128 steps")).with_curves(curves);
    Figure::new(format!("Willmore flow of {shape}: wall time"), 1)
        .with_panel(chart)
        .with_shared_legend()
        .with_note(
            "Solid: this machine, one run, long rows extrapolated (see the table). Dashed: the paper's times on an A100 (hybrid) and \
             on 64 cores (finite elements).",
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_that_were_not_measured_follow_the_hybrid_scheme() {
        let hybrid: Vec<f64> = (0..STEPS)
            .map(|step| 1.0 + 9.0 * 0.5_f64.powi(step as i32))
            .collect();
        let dearer: Vec<f64> = hybrid.iter().map(|seconds| 3.0 * seconds).collect();
        let left = seconds_left(&dearer[..10], &hybrid);
        assert!(
            (left / dearer[10..].iter().sum::<f64>() - 1.0).abs() < 1e-12,
            "{left}"
        );
        assert!(seconds_left(&dearer, &hybrid).abs() < 1e-12);
        // Without all of its steps the later ones go on as they were.
        let alike = seconds_left(&[8.0, 2.0, 2.0], &hybrid[..5]);
        assert!((alike - 2.0 * (STEPS - 3) as f64).abs() < 1e-9, "{alike}");
    }
}
