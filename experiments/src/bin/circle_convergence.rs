//! Convergence test on circles: mean curvature flow and Willmore flow against the exact solutions.

use std::collections::BTreeMap;
use std::process::ExitCode;

use clap::Parser;
use experiments::circles::{self, Ensemble, Flow};
use experiments::look;
use experiments::method::{self, Method, Scheme};
use experiments::networks::{NetworkOptions, convergence_ratios};
use experiments::options::{RunOptions, resolutions};
use experiments::partial::Partial;
use experiments::training::{self, NetworkSpec, Trainer};
use experiments::{Error, harness};
use model::training::levenberg_marquardt::LmParams;
use model::{Network, Ratios, pretrained};
use operators::ComputeDevice;
use report::{Axis, Column, Figure, Format, LineChart, Marker, OutputDir, Series, Summary, Table};
use serde::Serialize;

const PROGRAM: &str = "circle_convergence";
/// Steps at which tables and summaries give the error.
const SHOWN_STEPS: [usize; 5] = [1, 8, 16, 32, 64];

/// Mean curvature flow and Willmore flow of 30 circles, eps = 2^-6, 64 steps of 2^-14: L2 distance to the exact
/// solution over time, mean over the radii 0.05 pi + 0.15 pi i/30.
///
/// An interrupted run continues with the circles that are missing.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    /// Add n = 512
    #[arg(long, conflicts_with = "cells")]
    full: bool,

    /// Cells per unit length, separated by commas [default: 128,256]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    cells: Vec<usize>,

    /// Methods, separated by commas [default: all for mean curvature flow, hybrid for Willmore flow; with --full all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    methods: Vec<Method>,

    /// One scheme alone, where it makes a difference: paper, calibrated, or accurate, which is calibrated with the network of
    /// the accurate recipe [default: all]
    #[arg(long, value_name = "NAME", value_enum)]
    scheme: Option<Scheme>,

    /// Leave nested finite elements of Willmore flow out above this resolution; a circle takes minutes at n = 256
    #[arg(long, value_name = "N")]
    elements_up_to: Option<usize>,

    /// Take some of the 30 circles only, evenly chosen
    #[arg(long, value_name = "COUNT")]
    circles: Option<usize>,

    /// Train the networks first, instead of loading them
    #[arg(long, conflicts_with = "network")]
    retrain: bool,
}

#[derive(Serialize)]
struct Parameters {
    cells: Vec<usize>,
    runs: Vec<Run>,
    circles: usize,
    steps: usize,
    eps: f64,
    time_step: f64,
    networks: BTreeMap<String, String>,
    retrained: bool,
    quick: bool,
}

/// One curve of the figures.
#[derive(Serialize, Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    flow: Flow,
    method: Method,
    scheme: Scheme,
    n: usize,
}

