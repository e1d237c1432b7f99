use crate::circles::{self, Ensemble};
use crate::prelude::*;
use crate::truth::{
    self, CELLS, CROSS, Course, ELLIPSE, ELLIPSOID, Halves, RECTANGLE, Reached, STRICT, Sample,
    Truth,
};

pub const EXPERIMENT: Experiment = Experiment {
    name: "work_precision",
    summary: "Errors of the time steps against the exact flow, and what they cost.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "work_precision",
        title: "Time steps against the exact flow",
        description: "Not in the paper: implicit Euler and steps of second order, equal and controlled, against the exact \
                 flow of curves and of a surface of revolution.",
        figures: &[
            (
                "work_precision",
                "Largest distance from the exact curve or surface against Hessian-vector products.",
            ),
            ("seconds", "The same against wall time."),
        ],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[("SHAPE", "`cross`, `rectangle`, `ellipse`, `ellipsoid`")],
};

const METRICS: MetricTable = MetricTable {
    title: "Time steps against the exact flow",
    note: "",
    words: &[(
        "STEPS",
        "how time steps are made: `euler0.25`, `euler0.5`, `euler1`, `euler2` and `euler4`, implicit Euler with \
             so many equal steps in 2^-14; `graded0.4`, `graded0.2` and `graded0.1`, implicit Euler with steps of \
             that part of the time passed; `second_order0.125`, `second_order0.25`, `second_order0.5`, \
             `second_order1` and `second_order2`, so many equal steps of second order; `controlled`, second order \
             with sizes by their estimated error, and `controlled_loose`, `controlled_strict`; `elements0.125`, \
             `elements0.25` and `elements0.5`, implicit Euler with nested finite elements, so many equal steps",
    )],
    rows: &[
        (
            "SHAPE.exact.tip.stepK, SHAPE.exact.diagonal.stepK, SHAPE.exact.area.stepK, SHAPE.exact.perimeter.stepK, \
             SHAPE.exact.volume.stepK, SHAPE.exact.w.stepK",
            "distances from the centre to the exact curve on the positive x axis and on the diagonal, its area, \
             length and Willmore energy, at `t = K 2^-14`; of the surface its area, volume and energy",
        ),
        (
            "SHAPE.nN.STEPS.tip.stepK, SHAPE.nN.STEPS.diagonal.stepK, SHAPE.nN.STEPS.area.stepK, \
             SHAPE.nN.STEPS.perimeter.stepK, SHAPE.nN.STEPS.volume.stepK, SHAPE.nN.STEPS.w.stepK",
            "the same of the zero set of the phase field, `eps = 2/N`, by coarea sums",
        ),
        (
            "SHAPE.nN.STEPS.distance_to_exact.stepK",
            "largest distance of the zero level from the exact curve or surface; with graded steps, at the end of the \
             step in which the time is",
        ),
        (
            "SHAPE.nN.STEPS.estimated_error.stepK",
            "estimated time error so far, largest over the interface: the sum of the local errors as delays, times the present speed; \
             none in the first three steps",
        ),
        (
            "SHAPE.nN.STEPS.steps.stepK, SHAPE.nN.STEPS.hvp_total.stepK, SHAPE.nN.STEPS.seconds.stepK",
            "time steps, Hessian-vector products and wall time so far",
        ),
        (
            "SHAPE.extrapolated.tip.stepK, SHAPE.extrapolated.diagonal.stepK, SHAPE.extrapolated.area.stepK, \
             SHAPE.extrapolated.perimeter.stepK, SHAPE.extrapolated.volume.stepK, SHAPE.extrapolated.w.stepK, \
             SHAPE.extrapolated.distance_to_exact.stepK, SHAPE.extrapolated.estimated_error.stepK",
            "`(4 b - a) / 3` of strictly controlled runs, of curves with `eps = 1/64` (a) and `1/128` (b), four cells \
             to each, of the surface with `eps = 1/32` and `1/64`, two cells to each",
        ),
        (
            "SHAPE.extrapolated.steps.stepK, SHAPE.extrapolated.hvp_total.stepK",
            "time steps and Hessian-vector products of both",
        ),
        (
            "SHAPE.nN.STEPS.time_error.stepK",
            "the true time error of controlled steps: largest distance from the zero level of the run by \
             `controlled_strict` with the same `eps`",
        ),
        (
            "estimates.within_factor_3, estimates.least_over_true",
            "part of these cases in which the estimated error is between a third of the true one and three times \
             that; the least ratio of the two. Cases with up to three steps, which have no estimate, and true errors \
             below 1e-5, a thousandth of a cell, do not count",
        ),
        (
            "circles.nN.euler1.l2, circles.nN.controlled.l2, circles.nN.extrapolated.l2",
            "mean L2 error of the 30 circles of `circle_convergence` after the time `64 2^-14`, accurate operator; \
             extrapolated: of the circle of radius `(4 b - a) / 3` from controlled runs with `N / 2` (a) and `N` (b) \
             cells per unit of length",
        ),
        (
            "circles.nN.euler1.hvp_total, circles.nN.controlled.hvp_total, circles.nN.extrapolated.hvp_total",
            "Hessian-vector products of all of them; extrapolated: of both runs, where those on the coarser grid \
             count by their share of the unknowns, a quarter",
        ),
    ],
};

