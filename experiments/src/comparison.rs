//! Shapes without a known solution: all methods and resolutions against a finer run.

use std::collections::BTreeMap;
use std::time::Instant;

use clap::Args;
use geometry::contour::{Interpolation, zero_level};
use geometry::shapes::Cross;
use geometry::{Field, Grid, phase_field};
use model::Network;
use report::{
    Axis, Colour, Column, Curve, Figure, Format, LineChart, Manifest, OutputDir, Shapes, Summary,
    Table,
};
use serde::Serialize;
use solver::{FlowParams, NewtonParams, StepRecord};

use crate::Error;
use crate::circles::{EPS, Flow, STEP};
use crate::evolution::{self, Evolution, TimeSteps};
use crate::look;
use crate::method::{self, Method, Scheme};
use crate::networks::{NetworkOptions, convergence_ratios};
use crate::options::{RunOptions, resolutions};

/// The non-convex cross: arms of half length 0.8 and half width 0.27.
///
/// # Errors
/// [`Error::Geometry`] never, for these numbers.
pub fn cross(grid: Grid<2>, eps: f64) -> Result<Field<2>, Error> {
    Ok(phase_field(grid, &Cross::new(0.8, 0.27)?, eps)?)
}

/// A shape and the flow it undergoes.
pub struct Setting {
    /// Name of the program and its folder.
    pub program: &'static str,
    /// Prefix of the metrics.
    pub key: &'static str,
    /// Title of the figures.
    pub title: &'static str,
    /// Name of the shape with its measures.
    pub shape: &'static str,
    /// Its phase field.
    pub initial: fn(Grid<2>, f64) -> Result<Field<2>, Error>,
    /// Which flow.
    pub flow: Flow,
    /// Side of the periodic box.
    pub side: f64,
    /// Time steps of `2^-14`.
    pub steps: usize,
    /// Steps whose shapes are drawn.
    pub shown: &'static [usize],
    /// Steps of the reference per step of the compared runs.
    pub reference_ratio: usize,
    /// Half the width of the window of the shapes.
    pub window: f64,
}

/// Options of the comparisons.
#[derive(Args, Clone, Debug)]
pub struct ComparisonOptions {
    /// Common options.
    #[command(flatten)]
    pub run: RunOptions,

    /// Networks.
    #[command(flatten)]
    pub networks: NetworkOptions,

    /// Cells per unit length, separated by commas [default: 128,256; with --full 128,256,512]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub cells: Vec<usize>,

    /// Methods, separated by commas [default: all; nested finite elements from n = 256 on, where they are stable]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    pub methods: Vec<Method>,

    /// One scheme alone, where it makes a difference: paper, calibrated or accurate [default: all]
    #[arg(long, value_name = "NAME", value_enum)]
    pub scheme: Option<Scheme>,

    /// Cells per unit length of the reference, implicit finite elements [default: twice the finest; paper: 2048]
    #[arg(long, value_name = "N")]
    pub reference_n: Option<usize>,

    /// Add n = 512
    #[arg(long, conflicts_with = "cells")]
    pub full: bool,

    /// Number of time steps [default: the paper's]
    #[arg(long, value_name = "COUNT")]
    pub steps: Option<usize>,
}

type Trajectory = evolution::Trajectory<2>;

#[derive(Serialize)]
struct Parameters<'a> {
    shape: &'a str,
    flow: Flow,
    cells: &'a [usize],
    reference_n: usize,
    reference_steps_per_step: usize,
    side: f64,
    eps: f64,
    time_step: f64,
    steps: usize,
    networks: BTreeMap<String, String>,
    quick: bool,
}

#[derive(Serialize)]
struct ErrorRow {
    n: usize,
    method: Method,
    scheme: Scheme,
    step: usize,
    time: f64,
    l2: f64,
}

#[derive(Serialize)]
struct StepRow {
    n: usize,
    method: Method,
    scheme: Scheme,
    reference: bool,
    step: usize,
    time: f64,
    perimeter: f64,
    area: f64,
    tip: Option<f64>,
    diagonal: Option<f64>,
    energy: Option<f64>,
    energy_before: Option<f64>,
    willmore_energy: Option<f64>,
    exit: Option<solver::Exit>,
    newton: Option<usize>,
    hvp: Option<f64>,
    negative_curvature: Option<usize>,
    seconds: Option<f64>,
}

/// Everything a comparison computed.
struct Comparison<'a> {
    setting: &'a Setting,
    options: &'a ComparisonOptions,
    steps: usize,
    cells: Vec<usize>,
    runs: Vec<Trajectory>,
    reference: Trajectory,
    /// The reference at half its resolution, to estimate its error.
    half: Option<Trajectory>,
}

