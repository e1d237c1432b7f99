//! Errors of the time steps against the exact flow, and what they cost.

use crate::circles::{self, Ensemble};
use crate::networks::Chosen;
use crate::prelude::*;
use crate::study::Variant;
use crate::truth::{self, CELLS, CROSS, ELLIPSE, RECTANGLE, Reached, STRICT, Sample};

const TITLE: &str = "Time steps of Willmore flow against the exact flow";

const SAMPLES: [Sample<2>; 3] = [CROSS, RECTANGLE, ELLIPSE];

/// Times at which flows are compared, in units of `2^-14`.
const MARKS: [usize; 4] = [8, 32, 64, 128];
const END: f64 = 128.0 * STEP;

const EULER: &str = "implicit Euler, equal steps";
const EQUAL: &str = "second order, equal steps";
const CONTROLLED: &str = "second order, controlled steps";

/// A way to make time steps, and its curve in the figure.
struct Stepping {
    key: String,
    curve: &'static str,
    steps: TimeSteps,
}

fn steppings(quick: bool) -> Vec<Stepping> {
    let stepping = |key: String, curve, steps| Stepping { key, curve, steps };
    let euler = [1, 2, 4].map(|parts| {
        let steps = StepRule::Constant(STEP / f64::from(parts)).into();
        stepping(format!("euler{parts}"), EULER, steps)
    });
    let equal = [0.5, 1.0, 2.0].map(|parts: f64| {
        let steps = TimeSteps {
            order: Order::Second,
            ..StepRule::Constant(STEP / parts).into()
        };
        stepping(format!("second_order{parts}"), EQUAL, steps)
    });
    let loose = ErrorControl {
        relative: 0.08,
        longest: 2.0,
        ..ErrorControl::default()
    };
    let controls = [
        ("_loose", loose),
        ("", ErrorControl::default()),
        ("_strict", STRICT),
    ];
    let controlled = controls.map(|(suffix, control)| {
        let steps = truth::controlled(control, END, 4);
        stepping(format!("controlled{suffix}"), CONTROLLED, steps)
    });
    let used = if quick { 1..2 } else { 0..3 };
    let all =
        [euler, equal, controlled].map(|three| three.into_iter().take(used.end).skip(used.start));
    all.into_iter().flatten().collect()
}

/// Willmore flow of a cross, a rectangle and an ellipse by the accurate operator in several kinds of time steps, eps = 2h = 1/32 and 1/64, against
/// the exact flow of the curves: largest distances, tips, areas, lengths and energies, and the Hessian-vector products they cost.
#[derive(Parser, Debug)]
#[command(name = "work_precision", version)]
pub struct Options {
    #[command(flatten)]
    run: RunOptions,
}

struct Compared {
    sample: &'static str,
    n: usize,
    stepping: String,
    curve: &'static str,
    mark: usize,
    reached: Reached,
}

pub fn program(Options { run: options }: &Options) -> Result<(), Error> {
    let used = if options.quick { 1 } else { usize::MAX };
    let marks: Vec<usize> = MARKS.into_iter().take(used).collect();
    let cells: Vec<usize> = CELLS.into_iter().take(used).collect();
    let parameters = json!({ "marks": marks, "cells": cells, "time_unit": STEP, "eps_over_h": 2 });
    let device = options.open_device()?;
    let mut session = Session::open("work_precision", options, device, parameters)?;
    let times: Vec<f64> = marks.iter().map(|&k| k as f64 * STEP).collect();
    let end = times[times.len() - 1];
    let mut rows = Vec::new();
    for sample in &SAMPLES {
        let title = format!("{}: the exact flow", sample.key);
        let curves = session.phase(title, |_| sample.exact(Flow::Willmore, &times))?;
        for &n in &cells {
            for stepping in steppings(options.quick) {
                let run = sample.run(&mut session, n, (&stepping.key, stepping.steps, end))?;
                for (&mark, curve) in marks.iter().zip(&curves) {
                    rows.push(Compared {
                        sample: sample.key,
                        n,
                        stepping: stepping.key.clone(),
                        curve: stepping.curve,
                        mark,
                        reached: Reached::of(sample, &run, curve)?,
                    });
                }
            }
        }
        for (&mark, curve) in marks.iter().zip(&curves) {
            let exact = format!("{}.exact", sample.key);
            truth::record(&mut session, &exact, mark, &curve.sizes())?;
            let strict = |n| {
                let same = |row: &&Compared| {
                    let key = (row.sample, row.n, &row.stepping[..], row.mark);
                    key == (sample.key, n, "controlled_strict", mark)
                };
                rows.iter().find(same).map(|row| &row.reached)
            };
            if let (Some(double), Some(single)) = (strict(CELLS[0]), strict(CELLS[1])) {
                let both = Reached::extrapolated(double, single, curve);
                let key = format!("{}.extrapolated", sample.key);
                both.record(&mut session, &key, mark)?;
            }
        }
    }
    truth_of_estimates(&mut session, &rows)?;
    circles(&mut session, options.quick)?;
    session.figure(figure(&rows, &marks), "work_precision")?;
    session.sheet(sheet(&rows), "errors")?;
    session.finish(TITLE)
}

