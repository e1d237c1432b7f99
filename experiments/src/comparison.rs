//! Shapes without a known solution: all methods and resolutions against a finer run.

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser};
use engine::{Flow, Measure, Method, Operator, Samples, Scheme, Trajectory, Values};
use geometry::contour::{Interpolation, zero_level};
use geometry::measure::{perimeter, zero_set_volume};
use geometry::shapes::Cross;
use geometry::{Error as GeometryError, Field, Grid, phase_field};
use report::{Axis, Colour, Curve, Figure, Format, LineChart, OutputDir, Shapes, Summary, Table};
use serde_json::json;
use solver::StepRecord;

use crate::networks::{EPS, STEP};
use crate::session::Session;
use crate::steps::{self, Rows};
use crate::study::{self, Study, StudyOptions, Variant};
use crate::{Error, harness, look};

/// A shape and the flow it undergoes.
pub struct Setting {
    /// Name of the program and its folder, and prefix of the metrics.
    pub program: &'static str,
    /// Title of the figures.
    pub title: &'static str,
    /// What the program does, for its help.
    pub about: &'static str,
    /// Name of the shape with its measures.
    pub shape: &'static str,
    /// Its phase field.
    pub initial: fn(Grid<2>) -> Result<Field<2>, GeometryError>,
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

/// The non-convex cross: arms of half length 0.8 and half width 0.27.
///
/// # Errors
/// [`GeometryError`] never, for these numbers.
pub fn cross(grid: Grid<2>) -> Result<Field<2>, GeometryError> {
    phase_field(grid, &Cross::new(0.8, 0.27)?, EPS)
}

/// The options of a comparison. Runs are kept in the folder `fields` of the output; an interrupted one continues.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    study: StudyOptions,

    /// Cells per unit length of the reference, implicit finite elements [default: twice the finest; paper: 2048]
    #[arg(long, value_name = "N")]
    reference_n: Option<usize>,

    /// Number of time steps [default: the paper's]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,
}

/// The program of a comparison.
pub fn main(setting: &Setting) -> ExitCode {
    let command = Options::command()
        .name(setting.program)
        .about(setting.about);
    let matches = command.get_matches();
    let options = Options::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    harness::run(|| run(setting, &options))
}

/// A run with what it is.
struct Compared {
    variant: Variant,
    trajectory: Trajectory<2>,
}

/// Everything a comparison computed.
struct Comparison<'a> {
    setting: &'a Setting,
    steps: usize,
    study: Study,
    runs: Vec<Compared>,
    reference: Compared,
    /// The reference at half its resolution, to estimate its error.
    half: Option<Compared>,
}

fn run(setting: &Setting, options: &Options) -> Result<(), Error> {
    let (flow, quick, cells) = (setting.flow, options.study.run.quick, options.study.cells());
    let finest = cells.iter().copied().max().unwrap_or(0);
    let reference_n = (options.reference_n).unwrap_or(if quick { finest } else { 2 * finest });
    if let Some(n) = cells.iter().find(|n| !reference_n.is_multiple_of(**n)) {
        return Err(Error::Options(format!(
            "--reference-n {reference_n} must be a multiple of every n compared with it, also of {n}"
        )));
    }
    let steps = options
        .steps
        .unwrap_or(if quick { 2 } else { setting.steps });
    if steps == 0 {
        return Err(Error::Options("--steps must be at least 1".to_owned()));
    }
    let device = options.study.run.open_device()?;
    // Franken, Rumpf and Wirth: for eps = 2h the nested scheme is unstable.
    let stable = |method: Method, n| {
        flow == Flow::MeanCurvature || method.is_learned() || n as f64 * EPS >= 4.0
    };
    let study = Study::new(
        &options.study.networks,
        &options.study.variants(flow, stable),
    )?;
    let parameters = json!({
        "shape": setting.shape,
        "flow": flow,
        "cells": cells,
        "reference_n": reference_n,
        "reference_steps_per_step": setting.reference_ratio,
        "side": setting.side,
        "eps": EPS,
        "time_step": STEP,
        "steps": steps,
        "networks": study.checksums(),
        "quick": quick,
    });
    let mut session = Session::open(setting.program, &options.study.run, device, &parameters)?;
    let mut runs = Vec::new();
    for (variant, operator) in &study.plan {
        runs.push(setting.run(&mut session, "", (*variant, operator), (steps, 1))?);
    }
    // The paper's references are implicit finite elements.
    let mut finer = |what: &str, n: usize| {
        let (method, scheme) = (Method::FeImplicit, Scheme::Paper);
        let operator = study.networks.operator((method, scheme), n)?;
        let variant = Variant {
            flow,
            method,
            scheme,
            n,
        };
        setting.run(
            &mut session,
            what,
            (variant, &operator),
            (steps, setting.reference_ratio),
        )
    };
    let reference = finer("reference: ", reference_n)?;
    // The error of the reference is estimated from the same run at half the resolution.
    let half = reference_n.is_multiple_of(2) && finest <= reference_n / 2;
    let half = half
        .then(|| finer("for the reference's error: ", reference_n / 2))
        .transpose()?;
    Comparison {
        setting,
        steps,
        study,
        runs,
        reference,
        half,
    }
    .write(session)
}