/// Runs a comparison and writes everything.
///
/// # Errors
/// Bad options before anything is written; what the runs raise.
pub fn run(setting: &Setting, options: &ComparisonOptions) -> Result<(), Error> {
    let cells = resolutions(&options.cells, options.run.quick, options.full);
    let finest = cells.iter().copied().max().unwrap_or(0);
    let default = if options.run.quick {
        finest
    } else {
        2 * finest
    };
    let reference_n = options.reference_n.unwrap_or(default);
    for &n in &cells {
        if !reference_n.is_multiple_of(n) {
            return Err(Error::Options(format!(
                "--reference-n {reference_n} must be a multiple of every n compared with it, also of {n}"
            )));
        }
    }
    let steps = options
        .steps
        .unwrap_or(if options.run.quick { 2 } else { setting.steps });
    if steps == 0 {
        return Err(Error::Options("--steps must be at least 1".to_owned()));
    }
    let device = options.run.open_device()?;
    let plan = plan(setting, options, &cells, steps);
    let learned: Vec<usize> = plan
        .iter()
        .filter(|e| e.method.is_learned())
        .map(|e| e.n)
        .collect();
    let ratios = learned
        .iter()
        .map(|&n| convergence_ratios(n))
        .collect::<Result<Vec<_>, _>>()?;
    let networks = options.networks.find(&ratios)?;
    let network_of = |n: usize| (learned.iter().position(|&m| m == n)).map(|k| &networks[k]);
    let output = options.run.open_output(setting.program)?;
    let parameters = Parameters {
        shape: setting.shape,
        flow: setting.flow,
        cells: &cells,
        reference_n,
        reference_steps_per_step: setting.reference_ratio,
        side: setting.side,
        eps: EPS,
        time_step: STEP,
        steps,
        networks: learned
            .iter()
            .zip(&networks)
            .map(|(n, network)| (format!("n{n}"), crate::networks::checksum(network)))
            .collect(),
        quick: options.run.quick,
    };
    let mut manifest = options
        .run
        .manifest(setting.program, &parameters, &device)?;
    let progress = options.run.progress();
    let store = output.subfolder("fields")?;
    let clock = Instant::now();
    let execute = |manifest: &mut Manifest, evolution: &Evolution<2>, what: &str| {
        let title = format!("{what}{}, n = {}", label(evolution), evolution.n);
        let bar = progress.bar(title.clone(), evolution.steps as u64);
        let network: Option<&Network> = network_of(evolution.n);
        let trajectory = manifest.phase(title, || {
            evolution.run(&setting.initial, network, &device, &store, &bar)
        });
        bar.finish();
        trajectory
    };
    let runs = plan
        .iter()
        .map(|evolution| execute(&mut manifest, evolution, ""))
        .collect::<Result<Vec<_>, _>>()?;
    let fine = reference(setting, reference_n, steps);
    let reference_run = execute(&mut manifest, &fine, "reference: ")?;
    // The error of the reference is estimated from the same run at half the resolution.
    let half = if reference_n.is_multiple_of(2) && finest <= reference_n / 2 {
        let half = reference(setting, reference_n / 2, steps);
        Some(execute(
            &mut manifest,
            &half,
            "for the reference's error: ",
        )?)
    } else {
        None
    };
    let comparison = Comparison {
        setting,
        options,
        steps,
        cells,
        runs,
        reference: reference_run,
        half,
    };
    comparison.write(&output, clock.elapsed().as_secs_f64())?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\n{}\nResults are in {}",
        options.run.title(setting.title),
        comparison.table()?.to_markdown(),
        comparison.about_the_reference()?,
        output.as_path().display()
    ));
    Ok(())
}

fn evolution(
    setting: &Setting,
    (method, scheme): (Method, Scheme),
    n: usize,
    (steps, ratio): (usize, usize),
) -> Evolution<2> {
    let tau = STEP / ratio as f64;
    Evolution {
        shape: setting.shape.to_owned(),
        flow: setting.flow,
        method,
        scheme,
        n,
        side: setting.side,
        centre: 0.0,
        params: FlowParams {
            eps: EPS,
            mcf_step: if setting.flow == Flow::MeanCurvature {
                tau
            } else {
                STEP
            },
            newton: NewtonParams::default(),
            calibration: solver::Factors::PAPER,
        },
        tau: TimeSteps::Constant(tau),
        division: None,
        still: None,
        region: None,
        sample_every: 8 * ratio,
        also_sample: [1, 2, 4].map(|k| k * ratio).to_vec(),
        steps: steps * ratio,
        pause_after: None,
    }
}

