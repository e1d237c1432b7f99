//! Errors of the time steps against the exact flow, and what they cost.

use crate::circles::{self, Ensemble};
use crate::networks::Chosen;
use crate::prelude::*;
use crate::study::Variant;
use crate::truth::{
    self, ACCURATE, CELLS, CROSS, ELLIPSE, ELLIPSOID, RECTANGLE, Reached, STRICT, Sample,
};

const TITLE: &str = "Time steps of Willmore flow against the exact flow";

const CURVES: [Sample<2>; 3] = [CROSS, RECTANGLE, ELLIPSE];
/// A surface of revolution, on half as many cells.
const SURFACE: Sample<3> = ELLIPSOID;

/// Times at which flows are compared, in units of `2^-14`.
const MARKS: [usize; 4] = [8, 32, 64, 128];
const END: f64 = 128.0 * STEP;
/// The first mark is the end divided by two so many times.
const HALVINGS: u32 = 4;

const EULER: &str = "implicit Euler, equal steps";
const GRADED: &str = "implicit Euler, graded steps";
const EQUAL: &str = "second order, equal steps";
const CONTROLLED: &str = "second order, controlled steps";
const ELEMENTS: &str = "finite elements, implicit Euler";
/// With their colours and marks in the figures.
const KINDS: [(&str, usize, Marker); 5] = [
    (EULER, 1, Marker::Square),
    (GRADED, 3, Marker::Diamond),
    (EQUAL, 0, Marker::Triangle),
    (CONTROLLED, 2, Marker::Circle),
    (ELEMENTS, 4, Marker::Triangle),
];

/// A way to make time steps, and its curve in the figure.
struct Stepping {
    key: String,
    kind: &'static str,
    variant: (Method, Scheme),
    steps: TimeSteps,
}

/// Three of each kind, from coarse to fine, the coarsest with equal steps of `longest`; the middle ones alone for a quick run.
fn steppings(longest: f64, quick: bool) -> Vec<Stepping> {
    let stepping = |key: String, kind, steps| Stepping {
        key,
        kind,
        variant: ACCURATE,
        steps,
    };
    let equal = |parts: f64| StepRule::Constant(longest / parts);
    let euler = [1.0, 2.0, 4.0].map(|parts| {
        let key = format!("euler{}", STEP / longest * parts);
        stepping(key, EULER, equal(parts).into())
    });
    let graded = [0.4, 0.2, 0.1].map(|part| {
        let rule = StepRule::Graded {
            first: part * longest / 4.0,
            part,
        };
        stepping(format!("graded{part}"), GRADED, rule.into())
    });
    let second = [0.5, 1.0, 2.0].map(|parts| {
        let steps = TimeSteps {
            order: Order::Second,
            ..equal(parts).into()
        };
        stepping(
            format!("second_order{}", STEP / longest * parts),
            EQUAL,
            steps,
        )
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
        let steps = truth::controlled(control, END, HALVINGS);
        stepping(format!("controlled{suffix}"), CONTROLLED, steps)
    });
    let elements = [0.125, 0.25, 0.5].map(|parts| Stepping {
        variant: (Method::FeImplicit, Scheme::Paper),
        ..stepping(
            format!("elements{}", STEP / longest * parts),
            ELEMENTS,
            equal(parts).into(),
        )
    });
    let used = if quick { 1..2 } else { 0..3 };
    let all = [euler, graded, second, controlled, elements];
    let all = all.map(|three| three.into_iter().take(used.end).skip(used.start));
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
    kind: &'static str,
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
    let (mut rows, mut ratios) = (Vec::new(), Vec::new());
    let in_plane = steppings(STEP, options.quick);
    for sample in &CURVES {
        let cells = (&cells[..], &marks[..]);
        let of_curve = compare(&mut session, sample, cells, &in_plane, &mut ratios)?;
        rows.extend(of_curve);
    }
    let halves: Vec<usize> = cells.iter().map(|n| n / 2).collect();
    let in_space: Vec<Stepping> = (steppings(4.0 * STEP, options.quick).into_iter())
        .filter(|stepping| stepping.kind != ELEMENTS)
        .collect();
    let cells = (&halves[..], &marks[..]);
    let of_surface = compare(&mut session, &SURFACE, cells, &in_space, &mut ratios)?;
    rows.extend(of_surface);
    truth_of_estimates(&mut session, &ratios)?;
    circles(&mut session, options.quick)?;
    let work = Axis::log("HVPs");
    session.figure(
        figure(&rows, &marks, &work, |reached| reached.hvp),
        "work_precision",
    )?;
    let seconds = Axis::log("seconds");
    session.figure(
        figure(&rows, &marks, &seconds, |reached| reached.seconds),
        "seconds",
    )?;
    session.sheet(sheet(&rows), "errors")?;
    session.finish(TITLE)
}