/// Compares the estimated time errors of controlled steps with the true ones, distances to strictly controlled runs with the same `eps`: the
/// least ratio of the two, and in which part of the cases it is between 1/3 and 3.
fn truth_of_estimates(session: &mut Session<'_>, rows: &[Compared]) -> Result<(), Error> {
    let mut ratios = Vec::new();
    let named = |name| rows.iter().filter(move |row| row.stepping == name);
    for row in named("controlled").chain(named("controlled_loose")) {
        let key = |row: &Compared| (row.sample, row.n, row.mark);
        let Some(strict) = named("controlled_strict").find(|strict| key(strict) == key(row)) else {
            continue;
        };
        let error = truth::largest_distance(&row.reached.points, &strict.reached.points);
        let (sample, n, mark) = key(row);
        let name = format!("{sample}.n{n}.{}.time_error.step{mark}", row.stepping);
        session.metric(&name, error)?;
        ratios.push(row.reached.estimated / error);
    }
    if !ratios.is_empty() {
        let good = ratios
            .iter()
            .filter(|r| (1.0 / 3.0..=3.0).contains(*r))
            .count();
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        session.metric(
            "estimates.within_factor_3",
            good as f64 / ratios.len() as f64,
        )?;
        session.metric("estimates.least_over_true", least)?;
    }
    Ok(())
}

/// The circles of `circle_convergence` at n = 128 with the accurate operator, in equal steps of first order and in controlled ones of second
/// order: their mean L2 error at the end of the 64 steps, and all Hessian-vector products.
fn circles(session: &mut Session<'_>, quick: bool) -> Result<(), Error> {
    let (count, steps) = if quick {
        (2, 4)
    } else {
        (circles::COUNT, circles::STEPS)
    };
    let variant = Variant {
        flow: Flow::Willmore,
        method: Method::Hybrid,
        scheme: Scheme::Accurate,
        n: CELLS[1],
    };
    let operator = Chosen::default().operator(variant.look(), variant.n)?;
    let planned = (variant, operator);
    let controlled = TimeSteps::controlled(ErrorControl::default());
    for (name, time_steps) in [("euler1", None), ("controlled", Some(controlled))] {
        let ensemble = session.phase(format!("circles: {name}"), |stage| {
            Ensemble::run(&planned, (count, steps), time_steps, "fields", stage)
        })?;
        let records = (ensemble.circles.iter()).flat_map(|circle| &circle.trajectory.records);
        let hvp: f64 = records.filter_map(Record::hvp).sum();
        let metrics = [
            ("l2", ensemble.last_error().into()),
            ("hvp_total", hvp.into()),
        ];
        session.metrics(&format!("circles.n{}.{name}", variant.n), metrics)?;
    }
    Ok(())
}

fn sheet(rows: &[Compared]) -> Sheet<'_, Compared> {
    let mut sheet = Sheet::of(rows)
        .keyed(|row, name| {
            format!(
                "{}.n{}.{}.{name}.step{}",
                row.sample, row.n, row.stepping, row.mark
            )
        })
        .text("shape", |row| row.sample)
        .column("n", Shortest, |row| row.n)
        .text("time steps", |row| row.stepping.clone())
        .column("time / 2⁻¹⁴", Shortest, |row| row.mark);
    let names = rows.first().map(|row| &row.reached.sizes);
    for (i, (name, _)) in names.into_iter().flatten().enumerate() {
        sheet = sheet.metric(name, move |row| row.reached.sizes[i].1);
    }
    sheet
        .measure(
            "distance_to_exact",
            ("largest distance", Scientific(2)),
            |row| row.reached.distance,
        )
        .measure(
            "estimated_error",
            ("estimated time error", Scientific(1)),
            |row| (row.reached.estimated > 0.0).then_some(row.reached.estimated),
        )
        .measure("steps", ("steps", Shortest), |row| row.reached.steps)
        .measure("hvp_total", ("HVP", Fixed(0)), |row| row.reached.hvp)
        .measure("seconds", ("s", Fixed(1)), |row| row.reached.seconds)
}

/// Largest distances from the exact curve against Hessian-vector products, for the second and the last mark.
fn figure(rows: &[Compared], marks: &[usize]) -> Figure {
    let mut shown: Vec<usize> = vec![marks[1.min(marks.len() - 1)], marks[marks.len() - 1]];
    shown.dedup();
    let mut figure = Figure::new(format!("{TITLE}: work and precision"), SAMPLES.len());
    for &mark in &shown {
        for sample in &SAMPLES {
            let title = format!("{}, t = {mark}·2⁻¹⁴", sample.title);
            let axes = (
                Axis::log("Hessian-vector products"),
                Axis::log("largest distance"),
            );
            let mut curves: Vec<Series> = Vec::new();
            for (n, style) in CELLS.into_iter().zip([LineStyle::Dashed, LineStyle::Solid]) {
                for (kind, colour, marker) in [
                    (EULER, 1, Marker::Square),
                    (EQUAL, 0, Marker::Triangle),
                    (CONTROLLED, 2, Marker::Circle),
                ] {
                    let here = |row: &&Compared| {
                        (row.sample, row.n, row.curve, row.mark) == (sample.key, n, kind, mark)
                    };
                    let mut points: Vec<[f64; 2]> = rows
                        .iter()
                        .filter(here)
                        .map(|row| [row.reached.hvp, row.reached.distance])
                        .collect();
                    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    let label = format!("{kind}, eps = 1/{}", n / 2);
                    let curve = Series::new(label, points)
                        .with_colour(colour)
                        .with_style(style);
                    curves.push(curve.with_marker(marker));
                }
            }
            figure = figure.with_panel(LineChart::new(title, axes.0, axes.1).with_curves(curves));
        }
    }
    figure.with_shared_legend()
}