const TITLE: &str = "Time steps of Willmore flow against the exact flow";

const CURVES: [Sample<2>; 3] = [CROSS, RECTANGLE, ELLIPSE];
/// A surface of revolution, on half as many cells.
const SURFACE: Sample<3> = ELLIPSOID;

/// Times at which flows are compared, in units of `2^-14`.
const MARKS: [usize; 4] = [8, 32, 64, 128];
/// The first mark is the end divided by two so many times.
const HALVES: Halves = Halves {
    end: 128.0 * STEP,
    halvings: 4,
};

const EULER: &str = "implicit Euler, equal steps";
const GRADED: &str = "implicit Euler, graded steps";
const EQUAL: &str = "second order, equal steps";
const CONTROLLED: &str = "second order, controlled steps";
const NESTED: &str = "finite elements, implicit Euler";
/// With their colours and marks in the figures.
const KINDS: [(&str, usize, Marker); 5] = [
    (EULER, 1, Marker::Square),
    (GRADED, 3, Marker::Diamond),
    (EQUAL, 0, Marker::Triangle),
    (CONTROLLED, 2, Marker::Circle),
    (NESTED, 4, Marker::Triangle),
];

/// A way to make time steps, and its curve in the figure.
struct Stepping {
    kind: &'static str,
    key: String,
    steps: TimeSteps,
}

/// Three of each kind, from coarse to fine, the coarsest with equal steps of `longest`; the middle ones alone for a quick run.
fn steppings(longest: f64, quick: bool) -> Vec<Stepping> {
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
    let equal = |parts: f64| TimeSteps::from(StepRule::Constant(longest / parts));
    let mut all = Vec::new();
    let mut add = |kind, key: String, steps| all.push(Stepping { kind, key, steps });
    for k in if quick { 1..2 } else { 0..3 } {
        let halved = 2.0_f64.powi(k as i32);
        let key = |name: &str, parts: f64| format!("{name}{}", STEP / longest * parts);
        add(EULER, key("euler", halved), equal(halved));
        let part = [0.4, 0.2, 0.1][k];
        let first = part * longest / 4.0;
        let rule = StepRule::Graded { first, part };
        add(GRADED, format!("graded{part}"), rule.into());
        let steps = TimeSteps {
            order: Order::Second,
            ..equal(0.5 * halved)
        };
        add(EQUAL, key("second_order", 0.5 * halved), steps);
        let (suffix, control) = controls[k];
        let steps = truth::controlled(control, HALVES);
        add(CONTROLLED, format!("controlled{suffix}"), steps);
        let longer = 0.125 * halved;
        add(NESTED, key("elements", longer), equal(longer));
    }
    all.sort_by_key(|stepping| KINDS.iter().position(|kind| kind.0 == stepping.kind));
    all
}