impl Run {
    /// Fills in the default methods. Nested finite elements take hours; everything else together some minutes.
    fn list(options: &Options, cells: &[usize]) -> Vec<Self> {
        let mut runs = Vec::new();
        for flow in Flow::ALL {
            for method in Method::ALL {
                let chosen = if options.methods.is_empty() {
                    flow == Flow::MeanCurvature || method == Method::Hybrid || options.full
                } else {
                    options.methods.contains(&method)
                };
                if !chosen {
                    continue;
                }
                let nested = flow == Flow::Willmore && !method.is_learned();
                let limit = options.elements_up_to.filter(|_| nested);
                let affordable = |n: &&usize| limit.is_none_or(|limit| **n <= limit);
                for scheme in method.chosen_schemes(flow, options.scheme) {
                    runs.extend(cells.iter().filter(affordable).map(|&n| Self {
                        flow,
                        method,
                        scheme,
                        n,
                    }));
                }
            }
        }
        runs
    }
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let (all, steps) = if options.run.quick {
        (4, 8)
    } else {
        (circles::COUNT, circles::STEPS)
    };
    let count = options.circles.unwrap_or(all);
    if !(1..=circles::COUNT).contains(&count) {
        return Err(Error::Options(format!(
            "--circles must be from 1 to {}, not {count}",
            circles::COUNT
        )));
    }
    let cells = resolutions(&options.cells, options.run.quick, options.full);
    let runs = Run::list(options, &cells);
    let learned = runs.iter().any(|run| run.method.is_learned());
    if !learned && (options.retrain || !options.networks.network.is_empty()) {
        return Err(Error::Options(
            "no run of these methods needs a network".to_owned(),
        ));
    }
    let trained_for: &[usize] = if learned { &cells } else { &[] };
    let ratios = trained_for
        .iter()
        .map(|&n| convergence_ratios(n))
        .collect::<Result<Vec<_>, _>>()?;
    let device = options.run.open_device()?;
    let loaded = if options.retrain {
        training::training_device(&device)?;
        None
    } else {
        Some(find_networks(options, &ratios)?)
    };
    // Some resolutions have a network of the accurate recipe only.
    let missing = |run: &Run| {
        let k = trained_for.iter().position(|&n| n == run.n);
        let found = loaded
            .as_ref()
            .zip(k)
            .is_none_or(|(all, k)| all[k].is_some());
        run.method.is_learned() && run.scheme != Scheme::Accurate && !found
    };
    let runs: Vec<Run> = runs.into_iter().filter(|run| !missing(run)).collect();
    let output = options.run.open_output(PROGRAM)?;
    let networks = match loaded {
        Some(networks) => networks,
        None => {
            let trained = retrain(options, &cells, &ratios, &device, &output)?;
            trained.into_iter().map(Some).collect()
        }
    };

    let parameters = Parameters {
        networks: cells
            .iter()
            .zip(&networks)
            .filter_map(|(n, network)| {
                let checksum = experiments::networks::checksum(network.as_ref()?);
                Some((format!("n{n}"), checksum))
            })
            .collect(),
        cells: cells.clone(),
        runs: runs.clone(),
        circles: count,
        steps,
        eps: circles::EPS,
        time_step: circles::STEP,
        retrained: options.retrain,
        quick: options.run.quick,
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let partial = Partial::open(&output, "partial")?;
    let progress = options.run.progress();
    let clock = std::time::Instant::now();
    let mut ensembles = Vec::new();
    for &Run {
        flow,
        method,
        scheme,
        n,
    } in &runs
    {
        let network = (trained_for.iter().position(|&m| m == n)).and_then(|k| networks[k].as_ref());
        let title = format!("{}, {}, n = {n}", flow.title(), method.label_in(scheme));
        let bar = progress.bar(title.clone(), (count * steps) as u64);
        let ensemble = manifest.phase(title, || {
            let what = (flow, method, scheme, n);
            let network = network.filter(|_| method.is_learned());
            Ensemble::run(what, (count, steps), network, &device, &partial, &bar)
        })?;
        bar.finish();
        ensembles.push(ensemble);
    }
    let seconds = clock.elapsed().as_secs_f64();

    let report = Report {
        ensembles: &ensembles,
        cells: &cells,
        options: &options.run,
        steps,
    };
    report.figures(&output)?;
    report.data(&output)?;
    let table = report.table()?;
    table.write(&output, "errors")?;
    report.summary(seconds)?.write(&output)?;
    manifest.write(&output)?;
    partial.remove()?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\nResults are in {}",
        options.run.title("Mean L2 distance to the exact solution"),
        table.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

/// The networks of the paper's recipe. One may be missing if the accurate recipe has a network with these ratios.
fn find_networks(options: &Options, ratios: &[Ratios]) -> Result<Vec<Option<Network>>, Error> {
    if !options.networks.network.is_empty() {
        let all = options.networks.find(ratios)?;
        return Ok(all.into_iter().map(Some).collect());
    }
    let find =
        |&wanted: &Ratios| match (pretrained::find(wanted), pretrained::find_accurate(wanted)) {
            (Ok(network), _) => Ok(Some(network)),
            (Err(_), Ok(_)) => Ok(None),
            (Err(error), Err(_)) => Err(error.into()),
        };
    ratios.iter().map(find).collect()
}

fn retrain(
    options: &Options,
    cells: &[usize],
    ratios: &[Ratios],
    device: &ComputeDevice,
    output: &OutputDir,
) -> Result<Vec<Network>, Error> {
    let progress = options.run.progress();
    let checkpoints = Partial::open(output, "checkpoints")?;
    let folder = output.subfolder("networks")?;
    let mut networks = Vec::new();
    let recipe = LmParams::new(options.run.quick);
    let trainer = Trainer {
        device: &training::training_device(device)?,
        checkpoints: &checkpoints,
        progress: &progress,
        seed: options.run.seed,
        quick: options.run.quick,
    };
    for (&n, &ratios) in cells.iter().zip(ratios) {
        let spec = NetworkSpec::new(format!("n{n}"), ratios, n);
        let trained = trainer.train(&spec, "lm", &recipe)?;
        trained
            .network
            .save(&folder.path(&pretrained::file_name(ratios))?)?;
        networks.push(trained.network);
    }
    checkpoints.remove()?;
    Ok(networks)
}

/// Turns the ensembles into files.
struct Report<'a> {
    ensembles: &'a [Ensemble],
    cells: &'a [usize],
    options: &'a RunOptions,
    steps: usize,
}

#[derive(Serialize)]
struct CurveRow {
    flow: Flow,
    n: usize,
    method: Method,
    scheme: Scheme,
    step: usize,
    time: f64,
    l2_mean: f64,
    l2_min: f64,
    l2_max: f64,
}

#[derive(Serialize)]
struct CircleRow {
    flow: Flow,
    n: usize,
    method: Method,
    scheme: Scheme,
    radius: f64,
    step: usize,
    time: f64,
    l2: f64,
}

#[derive(Serialize)]
struct StepRow {
    n: usize,
    method: Method,
    scheme: Scheme,
    radius: f64,
    step: usize,
    time: f64,
    tau: f64,
    energy_before: f64,
    energy: f64,
    willmore_energy: f64,
    perimeter: f64,
    volume: f64,
    exit: solver::Exit,
    newton: usize,
    hvp: f64,
    values: usize,
    gradients: usize,
    negative_curvature: usize,
    estimate: f64,
    seconds: f64,
}

impl Report<'_> {
    fn of_flow(&self, flow: Flow) -> impl Iterator<Item = &Ensemble> {
        self.ensembles.iter().filter(move |e| e.flow == flow)
    }