/// Runs a sample in all kinds of time steps and compares it at the marks, graded steps at the ends of those in which the marks are; adds the
/// ratios of estimated to true time errors.
fn compare<const D: usize>(
    session: &mut Session<'_>,
    sample: &Sample<D>,
    (cells, marks): (&[usize], &[usize]),
    steppings: &[Stepping],
    ratios: &mut Vec<f64>,
) -> Result<Vec<Compared>, Error> {
    let mut rows = Vec::new();
    let times: Vec<f64> = marks.iter().map(|&k| k as f64 * STEP).collect();
    let title = format!("{}: the exact flow", sample.key);
    let exact = session.phase(title, |_| sample.exact(Flow::Willmore, &times))?;
    for &n in cells {
        let mut controlled = Vec::new();
        for stepping in steppings {
            let steps = (&stepping.key[..], stepping.steps, times[times.len() - 1]);
            let run = sample.run(session, (n, 2.0), stepping.variant, steps)?;
            let own = if stepping.kind == GRADED {
                let ends = times
                    .iter()
                    .filter_map(|time| truth::until(&run, *time).last());
                let ends: Vec<f64> = ends.map(|record| record.time).collect();
                Some(sample.exact(Flow::Willmore, &ends)?)
            } else {
                None
            };
            for (&mark, truth) in marks.iter().zip(own.as_ref().unwrap_or(&exact)) {
                rows.push(Compared {
                    sample: sample.key,
                    n,
                    stepping: stepping.key.clone(),
                    kind: stepping.kind,
                    mark,
                    reached: Reached::of(sample, &run, truth)?,
                });
            }
            if stepping.kind == CONTROLLED {
                controlled.push((format!("{}.n{n}.{}", sample.key, stepping.key), run));
            }
        }
        ratios.extend(time_errors(session, marks, &controlled)?);
    }
    for (&mark, truth) in marks.iter().zip(&exact) {
        let key = format!("{}.exact", sample.key);
        truth::record(session, &key, mark, &truth.sizes())?;
    }
    if cells.len() > 1 {
        let both = sample.extrapolated(session, (END, HALVINGS), exact.iter())?;
        for (&mark, reached) in marks.iter().zip(&both) {
            reached.record(session, &format!("{}.extrapolated", sample.key), mark)?;
        }
    }
    Ok(rows)
}

/// Distances of runs below which they are the same, a thousandth of a cell.
const SAME: f64 = 1e-5;

/// The true time errors of controlled steps, distances to the last and strictest of the runs with the same `eps`, and the ratios of estimated errors to
/// them. Cases without an estimate, after less than three steps, do not count, nor those that are nearer to the strict run than that is known to be
/// near the truth.
fn time_errors<const D: usize>(
    session: &mut Session<'_>,
    marks: &[usize],
    runs: &[(String, Trajectory<D>)],
) -> Result<Vec<f64>, Error> {
    let mut ratios = Vec::new();
    let Some(((_, strict), others)) = runs.split_last() else {
        return Ok(ratios);
    };
    for ((name, run), &mark) in others
        .iter()
        .flat_map(|other| marks.iter().map(move |mark| (other, mark)))
    {
        let time = mark as f64 * STEP;
        let field = |run: &Trajectory<D>| {
            let so_far = truth::until(run, time);
            run.field(so_far[so_far.len() - 1].step)
        };
        let error = truth::distance_of_levels(&field(run)?, &field(strict)?, run.case.scales.eps);
        session.metric(&format!("{name}.time_error.step{mark}"), error)?;
        let estimated = engine::estimated_time_error(truth::until(run, time)).unwrap_or(0.0);
        if estimated > 0.0 && error > SAME {
            ratios.push(estimated / error);
        }
    }
    Ok(ratios)
}