fn plan(
    setting: &Setting,
    options: &ComparisonOptions,
    cells: &[usize],
    steps: usize,
) -> Vec<Evolution<2>> {
    let mut runs = Vec::new();
    for method in Method::ALL {
        for &n in cells {
            // Franken, Rumpf and Wirth: for eps = 2h the nested scheme is unstable.
            let stable =
                method.is_learned() || setting.flow == Flow::MeanCurvature || n as f64 * EPS >= 4.0;
            let chosen = if options.methods.is_empty() {
                stable
            } else {
                options.methods.contains(&method)
            };
            if !chosen {
                continue;
            }
            for scheme in method.chosen_schemes(setting.flow, options.scheme) {
                runs.push(evolution(setting, (method, scheme), n, (steps, 1)));
            }
        }
    }
    runs
}

/// The paper's references are implicit finite elements.
fn reference(setting: &Setting, n: usize, steps: usize) -> Evolution<2> {
    evolution(
        setting,
        (Method::FeImplicit, Scheme::Paper),
        n,
        (steps, setting.reference_ratio),
    )
}

fn label(evolution: &Evolution<2>) -> String {
    evolution.method.label_in(evolution.scheme)
}

fn variant(run: &Trajectory) -> (Method, Scheme) {
    (run.evolution.method, run.evolution.scheme)
}