impl Setting {
    fn run(
        &self,
        session: &mut Session<'_>,
        what: &str,
        (variant, operator): (Variant, &Operator),
        (steps, ratio): (usize, usize),
    ) -> Result<Compared, Error> {
        let grid = Grid::<2>::per_unit(variant.n, self.side)?;
        let steps = (STEP / ratio as f64, steps * ratio);
        let mut case = study::case(
            (self.flow, operator),
            self.shape,
            (self.initial)(grid)?,
            steps,
        );
        case.measures = Measure::crossings(0.0);
        case.measures.push(Measure::new("perimeter", |u, _| {
            perimeter(u, EPS).map(Some)
        }));
        case.measures
            .push(Measure::new("area", |u, _| Ok(Some(zero_set_volume(u)))));
        let title = format!("{what}{}, n = {}", variant.label(), variant.n);
        let name = format!("{}-{ratio}", variant.key());
        let trajectory = session.trajectory(&title, case, &name, &samples(ratio))?;
        Ok(Compared {
            variant,
            trajectory,
        })
    }
}

/// The steps whose phase fields are kept and compared.
fn samples(ratio: usize) -> Samples {
    Samples {
        also: [1, 2, 4].map(|k| k * ratio).to_vec(),
        ..Samples::every(8 * ratio)
    }
}

fn time(step: usize) -> f64 {
    step as f64 * STEP
}

impl Compared {
    fn minimizations(&self) -> impl Iterator<Item = &StepRecord> {
        let records = self.trajectory.records.iter();
        records.filter_map(|record| record.minimization.as_ref())
    }

    fn seconds_per_step(&self) -> f64 {
        self.trajectory.seconds() / self.trajectory.steps() as f64
    }

    /// The zero level at a time.
    fn loops(&self, step: usize) -> Result<Curve, Error> {
        let ratio = (STEP / self.trajectory.case.steps.rule.size(1)).round() as usize;
        let field = self.trajectory.field(step * ratio)?;
        let curves = zero_level(&field, Interpolation::Profile).into_iter();
        Ok(Curve::new(
            curves.map(|curve| curve.points).collect::<Vec<_>>(),
        ))
    }
}

