//! Convergence test on circles: mean curvature flow and Willmore flow against the exact solutions.

use std::process::ExitCode;

use clap::Parser;
use engine::{Flow, Method};
use experiments::circles::{self, Circle, Ensemble};
use experiments::networks::{EPS, NetworkOptions, STEP, convergence_ratios};
use experiments::session::Session;
use experiments::steps::{self, Rows};
use experiments::study::{Study, StudyOptions, Variant};
use experiments::training::{NetworkSpec, Trainer, training_device};
use experiments::{Error, harness, look};
use model::training::levenberg_marquardt::LmParams;
use operators::ComputeDevice;
use report::{
    Axis, Cell, Figure, Format, LineChart, Marker, OutputDir, Series, Summary, Table, Tabulated,
};
use runs::Cache;
use serde_json::json;
use solver::StepRecord;

const PROGRAM: &str = "circle_convergence";
/// Steps at which tables and summaries give the error.
const SHOWN_STEPS: [usize; 5] = [1, 8, 16, 32, 64];

/// Mean curvature flow by all methods and Willmore flow by the learned operator (with --full by all) of 30 circles, eps = 2^-6, 64
/// steps of 2^-14: L2 distance to the exact solution over time, mean over the radii 0.05 pi + 0.15 pi i/30.
///
/// An interrupted run continues with the circles that are missing.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    study: StudyOptions,

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

impl Options {
    /// All curves of the figures. Nested finite elements take hours; everything else together some minutes.
    fn variants(&self) -> Vec<Variant> {
        let limit = self.elements_up_to.unwrap_or(usize::MAX);
        let usual = |method: Method, _| method.is_learned() || self.study.full;
        let mut willmore = self.study.variants(Flow::Willmore, usual);
        willmore.retain(|variant| variant.method.is_learned() || variant.n <= limit);
        let mut variants = self.study.variants(Flow::MeanCurvature, |_, _| true);
        variants.extend(willmore);
        variants
    }
}

fn main() -> ExitCode {
    harness::main(program)
}

fn program(options: &Options) -> Result<(), Error> {
    let run = &options.study.run;
    let (all, steps) = if run.quick {
        (4, 8)
    } else {
        (circles::COUNT, circles::STEPS)
    };
    let count = options.circles.unwrap_or(all);
    if !(1..=circles::COUNT).contains(&count) {
        let message = format!(
            "--circles must be from 1 to {}, not {count}",
            circles::COUNT
        );
        return Err(Error::Options(message));
    }
    let (variants, device) = (options.variants(), run.open_device()?);
    let study = if options.retrain {
        Study::new(&retrained(options, &variants, &device)?, &variants)?
    } else {
        Study::new(&options.study.networks, &variants)?
    };
    let parameters = json!({
        "cells": study.cells,
        "runs": study.variants().collect::<Vec<_>>(),
        "circles": count,
        "steps": steps,
        "eps": EPS,
        "time_step": STEP,
        "networks": study.checksums(),
        "retrained": options.retrain,
    });
    let mut session = Session::open(PROGRAM, run, device, parameters)?;
    let finished = Cache::open(session.output.as_path().join("partial"))?;
    let mut ensembles = Vec::new();
    for planned in &study.plan {
        let Variant { flow, n, .. } = planned.0;
        let title = format!("{}, {}, n = {n}", flow.title(), planned.0.label());
        let bar = session.progress.bar(title.clone(), (count * steps) as u64);
        let device = session.device.clone();
        ensembles.push(session.phase(title, || {
            Ensemble::run(planned, (count, steps), &device, &finished, &bar)
        })?);
        bar.finish();
    }
    let report = Report {
        study,
        ensembles,
        steps,
    };
    report.figures(&session)?;
    report.data(&session.output)?;
    session.table(report.table(), "errors")?;
    report.summarize(&mut session.summary)?;
    finished.remove()?;
    session.finish("Mean L2 distance to the exact solution")
}

/// Trains the networks of all resolutions, and says where they are.
fn retrained(
    options: &Options,
    variants: &[Variant],
    device: &ComputeDevice,
) -> Result<NetworkOptions, Error> {
    let run = &options.study.run;
    let mut cells = options.study.cells();
    cells.retain(|n| variants.iter().any(|v| v.method.is_learned() && v.n == *n));
    if cells.is_empty() {
        return Err(model::Error::NetworkNotNeeded.into());
    }
    let (device, output) = (training_device(device)?, run.open_output(PROGRAM)?);
    let (folder, progress) = (output.subfolder("networks")?, run.progress());
    let trainer = Trainer::open(run, &device, &output, &progress, false)?;
    let mut network = Vec::new();
    for n in cells {
        let ratios = convergence_ratios(n)?;
        let spec = NetworkSpec::new(format!("n{n}"), ratios, n);
        let trained = trainer.train(&spec, "lm", &LmParams::new(run.quick))?;
        let path = folder.path(&ratios.file_name())?;
        trained.network.save(&path)?;
        network.push(path);
    }
    trainer.checkpoints.remove()?;
    Ok(NetworkOptions { network })
}