/// Willmore flow of a cross, a rectangle and an ellipse by the accurate operator in several kinds of time steps, eps = 2h = 1/32 and 1/64, against
/// the exact flow of the curves: largest distances, tips, areas, lengths and energies, and the Hessian-vector products they cost.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,
}

/// What a run in such steps has reached at a mark.
struct Compared<'a> {
    sample: &'static str,
    n: usize,
    stepping: &'a Stepping,
    reached: Reached,
}

fn program(Options { run: options }: &Options) -> Result<()> {
    let marks = &MARKS[..options.either(1, MARKS.len())];
    let cells = &CELLS[..options.either(1, CELLS.len())];
    let parameters = json!({ "marks": marks, "cells": cells, "time_unit": STEP, "eps_over_h": 2 });
    let mut session = Session::open(EXPERIMENT.name, options, parameters)?;
    let (mut rows, mut ratios) = (Vec::new(), Vec::new());
    let times: Vec<(usize, f64)> = marks.iter().map(|&k| (k, time(k))).collect();
    let in_plane = steppings(STEP, options.quick);
    for sample in &CURVES {
        let (session, ratios) = (&mut session, &mut ratios);
        rows.extend(compare(session, sample, cells, &times, &in_plane, ratios)?);
    }
    let halves: Vec<usize> = cells.iter().map(|n| n / 2).collect();
    let mut in_space = steppings(4.0 * STEP, options.quick);
    in_space.retain(|stepping| stepping.kind != NESTED);
    let surface = compare(
        &mut session,
        &SURFACE,
        &halves,
        &times,
        &in_space,
        &mut ratios,
    );
    rows.extend(surface?);
    if !ratios.is_empty() {
        // The least ratio of an estimated time error to the true one, and in which part of the cases it is between 1/3 and 3.
        let is_good = |ratio: &&f64| (1.0 / 3.0..=3.0).contains(*ratio);
        let good = ratios.iter().filter(is_good).count();
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let within = good as f64 / ratios.len() as f64;
        let metrics = [
            ("within_factor_3", within.into()),
            ("least_over_true", least.into()),
        ];
        session.metrics("estimates", metrics)?;
    }
    circles(&mut session)?;
    session.figure(figure(&rows, marks, "HVPs", "hvp_total"), "work_precision")?;
    session.figure(figure(&rows, marks, "seconds", "seconds"), "seconds")?;
    session.sheet(sheet(&rows), "errors")?;
    session.finish(TITLE)
}

/// Runs a sample in all kinds of time steps and compares it at the marks, graded steps at the ends of those in which the marks are; adds the
/// ratios of estimated to true time errors.
fn compare<'a, const D: usize>(
    session: &mut Session,
    sample: &Sample<D>,
    cells: &[usize],
    marks: &[(usize, f64)],
    steppings: &'a [Stepping],
    ratios: &mut Vec<f64>,
) -> Result<Vec<Compared<'a>>> {
    let mut rows = Vec::new();
    let title = format!("{}: the exact flow", sample.key);
    let exact = session.phase(title, |_| sample.exact(Flow::Willmore, marks))?;
    (exact.iter()).try_for_each(|exact| exact.record(session, sample.key))?;
    for &n in cells {
        let mut controlled = Vec::new();
        for stepping in steppings {
            let discretization = match stepping.kind {
                NESTED => ELEMENTS,
                _ => ACCURATE,
            };
            let course = Course {
                name: &stepping.key,
                steps: stepping.steps,
                end: marks[marks.len() - 1].1,
            };
            let run = sample.run(session, n, 2.0, discretization, course)?;
            let own = (stepping.kind == GRADED).then(|| {
                let end = |&(mark, time): &(usize, f64)| (mark, truth::at(&run, time).time);
                sample.exact(Flow::Willmore, &marks.iter().map(end).collect::<Vec<_>>())
            });
            let own = own.transpose()?;
            for truth in own.as_ref().unwrap_or(&exact) {
                rows.push(Compared {
                    sample: sample.key,
                    n,
                    stepping,
                    reached: Reached::of(sample, &run, truth)?,
                });
            }
            if stepping.kind == CONTROLLED {
                controlled.push((format!("{}.n{n}.{}", sample.key, stepping.key), run));
            }
        }
        ratios.extend(time_errors(session, marks, &controlled)?);
    }
    if cells.len() > 1 {
        let exact: Vec<&Truth> = exact.iter().collect();
        sample.extrapolated(session, HALVES, &exact)?;
    }
    Ok(rows)
}