impl Comparison<'_> {
    fn sampled(&self) -> impl Iterator<Item = usize> {
        (0..=self.steps).filter(|&step| samples(1).holds(step) || step == self.steps)
    }

    fn shown(&self) -> Vec<usize> {
        let drawn = |step: &usize| self.setting.shown.contains(step) || *step == self.steps;
        self.sampled().filter(drawn).collect()
    }

    fn is_reference(&self, run: &Compared) -> bool {
        run.variant == self.reference.variant && self.setting.reference_ratio == 1
    }

    /// Runs that are compared with the reference: all but the reference itself.
    fn others(&self) -> impl Iterator<Item = &Compared> {
        self.runs.iter().filter(|run| !self.is_reference(run))
    }

    /// Steps and distances to the reference, which makes several steps for each.
    fn errors(&self, run: &Compared) -> Result<Vec<(usize, f64)>, Error> {
        let ratio = self.setting.reference_ratio;
        let error = |k: usize| {
            Ok((
                k,
                run.trajectory
                    .distance(k, &self.reference.trajectory, k * ratio)?,
            ))
        };
        self.sampled().map(error).collect()
    }

    /// Largest distance over time between the reference and the same method at half the resolution.
    fn reference_difference(&self) -> Result<Option<f64>, Error> {
        let Some(half) = &self.half else {
            return Ok(None);
        };
        let mut largest = 0.0_f64;
        for step in self.sampled().map(|k| k * self.setting.reference_ratio) {
            largest = largest.max(half.trajectory.distance(
                step,
                &self.reference.trajectory,
                step,
            )?);
        }
        Ok(Some(largest))
    }

    fn about_the_reference(&self) -> Result<String, Error> {
        let (n, ratio) = (self.reference.variant.n, self.setting.reference_ratio);
        let step = match ratio {
            1 => String::new(),
            ratio => format!(", {ratio} steps for each"),
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

    fn write(&self, session: Session<'_>) -> Result<(), Error> {
        session.figure(self.error_figure()?, "errors")?;
        session.figure(self.shape_figure()?, "shapes")?;
        let table = self.table()?;
        table.write(&session.output, "error_table")?;
        self.data(&session.output)?;
        let report = format!("{}\n{}", table.to_markdown(), self.about_the_reference()?);
        session.finish(self.setting.title, self.summary()?, &report)
    }

    fn data(&self, output: &OutputDir) -> Result<(), Error> {
        let leading = &Variant::COLUMNS[1..];
        let mut errors = Table::data(leading.iter().chain(&["step", "time", "l2"]));
        for run in &self.runs {
            for (step, l2) in self.errors(run)? {
                let row = [step.into(), time(step).into(), l2.into()];
                errors.push(run.variant.cells().into_iter().skip(1).chain(row))?;
            }
        }
        output.write("errors.csv", errors.to_csv()?)?;
        output.write("errors.json", errors.to_json()?)?;
        let compared = self.runs.iter().map(|run| (run, "false"));
        let references = std::iter::once(&self.reference).chain(&self.half);
        let rows: Vec<Rows<'_>> = compared
            .chain(references.map(|run| (run, "true")))
            .map(|(run, reference)| Rows {
                leading: run
                    .variant
                    .cells()
                    .into_iter()
                    .skip(1)
                    .chain([reference.into()])
                    .collect(),
                start: Some(&run.trajectory.start),
                records: &run.trajectory.records,
            })
            .collect();
        let steps = steps::table(&[leading, &["reference"]].concat(), &rows)?;
        output.write("steps.csv", steps.to_csv()?)?;
        Ok(())
    }

    fn error_figure(&self) -> Result<Figure, Error> {
        let mut curves = Vec::new();
        for run in self.others() {
            let points = self.errors(run)?.into_iter().map(|(k, l2)| [time(k), l2]);
            curves.push(self.study.series(run.variant, points.collect()));
        }
        let chart = LineChart::new("", Axis::linear("time t"), Axis::log("L² error"));
        Ok(
            Figure::new(format!("{}: error over time", self.setting.title), 1)
                .with_panel(self.study.chart(chart, curves))
                .with_shared_legend()
                .with_note(format!(
                    "ε = 2⁻⁶, time step 2⁻¹⁴. {}",
                    self.about_the_reference()?
                )),
        )
    }

    /// Rows: methods at their finest resolution, and the reference; columns: times.
    fn shape_figure(&self) -> Result<Figure, Error> {
        let mut rows: Vec<(&Compared, String)> = Vec::new();
        for (method, scheme) in look::variants(|_| true) {
            let own =
                |run: &&Compared| (run.variant.method, run.variant.scheme) == (method, scheme);
            if let Some(run) = self.others().filter(own).max_by_key(|run| run.variant.n) {
                rows.push((run, run.variant.label().replace(", ", "\n")));
            }
        }
        rows.push((&self.reference, "reference".to_owned()));
        let labels = rows
            .iter()
            .map(|(run, label)| format!("{label}\nn = {}", run.variant.n));
        let (shown, half) = (self.shown(), self.setting.window);
        let mut figure = Figure::new(format!("{}: shapes", self.setting.title), shown.len())
            .with_column_labels(shown.iter().map(|&k| format!("t = {}", time_label(k))))
            .with_row_labels(labels);
        for (run, _) in &rows {
            for &step in &shown {
                let curve = run.loops(step)?.filled(Colour::LightGrey);
                let window = [-half, half];
                let mut panel = Shapes::new("")
                    .with_curve(curve)
                    .with_window(window, window);
                if run.variant != self.reference.variant {
                    let reference = self.reference.loops(step)?;
                    panel = panel.with_curve(reference.with_colour(1).with_width(1.0));
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
        let all = self
            .runs
            .iter()
            .map(|run| self.errors(run))
            .collect::<Result<Vec<_>, _>>()?;
        let rows: Vec<(&Compared, Vec<(usize, f64)>)> = self.runs.iter().zip(all).collect();
        let mut table = Table::of(&rows)
            .text("method", |(run, _)| run.variant.label())
            .number("n", Format::Shortest, |(run, _)| run.variant.n);
        for k in self.shown().into_iter().filter(|k| *k > 0) {
            table = table.number(
                format!("error, step {k}"),
                Format::Fixed(5),
                |(run, errors)| {
                    let error = errors.iter().find(|(step, _)| *step == k);
                    error.filter(|_| !self.is_reference(run)).map(|(_, l2)| *l2)
                },
            );
        }
        let hvp = |run: &Compared| study::mean(run.minimizations(), StepRecord::hvp);
        Ok(table
            .number("HVP/step", Format::Fixed(1), |(run, _)| hvp(run))
            .number("s/step", Format::Fixed(2), |(run, _)| {
                run.seconds_per_step()
            })
            .finish()?)
    }

    fn summary(&self) -> Result<Summary, Error> {
        let mut summary = Summary::new();
        for run in &self.runs {
            let key = format!("{}.{}", self.setting.program, run.variant.key());
            if !self.is_reference(run) {
                for (step, l2) in self.errors(run)? {
                    summary.insert(&format!("{key}.l2.step{step}"), l2)?;
                }
            }
            let mut measured = |step: usize, values: &Values| -> Result<(), Error> {
                for (name, value) in values {
                    summary.insert(&format!("{key}.{name}.step{step}"), *value)?;
                }
                Ok(())
            };
            measured(0, &run.trajectory.start)?;
            for record in &run.trajectory.records {
                measured(record.step, &record.measures)?;
            }
            for made in run.minimizations() {
                summary.insert(&format!("{key}.energy.step{}", made.step), made.energy)?;
            }
            let newton = |made: &StepRecord| made.newton.newton as f64;
            if let Some(newton) = study::mean(run.minimizations(), newton) {
                summary.insert(&format!("{key}.newton_per_step"), newton)?;
                let hvp = study::mean(run.minimizations(), StepRecord::hvp).unwrap_or(f64::NAN);
                summary.insert(&format!("{key}.hvp_per_step"), hvp)?;
                let rises = run.minimizations().filter(|r| r.energy > r.energy_before);
                summary.insert_count(&format!("{key}.energy_increases"), rises.count())?;
            }
            summary.insert(&format!("{key}.seconds"), run.trajectory.seconds())?;
        }
        let key = format!("{}.reference", self.setting.program);
        summary.insert_count(&format!("{key}.n"), self.reference.variant.n)?;
        summary.insert(
            &format!("{key}.seconds"),
            self.reference.trajectory.seconds(),
        )?;
        if let Some(distance) = self.reference_difference()? {
            summary.insert(&format!("{key}.l2_to_half_n"), distance)?;
        }
        Ok(summary)
    }
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
        let field = cross(grid).unwrap();
        let area = geometry::measure::zero_set_volume(&field);
        let exact = 2.0 * 1.6 * 0.54 - 0.54 * 0.54;
        assert!((area - exact).abs() < 2e-3, "{area} {exact}");
    }
}