/// Turns the ensembles into files.
struct Report {
    study: Study,
    ensembles: Vec<Ensemble>,
    steps: usize,
}

fn time(step: usize) -> f64 {
    step as f64 * STEP
}

impl Report {
    fn of_flow(&self, flow: Flow) -> impl Iterator<Item = &Ensemble> {
        (self.ensembles.iter()).filter(move |e| e.variant.flow == flow)
    }

    fn shown_steps(&self) -> impl Iterator<Item = usize> {
        SHOWN_STEPS.into_iter().filter(|&k| k <= self.steps)
    }

    /// The way of the exact solution, at the finest resolution.
    fn scale(&self, flow: Flow) -> Option<f64> {
        (self.of_flow(flow).last()).map(|e| e.mean(|circle| circle.travelled))
    }

    /// A chart for each flow with a curve for each variant.
    fn flows(&self, x: &str, y: &str, curve: impl Fn(&Ensemble) -> Series) -> [LineChart; 2] {
        Flow::ALL.map(|flow| {
            let chart = LineChart::new(flow.title(), Axis::linear(x), Axis::log(y));
            self.study.chart(chart, self.of_flow(flow).map(&curve))
        })
    }

    fn figures(&self, session: &Session<'_>) -> Result<(), Error> {
        let last = time(self.steps);
        let over_time = "Error on circles over time".to_owned();
        let over_radius = format!("Error on circles at t = {last:.4} over the radius");
        let work = "Work per step of Willmore flow, mean over the circles".to_owned();
        for (title, charts, stem) in [
            (over_time, self.over_time(), "convergence"),
            (over_radius, self.over_radius(), "error_over_radius"),
            (work, self.work(), "work_per_step"),
        ] {
            let mut figure = Figure::new(title, 2).with_panels(charts);
            figure.note = (stem == "convergence").then(|| self.circles());
            session.figure(figure.with_shared_legend(), stem)?;
        }
        session.figure(self.cost(), "error_over_cost")
    }

    fn circles(&self) -> String {
        let radii: Vec<f64> = self.ensembles[0].circles.iter().map(|c| c.radius).collect();
        let (count, first, last) = (radii.len(), radii[0], radii[radii.len() - 1]);
        format!(
            "ε = 2⁻⁶, τ = 2⁻¹⁴, h = 1/n; mean over {count} circles with radii between {first:.3} and {last:.3}."
        )
    }

    fn over_time(&self) -> [LineChart; 2] {
        let mut charts = self.flows("time t", "mean L² error", |e| {
            let points = (0..=self.steps).map(|k| [time(k), e.mean_error(k)]);
            self.study.series(e.variant, points.collect())
        });
        for (chart, flow) in charts.iter_mut().zip(Flow::ALL) {
            let end = time(self.steps);
            chart.note = self.scale(flow).map(|scale| {
                format!("For scale: mean ‖u(t) − u(0)‖ = {scale:.3} at t = {end:.4}.")
            });
        }
        charts
    }

    fn over_radius(&self) -> [LineChart; 2] {
        self.flows("initial radius r", "L² error", |e| {
            let points = e.circles.iter().map(|c| [c.radius, c.error(self.steps)]);
            let curve = self.study.series(e.variant, points.collect());
            let marker = look::marker(e.variant.n, &self.study.cells);
            curve.with_marker(marker).with_width(1.6)
        })
    }

    /// Work of each step.
    fn work(&self) -> [LineChart; 2] {
        let counts: [(&str, fn(&StepRecord) -> f64); 2] = [
            ("Hessian-vector products", StepRecord::hvp),
            ("Newton steps", |r| r.newton.newton as f64),
        ];
        counts.map(|(label, count)| {
            let mut highest = 1.0_f64;
            let curves = self.of_flow(Flow::Willmore).map(|e| {
                let of = |circle: &Circle, k: usize| {
                    circle.records[k].minimization.as_ref().map_or(0.0, count)
                };
                let points = (0..self.steps).map(|k| [time(k + 1), e.mean(|circle| of(circle, k))]);
                let points: Vec<[f64; 2]> = points.collect();
                highest = points.iter().map(|point| point[1]).fold(highest, f64::max);
                self.study.series(e.variant, points).with_width(1.8)
            });
            let curves: Vec<Series> = curves.collect();
            let y = Axis::linear(label).with_range(0.0, 1.1 * highest);
            self.study
                .chart(LineChart::new("", Axis::linear("time t"), y), curves)
        })
    }