    fn time(k: usize) -> f64 {
        k as f64 * circles::STEP
    }

    fn series(&self, ensemble: &Ensemble, points: Vec<[f64; 2]>) -> Series {
        let Ensemble {
            method, scheme, n, ..
        } = *ensemble;
        look::curve(points, (method, scheme), (n, self.cells))
    }

    fn legend(&self, chart: LineChart) -> LineChart {
        let shown = |wanted| {
            self.ensembles
                .iter()
                .any(|e| (e.method, e.scheme) == wanted)
        };
        look::legend(chart, method::variants(shown), self.cells)
    }

    fn figures(&self, output: &OutputDir) -> Result<(), Error> {
        let last = Self::time(self.steps);
        let title = |text: &str| self.options.title(text);

        let mut convergence = Figure::new(title("Error on circles over time"), 2);
        for flow in Flow::ALL {
            let mut chart = LineChart::new(
                flow.title(),
                Axis::linear("time t"),
                Axis::log("mean L² error"),
            );
            for ensemble in self.of_flow(flow) {
                let points: Vec<[f64; 2]> = (0..=self.steps)
                    .map(|k| [Self::time(k), ensemble.mean_error(k)])
                    .collect();
                chart = chart.with_series(self.series(ensemble, points));
            }
            if let Some(scale) = self.scale(flow) {
                chart = chart.with_note(format!(
                    "For scale: mean ‖u(t) − u(0)‖ = {scale:.3} at t = {last:.4}."
                ));
            }
            convergence = convergence.with_panel(self.legend(chart));
        }
        let radii = self.ensembles.first().map_or(&[][..], |e| &e.radii);
        let count = radii.len();
        let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = radii.iter().copied().fold(0.0, f64::max);
        convergence
            .with_shared_legend()
            .with_note(format!(
                "ε = 2⁻⁶, τ = 2⁻¹⁴, h = 1/n; mean over {count} circles with radii between {smallest:.3} and {largest:.3}."
            ))
            .write(output, "convergence")?;

        let mut over_radius = Figure::new(
            title(&format!(
                "Error on circles at t = {last:.4} over the radius"
            )),
            2,
        );
        for flow in Flow::ALL {
            let mut chart = LineChart::new(
                flow.title(),
                Axis::linear("initial radius r"),
                Axis::log("L² error"),
            );
            for ensemble in self.of_flow(flow) {
                let points: Vec<[f64; 2]> = ensemble
                    .radii
                    .iter()
                    .zip(&ensemble.results)
                    .map(|(&radius, result)| [radius, result.errors[self.steps]])
                    .collect();
                chart = chart.with_series(
                    self.series(ensemble, points)
                        .with_marker(look::marker(ensemble.n, self.cells))
                        .with_width(1.6),
                );
            }
            over_radius = over_radius.with_panel(self.legend(chart));
        }
        over_radius
            .with_shared_legend()
            .write(output, "error_over_radius")?;

        let mut work = Figure::new(
            title("Work per step of Willmore flow, mean over the circles"),
            2,
        );
        let counts: [(&str, fn(&solver::StepRecord) -> f64); 2] = [
            ("Hessian-vector products", |r| r.hvp()),
            ("Newton steps", |r| r.newton.newton as f64),
        ];
        for (label, count) in counts {
            let mut chart = LineChart::new("", Axis::linear("time t"), Axis::linear(label));
            let mut highest = 0.0_f64;
            for ensemble in self.of_flow(Flow::Willmore) {
                let points: Vec<[f64; 2]> = (0..self.steps)
                    .map(|k| {
                        let mean = ensemble.mean(|result| count(&result.records[k]));
                        [Self::time(k + 1), mean]
                    })
                    .collect();
                highest = points.iter().map(|p| p[1]).fold(highest, f64::max);
                chart = chart.with_series(self.series(ensemble, points).with_width(1.8));
            }
            chart.y = chart.y.with_range(0.0, 1.1 * highest.max(1.0));
            work = work.with_panel(self.legend(chart));
        }
        work.with_shared_legend().write(output, "work_per_step")?;
        self.cost_figure().write(output, "error_over_cost")?;
        Ok(())
    }