impl Comparison<'_> {
    fn sampled(&self) -> Vec<usize> {
        let any = (Method::Hybrid, Scheme::Paper);
        evolution(self.setting, any, self.cells[0], (self.steps, 1)).sampled_steps()
    }

    fn shown(&self) -> Vec<usize> {
        let sampled = self.sampled();
        let mut shown: Vec<usize> = self.setting.shown.to_vec();
        shown.retain(|k| sampled.contains(k));
        if !shown.contains(&self.steps) {
            shown.push(self.steps);
        }
        shown
    }

    fn time(step: usize) -> f64 {
        step as f64 * STEP
    }

    fn is_reference_run(&self, run: &Trajectory) -> bool {
        run.evolution == self.reference.evolution
    }

    fn errors(&self, run: &Trajectory) -> Result<Vec<(usize, f64)>, Error> {
        self.sampled()
            .into_iter()
            .map(|k| Ok((k, run.distance(&self.reference, k)?)))
            .collect()
    }

    /// Largest distance over time between the reference and the same method at half the resolution.
    fn reference_difference(&self) -> Result<Option<f64>, Error> {
        let Some(half) = &self.half else {
            return Ok(None);
        };
        let distances = half
            .evolution
            .sampled_steps()
            .into_iter()
            .map(|step| half.distance(&self.reference, step))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Some(distances.into_iter().fold(0.0, f64::max)))
    }

    fn about_the_reference(&self) -> Result<String, Error> {
        let n = self.reference.evolution.n;
        let ratio = self.setting.reference_ratio;
        let step = match self.setting.flow {
            Flow::MeanCurvature if ratio > 1 => format!(", {ratio} steps for each"),
            _ => String::new(),
        };
        let estimate = match self.reference_difference()? {
            Some(distance) => format!(
                "; it differs from n = {} by at most {distance:.1e}, so its own error in h is about {:.0e}",
                n / 2,
                distance / 3.0
            ),
            None => String::new(),
        };
        Ok(format!(
            "Reference: implicit finite elements, n = {n}{step}{estimate}."
        ))
    }

    fn write(&self, output: &OutputDir, seconds: f64) -> Result<(), Error> {
        self.error_figure()?.write(output, "errors")?;
        self.shape_figure()?.write(output, "shapes")?;
        self.table()?.write(output, "error_table")?;
        self.summary(seconds)?.write(output)?;
        let mut errors = Vec::new();
        for run in &self.runs {
            for (step, l2) in self.errors(run)? {
                errors.push(ErrorRow {
                    n: run.evolution.n,
                    method: run.evolution.method,
                    scheme: run.evolution.scheme,
                    step,
                    time: Self::time(step),
                    l2,
                });
            }
        }
        output.write("errors.csv", report::data::to_csv(&errors)?)?;
        output.write("errors.json", report::data::to_json(&errors)?)?;
        let reference = std::iter::once(&self.reference).chain(&self.half);
        let rows: Vec<StepRow> = self
            .runs
            .iter()
            .flat_map(|run| step_rows(run, false))
            .chain(reference.flat_map(|run| step_rows(run, true)))
            .collect();
        output.write("steps.csv", report::data::to_csv(&rows)?)?;
        Ok(())
    }

    /// Methods and schemes that ran, in the order of legends.
    fn variants(&self) -> impl Iterator<Item = (Method, Scheme)> {
        method::variants(|wanted| self.runs.iter().any(|run| variant(run) == wanted))
    }

    fn error_figure(&self) -> Result<Figure, Error> {
        let mut chart = LineChart::new("", Axis::linear("time t"), Axis::log("L² error"));
        for run in &self.runs {
            if self.is_reference_run(run) {
                continue;
            }
            let Evolution {
                n, method, scheme, ..
            } = run.evolution;
            let points: Vec<[f64; 2]> = self
                .errors(run)?
                .into_iter()
                .map(|(k, l2)| [Self::time(k), l2])
                .collect();
            let curve = look::curve(points, (method, scheme), (n, &self.cells));
            chart = chart.with_series(curve);
        }
        chart = look::legend(chart, self.variants(), &self.cells);
        let title = format!("{}: error over time", self.setting.title);
        Ok(Figure::new(self.options.run.title(&title), 1)
            .with_panel(chart)
            .with_shared_legend()
            .with_note(format!(
                "ε = 2⁻⁶, time step 2⁻¹⁴. {}",
                self.about_the_reference()?
            )))
    }

    /// Rows: methods at their finest resolution, and the reference; columns: times.
    fn shape_figure(&self) -> Result<Figure, Error> {
        let shown = self.shown();
        let mut rows: Vec<(&Trajectory, String)> = Vec::new();
        for (method, scheme) in self.variants() {
            let finest = self
                .runs
                .iter()
                .filter(|run| variant(run) == (method, scheme) && !self.is_reference_run(run))
                .max_by_key(|run| run.evolution.n);
            if let Some(run) = finest {
                let label = method.label_in(scheme).replace(", ", "\n");
                rows.push((run, format!("{label}\nn = {}", run.evolution.n)));
            }
        }
        let reference = &self.reference;
        rows.push((
            reference,
            format!("reference\nn = {}", reference.evolution.n),
        ));
        let window = [-self.setting.window, self.setting.window];
        let title = format!("{}: shapes", self.setting.title);
        let mut figure = Figure::new(self.options.run.title(&title), shown.len())
            .with_column_labels(shown.iter().map(|&k| format!("t = {}", time_label(k))))
            .with_row_labels(rows.iter().map(|(_, label)| label.clone()));
        let loops = |run: &Trajectory, step: usize| -> Result<Vec<Vec<[f64; 2]>>, Error> {
            let ratio = (STEP / run.evolution.tau.size(1)).round() as usize;
            let curves = zero_level(&run.field(step * ratio)?, Interpolation::Profile);
            Ok(curves.into_iter().map(|curve| curve.points).collect())
        };
        for (run, _) in &rows {
            for &step in &shown {
                let curve = Curve::new(loops(run, step)?).filled(Colour::LightGrey);
                let mut panel = Shapes::new("")
                    .with_curve(curve)
                    .with_window(window, window);
                if !self.is_reference_run(run) {
                    let reference = Curve::new(loops(reference, step)?)
                        .with_colour(1)
                        .with_width(1.0);
                    panel = panel.with_curve(reference);
                }
                figure = figure.with_panel(panel);
            }
        }
        Ok(figure.with_note(format!(
            "Orange: the reference. {}",
            self.about_the_reference()?
        )))
    }

    fn table(&self) -> Result<Table, Error> {
        let shown: Vec<usize> = self.shown().into_iter().filter(|k| *k > 0).collect();
        let head = [
            Column::text("method"),
            Column::number("n", Format::Shortest),
        ];
        let errors = shown
            .iter()
            .map(|k| Column::number(format!("error, step {k}"), Format::Fixed(5)));
        let tail = [
            Column::number("HVP/step", Format::Fixed(1)),
            Column::number("s/step", Format::Fixed(2)),
        ];
        let mut table = Table::new(head.into_iter().chain(errors).chain(tail));
        for run in &self.runs {
            let n = run.evolution.n;
            let reference = self.is_reference_run(run);
            let errors = self.errors(run)?;
            let errors = shown.iter().map(|k| {
                let found = errors.iter().find(|(step, _)| step == k);
                found.filter(|_| !reference).map(|(_, l2)| *l2).into()
            });
            let count = run.records.len() as f64;
            let hvp =
                (count > 0.0).then(|| run.records.iter().map(StepRecord::hvp).sum::<f64>() / count);
            let seconds = run.seconds / run.evolution.steps as f64;
            table.push(
                [label(&run.evolution).into(), n.into()]
                    .into_iter()
                    .chain(errors)
                    .chain([hvp.into(), seconds.into()]),
            )?;
        }
        Ok(table)
    }

    fn summary(&self, seconds: f64) -> Result<Summary, Error> {
        let mut summary = Summary::new();
        for run in &self.runs {
            let Evolution {
                n, method, scheme, ..
            } = run.evolution;
            let key = format!("{}.n{n}.{}", self.setting.key, method.key_in(scheme));
            if !self.is_reference_run(run) {
                for (step, l2) in self.errors(run)? {
                    summary.insert(&format!("{key}.l2.step{step}"), l2)?;
                }
            }
            for (step, m) in run.measures.iter().enumerate() {
                summary.insert(&format!("{key}.area.step{step}"), m.volume)?;
                summary.insert(&format!("{key}.perimeter.step{step}"), m.perimeter)?;
                for (what, value) in [("tip", m.tip), ("diagonal", m.diagonal)] {
                    if let Some(value) = value {
                        summary.insert(&format!("{key}.{what}.step{step}"), value)?;
                    }
                }
            }
            for r in &run.records {
                summary.insert(&format!("{key}.energy.step{}", r.step), r.energy)?;
            }
            let count = run.records.len();
            if count > 0 {
                let mean = |f: &dyn Fn(&StepRecord) -> f64| {
                    run.records.iter().map(f).sum::<f64>() / count as f64
                };
                summary.insert(&format!("{key}.hvp_per_step"), mean(&StepRecord::hvp))?;
                summary.insert(
                    &format!("{key}.newton_per_step"),
                    mean(&|r| r.newton.newton as f64),
                )?;
                let rises = run.records.iter().filter(|r| r.energy > r.energy_before);
                summary.insert_count(&format!("{key}.energy_increases"), rises.count())?;
            }
            summary.insert(&format!("{key}.seconds"), run.seconds)?;
        }
        let key = format!("{}.reference", self.setting.key);
        summary.insert_count(&format!("{key}.n"), self.reference.evolution.n)?;
        summary.insert(&format!("{key}.seconds"), self.reference.seconds)?;
        if let Some(distance) = self.reference_difference()? {
            summary.insert(&format!("{key}.l2_to_half_n"), distance)?;
        }
        summary.insert("seconds", seconds)?;
        Ok(summary)
    }
}