    /// Error at the end over the mean wall time of a circle, a curve for each method and scheme.
    fn cost(&self) -> Figure {
        let (steps, variant) = (self.steps, |e: &Ensemble| {
            (e.variant.method, e.variant.scheme)
        });
        let axes = (
            Axis::log("wall time per circle [s]"),
            Axis::log(format!("mean L² error at t = {:.4}", time(steps))),
        );
        let shown =
            look::variants(|wanted| self.of_flow(Flow::Willmore).any(|e| variant(e) == wanted));
        let curves = shown.map(|wanted| {
            let own: Vec<&Ensemble> = (self.of_flow(Flow::Willmore))
                .filter(|e| variant(e) == wanted)
                .collect();
            let cells: Vec<String> = own.iter().map(|e| e.variant.n.to_string()).collect();
            let name = format!("{}, n = {}", own[0].variant.label(), cells.join(", "));
            let point = |e: &Ensemble| [e.seconds_per_step() * steps as f64, e.mean_error(steps)];
            Series::of(name, own, point)
                .with_colour(look::colour(wanted.0, wanted.1))
                .with_marker(Marker::Circle)
        });
        Figure::new("Willmore flow of circles: accuracy against cost", 1)
            .with_panel(LineChart::new("", axes.0, axes.1).with_curves(curves))
            .with_shared_legend()
            .with_note(format!(
                "{steps} time steps; mean over {} circles, each on one core.",
                self.ensembles[0].circles.len()
            ))
    }

    fn data(&self, output: &OutputDir) -> Result<(), Error> {
        let table = |columns: &[&'static str]| Table::data(Variant::COLUMNS.iter().chain(columns));
        let mut curves = table(&["step", "time", "l2_mean", "l2_min", "l2_max"]);
        let mut circles = table(&["radius", "step", "time", "l2"]);
        let mut runs = Vec::new();
        for e in &self.ensembles {
            for k in 0..=self.steps {
                let [least, most] = e.error_range(k);
                let errors = [time(k), e.mean_error(k), least, most].map(Cell::from);
                let row = e.variant.cells().into_iter().chain([k.into()]);
                curves.push(row.chain(errors))?;
            }
            for circle in &e.circles {
                for k in self.shown_steps() {
                    let errors = [time(k), circle.error(k)].map(Cell::from);
                    let row = (e.variant.cells().into_iter()).chain([circle.radius.into()]);
                    circles.push(row.chain([k.into()]).chain(errors))?;
                }
            }
            if e.variant.flow == Flow::Willmore {
                runs.extend(e.circles.iter().map(|circle| Rows {
                    leading: [&e.variant.cells()[1..], &[circle.radius.into()]].concat(),
                    start: None,
                    records: &circle.records,
                }));
            }
        }
        let steps = steps::table(&[&Variant::COLUMNS[1..], &["radius"]].concat(), &runs)?;
        output.write("curves.json", curves.to_json()?)?;
        output.write("steps.json", steps.to_json()?)?;
        for (name, table) in [("curves", curves), ("circles", circles), ("steps", steps)] {
            output.write(&format!("{name}.csv"), table.to_csv()?)?;
        }
        Ok(())
    }

    fn table(&self) -> Tabulated<'_, Ensemble> {
        let mut table = Table::of(&self.ensembles)
            .text("flow", |e| e.variant.flow.title())
            .number("n", Format::Shortest, |e| e.variant.n)
            .text("method", |e| e.variant.label());
        for k in self.shown_steps() {
            table = table.number(format!("step {k}"), Format::Fixed(5), |e| e.mean_error(k));
        }
        let hvp = |e: &Ensemble| e.mean_of_steps(StepRecord::hvp);
        table.number("HVP/step", Format::Fixed(1), hvp)
    }

    fn summarize(&self, summary: &mut Summary) -> Result<(), Error> {
        for e in &self.ensembles {
            let key = e.key();
            for k in self.shown_steps() {
                summary.insert(&format!("{key}.l2.step{k}"), e.mean_error(k))?;
            }
            if e.variant.flow == Flow::Willmore {
                let per_step = [
                    ("hvp", e.mean_of_steps(StepRecord::hvp)),
                    ("newton", e.mean_of_steps(|r| r.newton.newton as f64)),
                    ("seconds", Some(e.seconds_per_step())),
                ];
                for (what, value) in per_step {
                    summary.insert(&format!("{key}.{what}_per_step"), value.unwrap_or(f64::NAN))?;
                }
                let counts = [
                    ("energy_increases", e.energy_increases()),
                    ("negative_curvature", e.negative_curvature()),
                ];
                for (what, count) in counts {
                    summary.insert_count(&format!("{key}.{what}"), count)?;
                }
            }
        }
        for flow in Flow::ALL {
            if let Some(scale) = self.scale(flow) {
                summary.insert(&format!("{}.scale", flow.key()), scale)?;
            }
        }
        Ok(())
    }
}