/// Distances of runs below which they are the same, a thousandth of a cell.
const SAME: f64 = 1e-5;

/// The true time errors of controlled steps, distances to the last and strictest of the runs with the same `eps`, and the ratios of estimated errors to
/// them. Cases without an estimate, after up to three steps, do not count, nor those that are nearer to the strict run than that is known to be
/// near the truth.
fn time_errors<const D: usize>(
    session: &mut Session,
    marks: &[(usize, f64)],
    runs: &[(String, Trajectory<D>)],
) -> Result<Vec<f64>> {
    let mut ratios = Vec::new();
    let Some(((_, strict), others)) = runs.split_last() else {
        return Ok(ratios);
    };
    for (name, run) in others {
        for &(mark, time) in marks {
            let [field, precise] = [run, strict].map(|run| run.field(truth::at(run, time).step));
            let eps = run.case.scales.eps;
            let error = truth::distance_of_levels(&field?, &precise?, eps);
            session.metric(&format!("{name}.time_error.step{mark}"), error)?;
            let estimated = engine::estimated_time_error(truth::until(run, time));
            let known = estimated.filter(|estimate| *estimate > 0.0 && error > SAME);
            ratios.extend(known.map(|estimate| estimate / error));
        }
    }
    Ok(ratios)
}

/// The circles of `circle_convergence` at n = 128 with the accurate operator, in equal steps of first order, in controlled ones of second order, and
/// those extrapolated in `eps` from n = 64 and 128: their mean L2 error at the end of the 64 steps, and all Hessian-vector products, which on
/// the coarser grid count by their share of the unknowns.
fn circles(session: &mut Session) -> Result<()> {
    let usual = (circles::COUNT, circles::STEPS);
    let (count, steps) = session.options.either((2, 4), usual);
    let variant = Variant::new(Flow::Willmore, ACCURATE, CELLS[1]);
    let (flow, end) = (variant.flow, time(steps));
    let operator = Chosen::default().operator(ACCURATE, variant.n)?;
    let planned = Planned { variant, operator };
    let euler = session.phase("circles: euler1", |stage| {
        Ensemble::run(&planned, count, steps, "fields", stage)
    })?;
    let hvp = |run: &Trajectory<2>| total_hvp(&run.records);
    let work = euler.circles.iter().map(|circle| hvp(&circle.trajectory));
    let mut all = [[euler.mean_error(steps), work.sum()], [0.0; 2], [0.0; 2]];
    for (k, radius) in circles::radii(count).into_iter().enumerate() {
        let mut run = |n: usize, name: &str, control| {
            let grid = circles::grid(flow, radius, steps, n)?;
            let initial = phase_field(grid, &Ball::new([0.0; 2], radius)?, 2.0 * grid.spacing())?;
            let course = Course {
                name: &format!("circle{k:02}-n{n}-{name}"),
                steps: TimeSteps::controlled(control),
                end,
            };
            let run = truth::flow(session, "circle", initial, 2.0, ACCURATE, course)?;
            Ok::<_, Error>((run.field(run.steps())?, hvp(&run)))
        };
        let [coarse, fine] = CELLS;
        // Alike on both grids, so that their errors do not add up.
        let careful = |n: usize| ErrorControl {
            relative: 0.003,
            length: None,
            longest: 0.5 * n as f64 / CELLS[1] as f64,
            first: Some(16.0 * EPS.powi(4)),
        };
        let (u, work) = run(fine, "controlled", ErrorControl::default())?;
        let (a, coarse_work) = run(coarse, "careful", careful(coarse))?;
        let (b, fine_work) = run(fine, "careful", careful(fine))?;
        let radius_of =
            |u: &Field<2>, eps| -> Result<f64> { Ok((ZeroSet::of(u, eps)?.volume / PI).sqrt()) };
        let circle = |radius| phase_field(*u.grid(), &Ball::new([0.0; 2], radius)?, EPS);
        let limit = (4.0 * radius_of(&b, EPS)? - radius_of(&a, 2.0 * EPS)?) / 3.0;
        let exact = circle(circles::radius_at(flow, radius, end))?;
        let share = (coarse as f64 / fine as f64).powi(2);
        let extrapolated = (&circle(limit)?, fine_work + share * coarse_work);
        for (sums, (field, work)) in all[1..].iter_mut().zip([(&u, work), extrapolated]) {
            sums[0] += l2_distance(field, &exact)? / count as f64;
            sums[1] += work;
        }
    }
    let names = ["euler1", "controlled", "extrapolated"];
    for (name, [l2, hvp]) in names.into_iter().zip(all) {
        let metrics = [("l2", l2.into()), ("hvp_total", hvp.into())];
        session.metrics(&format!("circles.n{}.{name}", variant.n), metrics)?;
    }
    Ok(())
}