/// The least ratio of an estimated time error to the true one, and in which part of the cases it is between 1/3 and 3.
fn truth_of_estimates(session: &mut Session<'_>, ratios: &[f64]) -> Result<(), Error> {
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

/// Steps for an extrapolation, alike on both grids, so that their errors do not add up.
fn careful(n: usize) -> ErrorControl {
    ErrorControl {
        relative: 0.003,
        length: None,
        longest: 0.5 * n as f64 / CELLS[1] as f64,
        first: Some(16.0 * EPS.powi(4)),
    }
}

/// The circles of `circle_convergence` at n = 128 with the accurate operator, in equal steps of first order, in controlled ones of second order, and
/// those extrapolated in `eps` from n = 64 and 128: their mean L2 error at the end of the 64 steps, and all Hessian-vector products, which on
/// the coarser grid count by their share of the unknowns.
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
    let euler = session.phase("circles: euler1", |stage| {
        Ensemble::run(&(variant, operator), (count, steps), "fields", stage)
    })?;
    let hvp = |run: &Trajectory<2>| run.records.iter().filter_map(Record::hvp).sum::<f64>();
    let of_euler = [
        euler.mean_error(steps),
        euler.circles.iter().map(|c| hvp(&c.trajectory)).sum(),
    ];
    let (mut controlled, mut extrapolated) = ([0.0; 2], [0.0; 2]);
    for (k, radius) in circles::radii(count).into_iter().enumerate() {
        let mut run = |n: usize, name: &str, control| {
            let grid = circles::grid(variant.flow, radius, steps, n)?;
            let initial = phase_field(grid, &Ball::new([0.0; 2], radius)?, 2.0 * grid.spacing())?;
            let (name, end) = (format!("circle{k:02}-n{n}-{name}"), steps as f64 * STEP);
            let time = (&name[..], TimeSteps::controlled(control), end);
            let run = truth::flow(session, ("circle", initial, 2.0), ACCURATE, time)?;
            Ok::<_, Error>((run.field(run.steps())?, hvp(&run)))
        };
        let [coarse, fine] = CELLS;
        let (u, work) = run(fine, "controlled", ErrorControl::default())?;
        let (a, coarse_work) = run(coarse, "careful", careful(coarse))?;
        let (b, fine_work) = run(fine, "careful", careful(fine))?;
        let radius_of = |u: &Field<2>, eps| Ok((ZeroSet::of(u, eps)?.volume / PI).sqrt());
        let circle = |radius| phase_field(*u.grid(), &Ball::new([0.0; 2], radius)?, EPS);
        let [a, b]: [Result<f64, Error>; 2] = [radius_of(&a, 2.0 * EPS), radius_of(&b, EPS)];
        let limit = circle((4.0 * b? - a?) / 3.0)?;
        let end = steps as f64 * STEP;
        let exact = circle(circles::radius_at(variant.flow, radius, end))?;
        let share = (coarse as f64 / fine as f64).powi(2);
        for (sums, field, work) in [
            (&mut controlled, &u, work),
            (&mut extrapolated, &limit, fine_work + share * coarse_work),
        ] {
            sums[0] += l2_distance(field, &exact)? / count as f64;
            sums[1] += work;
        }
    }
    let all = [of_euler, controlled, extrapolated];
    for (name, [l2, hvp]) in ["euler1", "controlled", "extrapolated"]
        .into_iter()
        .zip(all)
    {
        let metrics = [("l2", l2.into()), ("hvp_total", hvp.into())];
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
    for name in ["tip", "diagonal", "area", "perimeter", "volume", "w"] {
        sheet = sheet.metric(name, move |row| row.reached.size(name));
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

/// Largest distances from the exact flow against work, for the second and the last mark.
fn figure(rows: &[Compared], marks: &[usize], axis: &Axis, work: fn(&Reached) -> f64) -> Figure {
    let mut shown: Vec<usize> = vec![marks[1.min(marks.len() - 1)], marks[marks.len() - 1]];
    shown.dedup();
    let curves = CURVES.iter().map(|sample| (sample.key, sample.title));
    let samples: Vec<_> = curves.chain([(SURFACE.key, SURFACE.title)]).collect();
    let mut figure = Figure::new(format!("{TITLE}: work and precision"), shown.len());
    for (key, title) in &samples {
        for &mark in &shown {
            let here = |row: &&Compared| (row.sample, row.mark) == (*key, mark);
            let cells = CELLS.map(|n| if *key == SURFACE.key { n / 2 } else { n });
            let mut curves: Vec<Series> = Vec::new();
            let styles = [(LineStyle::Dashed, "coarse"), (LineStyle::Solid, "fine")];
            for (n, (style, grid)) in cells.into_iter().zip(styles) {
                for (kind, colour, marker) in KINDS {
                    let rows = rows.iter().filter(here);
                    let mut points: Vec<[f64; 2]> = rows
                        .filter(|row| (row.n, row.kind) == (n, kind))
                        .map(|row| [work(&row.reached), row.reached.distance])
                        .collect();
                    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    let curve = Series::new(format!("{kind}, {grid}"), points)
                        .with_colour(colour)
                        .with_style(style);
                    curves.push(curve.with_marker(marker));
                }
            }
            let title = format!("{title}, t = {mark}·2⁻¹⁴");
            let chart = LineChart::new(title, axis.clone(), Axis::log("largest distance"));
            figure = figure.with_panel(chart.with_curves(curves));
        }
    }
    figure.with_shared_legend().with_note(
        "HVP: Hessian-vector product. Fine: eps = 2h = 1/64, of the ellipsoid 1/32; coarse: twice that.",
    )
}