fn step_rows(run: &Trajectory, reference: bool) -> Vec<StepRow> {
    let e = &run.evolution;
    run.measures
        .iter()
        .enumerate()
        .map(|(step, m)| {
            let record = step.checked_sub(1).and_then(|k| run.records.get(k));
            StepRow {
                n: e.n,
                method: e.method,
                scheme: e.scheme,
                reference,
                step,
                time: e.tau.time(step),
                perimeter: m.perimeter,
                area: m.volume,
                tip: m.tip,
                diagonal: m.diagonal,
                energy: record.map(|r| r.energy),
                energy_before: record.map(|r| r.energy_before),
                willmore_energy: record.map(|r| r.willmore_energy),
                exit: record.map(|r| r.newton.exit),
                newton: record.map(|r| r.newton.newton),
                hvp: record.map(StepRecord::hvp),
                negative_curvature: record.map(|r| r.newton.negative_curvature),
                seconds: record.map(|r| r.seconds),
            }
        })
        .collect()
}

/// A multiple of `2^-14` as the paper writes it: `0`, `2⁻⁹`, `3·2⁻⁹`.
fn time_label(step: usize) -> String {
    if step == 0 {
        return "0".to_owned();
    }
    let power = step.trailing_zeros();
    let superscript: String = (14 - i64::from(power))
        .to_string()
        .chars()
        .filter_map(|c| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(c.to_digit(10)? as usize))
        .collect();
    match step >> power {
        1 => format!("2⁻{superscript}"),
        factor => format!("{factor}·2⁻{superscript}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_as_in_the_paper() {
        let labels: Vec<String> = [0, 1, 32, 64, 96, 128].map(time_label).into();
        assert_eq!(labels, ["0", "2⁻¹⁴", "2⁻⁹", "2⁻⁸", "3·2⁻⁹", "2⁻⁷"]);
    }

    #[test]
    fn the_cross_is_the_documented_one() {
        let grid = Grid::<2>::per_unit(64, 2.0).unwrap();
        let field = cross(grid, EPS).unwrap();
        let area = geometry::measure::zero_set_volume(&field);
        let exact = 2.0 * 1.6 * 0.54 - 0.54 * 0.54;
        assert!((area - exact).abs() < 2e-3, "{area} {exact}");
    }
}