const COLUMNS: [(&str, Format, &str); 5] = [
    ("largest distance", Scientific(2), "distance_to_exact"),
    ("estimated time error", Scientific(1), "estimated_error"),
    ("steps", Shortest, "steps"),
    ("HVP", Fixed(0), "hvp_total"),
    ("s", Fixed(1), "seconds"),
];

fn sheet<'a>(rows: &'a [Compared<'a>]) -> Sheet<'a, Compared<'a>> {
    let key = |row: &Compared<'_>, name: &str| {
        let (stepping, mark) = (&row.stepping.key, row.reached.mark);
        format!("{}.n{}.{stepping}.{name}.step{mark}", row.sample, row.n)
    };
    Sheet::of(rows)
        .keyed(key)
        .text("shape", |row| row.sample)
        .column("n", Shortest, |row| row.n)
        .text("time steps", |row| row.stepping.key.as_str())
        .column("time / 2⁻¹⁴", Shortest, |row| row.reached.mark)
        .numbers(&COLUMNS, |row| &row.reached.numbers)
}

/// Largest distances from the exact flow against work, a number of this name, for the second and the last mark.
fn figure(rows: &[Compared<'_>], marks: &[usize], axis: &str, work: &str) -> Figure {
    let mut shown: Vec<usize> = vec![marks[1.min(marks.len() - 1)], marks[marks.len() - 1]];
    shown.dedup();
    let [coarse, fine] = CELLS;
    let curves = CURVES.map(|sample| (sample.key, sample.title, [coarse, fine]));
    let surface = (SURFACE.key, SURFACE.title, [coarse / 2, fine / 2]);
    let mut figure = Figure::new(format!("{TITLE}: work and precision"), shown.len());
    for (key, title, cells) in curves.into_iter().chain([surface]) {
        for &mark in &shown {
            let mut curves: Vec<Series> = Vec::new();
            let styles = [(LineStyle::Dashed, "coarse"), (LineStyle::Solid, "fine")];
            for (n, (style, grid)) in cells.into_iter().zip(styles) {
                for (kind, colour, marker) in KINDS {
                    let own = rows.iter().filter(|row| {
                        let stepping = (row.n, row.stepping.kind) == (n, kind);
                        stepping && (row.sample, row.reached.mark) == (key, mark)
                    });
                    let mut curve = Series::of(format!("{kind}, {grid}"), own, |row| {
                        [work, "distance_to_exact"].map(|name| row.reached.numbers[name])
                    });
                    curve.points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    let curve = curve.with_colour(colour).with_style(style);
                    curves.push(curve.with_marker(marker));
                }
            }
            let title = format!("{title}, t = {mark}·2⁻¹⁴");
            let chart = LineChart::new(title, Axis::log(axis), Axis::log("largest distance"));
            figure = figure.with_panel(chart.with_curves(curves));
        }
    }
    figure.with_shared_legend().with_note(
        "HVP: Hessian-vector product. Fine: eps = 2h = 1/64, of the ellipsoid 1/32; coarse: twice that.",
    )
}