    /// Error at the end over the mean wall time of a circle, a curve for each method and scheme.
    fn cost_figure(&self) -> Figure {
        let last = Self::time(self.steps);
        let mut chart = LineChart::new(
            "",
            Axis::log("wall time per circle [s]"),
            Axis::log(format!("mean L² error at t = {last:.4}")),
        );
        let shown = |wanted| (self.of_flow(Flow::Willmore)).any(|e| (e.method, e.scheme) == wanted);
        for (method, scheme) in method::variants(shown) {
            let own = |e: &&Ensemble| (e.method, e.scheme) == (method, scheme);
            let (cells, points): (Vec<String>, Vec<[f64; 2]>) =
                (self.of_flow(Flow::Willmore).filter(own))
                    .map(|e| {
                        let seconds = e.mean_of_records(|r| r.seconds) * e.steps() as f64;
                        (e.n.to_string(), [seconds, e.mean_error(self.steps)])
                    })
                    .unzip();
            let name = format!("{}, n = {}", method.label_in(scheme), cells.join(", "));
            chart = chart.with_series(
                Series::new(name, points)
                    .with_colour(method.colour_in(scheme))
                    .with_marker(Marker::Circle),
            );
        }
        Figure::new(
            self.options
                .title("Willmore flow of circles: accuracy against cost"),
            1,
        )
        .with_panel(chart)
        .with_shared_legend()
        .with_note(format!(
            "{} time steps; mean over {} circles, each on one core.",
            self.steps,
            self.ensembles.first().map_or(0, |e| e.radii.len())
        ))
    }

    /// The scale number of a flow, at the finest resolution.
    fn scale(&self, flow: Flow) -> Option<f64> {
        self.of_flow(flow).last().map(Ensemble::scale)
    }

    fn data(&self, output: &OutputDir) -> Result<(), Error> {
        let mut curves = Vec::new();
        let mut singles = Vec::new();
        let mut steps = Vec::new();
        for e in self.ensembles {
            let (flow, n, method, scheme) = (e.flow, e.n, e.method, e.scheme);
            for step in 0..=self.steps {
                let [l2_min, l2_max] = e.error_range(step);
                curves.push(CurveRow {
                    flow,
                    n,
                    method,
                    scheme,
                    step,
                    time: Self::time(step),
                    l2_mean: e.mean_error(step),
                    l2_min,
                    l2_max,
                });
            }
            for (&radius, result) in e.radii.iter().zip(&e.results) {
                singles.extend(self.shown_steps().map(|step| CircleRow {
                    flow,
                    n,
                    method,
                    scheme,
                    radius,
                    step,
                    time: Self::time(step),
                    l2: result.errors[step],
                }));
            }
            steps.extend(e.records().map(|(radius, r)| StepRow {
                n,
                method,
                scheme,
                radius,
                step: r.step,
                time: r.time,
                tau: r.tau,
                energy_before: r.energy_before,
                energy: r.energy,
                willmore_energy: r.willmore_energy,
                perimeter: r.perimeter,
                volume: r.volume,
                exit: r.newton.exit,
                newton: r.newton.newton,
                hvp: r.hvp(),
                values: r.newton.values,
                gradients: r.newton.gradients,
                negative_curvature: r.newton.negative_curvature,
                estimate: r.newton.estimate,
                seconds: r.seconds,
            }));
        }
        let csv = |name: &str, text: String| output.write(&format!("{name}.csv"), text);
        csv("curves", report::data::to_csv(&curves)?)?;
        csv("circles", report::data::to_csv(&singles)?)?;
        csv("steps", report::data::to_csv(&steps)?)?;
        output.write("curves.json", report::data::to_json(&curves)?)?;
        output.write("steps.json", report::data::to_json(&steps)?)?;
        Ok(())
    }

    fn shown_steps(&self) -> impl Iterator<Item = usize> {
        SHOWN_STEPS.into_iter().filter(|&k| k <= self.steps)
    }

    fn table(&self) -> Result<Table, Error> {
        let head = [
            Column::text("flow"),
            Column::number("n", Format::Shortest),
            Column::text("method"),
        ];
        let errors = self
            .shown_steps()
            .map(|k| Column::number(format!("step {k}"), Format::Fixed(5)));
        let tail = [Column::number("HVP/step", Format::Fixed(1))];
        let mut table = Table::new(head.into_iter().chain(errors).chain(tail));
        for e in self.ensembles {
            let hvp =
                (e.flow == Flow::Willmore).then(|| e.mean_of_records(solver::StepRecord::hvp));
            let head = [e.flow.title().into(), e.n.into(), e.label().into()];
            let errors = self.shown_steps().map(|k| e.mean_error(k).into());
            table.push(head.into_iter().chain(errors).chain([hvp.into()]))?;
        }
        Ok(table)
    }

    fn summary(&self, seconds: f64) -> Result<Summary, Error> {
        let mut summary = Summary::new();
        for e in self.ensembles {
            let key = e.key();
            for k in self.shown_steps() {
                summary.insert(&format!("{key}.l2.step{k}"), e.mean_error(k))?;
            }
            if e.flow == Flow::Willmore {
                let per_step = [
                    ("hvp", e.mean_of_records(solver::StepRecord::hvp)),
                    ("newton", e.mean_of_records(|r| r.newton.newton as f64)),
                    ("seconds", e.mean_of_records(|r| r.seconds)),
                ];
                for (what, value) in per_step {
                    summary.insert(&format!("{key}.{what}_per_step"), value)?;
                }
                summary.insert_count(&format!("{key}.energy_increases"), e.energy_increases())?;
                summary
                    .insert_count(&format!("{key}.negative_curvature"), e.negative_curvature())?;
            }
        }
        for flow in Flow::ALL {
            if let Some(scale) = self.scale(flow) {
                summary.insert(&format!("{}.scale", flow.key()), scale)?;
            }
        }
        summary.insert("seconds", seconds)?;
        Ok(summary)
    }
}
