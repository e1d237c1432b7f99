//! Errors of the time steps against the exact flow, and what they cost.

use std::collections::BTreeMap;

use engine::{ErrorControl, Order, Samples, Stop, TimeSteps, Trajectory};
use experiments::networks::STEP;
use experiments::prelude::*;
use experiments::surfaces::willmore_flow;
use geometry::ZeroSet;
use geometry::contour::{Interpolation, zero_level};
use geometry::shapes::{Cross, Cuboid, Ellipse};
use model::Networks;
use reference::planar;
use solver::NewtonParams;

const TITLE: &str = "Time steps of Willmore flow against the exact flow";

/// A shape, its phase field, and the same for the exact flow.
struct Sample {
    key: &'static str,
    title: &'static str,
    side: f64,
    initial: fn(Grid<2>, f64) -> Result<Field<2>, geometry::Error>,
    exact: fn() -> Result<reference::Shape, reference::Error>,
}

const SAMPLES: [Sample; 3] = [
    Sample {
        key: "cross",
        title: "Cross",
        side: 2.0,
        initial: |grid, eps| phase_field(grid, &Cross::new(0.8, 0.27)?, eps),
        exact: || reference::Shape::cross(0.8, 0.27),
    },
    Sample {
        key: "rectangle",
        title: "Rectangle",
        side: 1.25,
        initial: |grid, eps| phase_field(grid, &Cuboid::new([0.2, 0.1])?, eps),
        exact: || reference::Shape::rectangle(0.2, 0.1),
    },
    Sample {
        key: "ellipse",
        title: "Ellipse",
        side: 1.25,
        initial: |grid, eps| phase_field(grid, &Ellipse::new([0.3, 0.2])?, eps),
        exact: || reference::Shape::ellipse(0.3, 0.2),
    },
];

/// Cells per unit length, two to `eps`: the errors of the two are extrapolated to `eps = 0`.
const CELLS: [usize; 2] = [64, 128];
/// Times at which flows are compared, in units of `2^-14`.
const MARKS: [usize; 4] = [8, 32, 64, 128];
/// Steps that end at powers of two, from 8 on.
const MARKED: StepRule = StepRule::Ramp {
    tau: 128.0 * STEP,
    halvings: 4,
};

/// A way to make time steps, as a curve in the figure.
struct Stepping {
    key: String,
    curve: &'static str,
    steps: TimeSteps,
    newton: NewtonParams,
}

fn steppings(quick: bool) -> Vec<Stepping> {
    let euler = [1, 2, 4].map(|parts| Stepping {
        key: format!("euler{parts}"),
        curve: "implicit Euler, equal steps",
        steps: StepRule::Constant(STEP / f64::from(parts)).into(),
        newton: NewtonParams::default(),
    });
    let equal = [0.5, 1.0, 2.0].map(|parts: f64| Stepping {
        key: format!("second_order{parts}"),
        curve: "second order, equal steps",
        steps: TimeSteps {
            order: Order::Second,
            ..StepRule::Constant(STEP / parts).into()
        },
        newton: NewtonParams::second_order(),
    });
    let kinds = [
        ("_loose", 0.08, 2.0),
        ("", 0.02, 1.0),
        ("_strict", 0.005, 0.5),
    ];
    let controlled = kinds.map(|(suffix, relative, longest)| Stepping {
        key: format!("controlled{suffix}"),
        curve: "second order, controlled steps",
        steps: TimeSteps {
            order: Order::Controlled(ErrorControl {
                relative,
                longest,
                first: None,
            }),
            ..MARKED.into()
        },
        newton: NewtonParams::second_order(),
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
struct Options {
    #[command(flatten)]
    run: RunOptions,
}

fn main() -> ExitCode {
    harness::main(|options: &Options| program(&options.run))
}

/// Lengths, area and energy of a curve.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    tip: f64,
    diagonal: f64,
    area: f64,
    perimeter: f64,
    w: f64,
}

impl Sizes {
    const NAMES: [&str; 5] = ["tip", "diagonal", "area", "perimeter", "w"];

    fn values(&self) -> [f64; 5] {
        [self.tip, self.diagonal, self.area, self.perimeter, self.w]
    }

    fn of_curve(curve: &reference::Curve) -> Self {
        let along = |direction| curve.distance_along(direction).unwrap_or(f64::NAN);
        Self {
            tip: along([1.0, 0.0]),
            diagonal: along([1.0, 1.0]),
            area: curve.area(),
            perimeter: curve.length(),
            w: curve.energy(),
        }
    }

    /// `(4 b - a) / 3` of sizes at `2 eps` and at `eps`, the error being of second order in `eps`.
    fn extrapolated(double: &Self, single: &Self) -> Self {
        let pair = |a: f64, b: f64| (4.0 * b - a) / 3.0;
        Self {
            tip: pair(double.tip, single.tip),
            diagonal: pair(double.diagonal, single.diagonal),
            area: pair(double.area, single.area),
            perimeter: pair(double.perimeter, single.perimeter),
            w: pair(double.w, single.w),
        }
    }
}

/// A run at a mark.
struct Compared {
    sample: &'static str,
    n: usize,
    stepping: String,
    curve: &'static str,
    mark: usize,
    sizes: Sizes,
    distance: f64,
    hvp: f64,
    seconds: f64,
    /// Steps so far, and the sum of their estimated errors.
    steps: usize,
    estimated: f64,
}

fn program(options: &RunOptions) -> Result<(), Error> {
    let marks = if options.quick {
        &MARKS[..1]
    } else {
        &MARKS[..]
    };
    let cells = if options.quick {
        &CELLS[..1]
    } else {
        &CELLS[..]
    };
    let parameters = json!({ "marks": marks, "cells": cells, "time_unit": STEP, "eps_over_h": 2 });
    let device = options.open_device()?;
    let mut session = Session::open("work_precision", options, device, parameters)?;
    let mut rows = Vec::new();
    for sample in &SAMPLES {
        let times: Vec<f64> = marks.iter().map(|&k| k as f64 * STEP).collect();
        let title = format!("{}: the exact flow", sample.key);
        let curves = session.phase(title, |_| {
            let shape = (sample.exact)()?;
            Ok(planar::evolve(
                &shape,
                reference::Flow::Willmore,
                &times,
                &planar::ACCURACY,
            )?)
        })?;
        for (mark, curve) in marks.iter().zip(&curves) {
            let named = Sizes::NAMES
                .into_iter()
                .zip(Sizes::of_curve(curve).values());
            for (name, value) in named {
                session.metric(&format!("{}.exact.{name}.step{mark}", sample.key), value)?;
            }
        }
        for &n in cells {
            for stepping in steppings(options.quick) {
                let run = sample.run(&mut session, n, &stepping, marks)?;
                for (&mark, curve) in marks.iter().zip(&curves) {
                    rows.push(sample.compare(n, &stepping, &run, (mark, curve))?);
                }
            }
        }
    }
    for (key, sizes) in extrapolations(&rows) {
        for (name, value) in Sizes::NAMES.into_iter().zip(sizes.values()) {
            let (sample, mark) = key;
            session.metric(&format!("{sample}.extrapolated.{name}.step{mark}"), value)?;
        }
    }
    session.figure(figure(&rows, marks), "work_precision")?;
    session.sheet(sheet(&rows), "errors")?;
    session.finish(TITLE)
}

impl Sample {
    fn run(
        &self,
        session: &mut Session<'_>,
        n: usize,
        stepping: &Stepping,
        marks: &[usize],
    ) -> Result<Trajectory<2>, Error> {
        let grid = Grid::<2>::per_unit(n, self.side)?;
        let scales = Scales {
            newton: stepping.newton,
            ..Scales::of_grid(grid.spacing(), 2.0)
        };
        let needed = scales.needs(2, grid.spacing());
        let network = Networks::default().find(Scheme::Accurate.shipped(), &needed)?;
        let operator = Operator::learned(Scheme::Accurate, network)?;
        let initial = (self.initial)(grid, scales.eps)?;
        let end = marks[marks.len() - 1] as f64 * STEP;
        let mut case = willmore_flow(self.key, initial, operator, scales, (MARKED, 1));
        case.steps = stepping.steps;
        case.stops = vec![Stop::Time(end)];
        case.measures = Measure::crossings(0.0);
        let name = format!("{}-n{n}-{}", self.key, stepping.key);
        let every = match stepping.steps.rule {
            StepRule::Constant(tau) => (8.0 * STEP / tau).round() as usize,
            _ => 1,
        };
        session.trajectory(&name, case, &name, &Samples::every(every))
    }

    fn compare(
        &self,
        n: usize,
        stepping: &Stepping,
        run: &Trajectory<2>,
        (mark, exact): (usize, &reference::Curve),
    ) -> Result<Compared, Error> {
        let time = mark as f64 * STEP;
        let count = run
            .records
            .partition_point(|record| record.time < time * (1.0 - 1e-9))
            + 1;
        let so_far = &run.records[..count];
        let last = &so_far[count - 1];
        let field = run.field(last.step)?;
        let zero_set = ZeroSet::of(&field, run.case.scales.eps)?;
        let level = zero_level(&field, Interpolation::Profile);
        let points: Vec<[f64; 2]> = level.into_iter().flat_map(|curve| curve.points).collect();
        let made = so_far
            .iter()
            .filter_map(|record| record.minimization?.estimates?.error);
        let measured = |name| last.measure(name).unwrap_or(f64::NAN);
        Ok(Compared {
            sample: self.key,
            n,
            stepping: stepping.key.clone(),
            curve: stepping.curve,
            mark,
            sizes: Sizes {
                tip: measured("tip"),
                diagonal: measured("diagonal"),
                area: zero_set.volume,
                perimeter: zero_set.perimeter,
                w: zero_set.willmore_energy,
            },
            distance: exact.largest_distance_of(&points),
            hvp: so_far.iter().filter_map(Record::hvp).sum(),
            seconds: so_far.iter().map(|record| record.seconds).sum(),
            steps: count,
            estimated: made.sum(),
        })
    }
}

/// The strictly controlled runs at both `eps`, extrapolated, by shape and mark.
fn extrapolations(rows: &[Compared]) -> BTreeMap<(&'static str, usize), Sizes> {
    let mut all = BTreeMap::new();
    let controlled = |n| {
        rows.iter()
            .filter(move |row| row.n == n && row.stepping == "controlled_strict")
    };
    for single in controlled(CELLS[1]) {
        let same = |row: &&Compared| (row.sample, row.mark) == (single.sample, single.mark);
        if let Some(double) = controlled(CELLS[0]).find(same) {
            let sizes = Sizes::extrapolated(&double.sizes, &single.sizes);
            all.insert((single.sample, single.mark), sizes);
        }
    }
    all
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
    for (i, name) in Sizes::NAMES.into_iter().enumerate() {
        sheet = sheet.metric(name, move |row| row.sizes.values()[i]);
    }
    sheet
        .measure(
            "distance_to_exact",
            ("largest distance", Scientific(2)),
            |row| row.distance,
        )
        .measure(
            "estimated_error",
            ("estimated time error", Scientific(1)),
            |row| (row.estimated > 0.0).then_some(row.estimated),
        )
        .measure("steps", ("steps", Shortest), |row| row.steps)
        .measure("hvp_total", ("HVP", Fixed(0)), |row| row.hvp)
        .measure("seconds", ("s", Fixed(1)), |row| row.seconds)
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
                let kinds = [
                    "implicit Euler, equal steps",
                    "second order, equal steps",
                    "second order, controlled steps",
                ];
                let looks = [
                    (1, Marker::Square),
                    (0, Marker::Triangle),
                    (2, Marker::Circle),
                ];
                for (kind, (colour, marker)) in kinds.into_iter().zip(looks) {
                    let here = |row: &&Compared| {
                        (row.sample, row.n, row.curve, row.mark) == (sample.key, n, kind, mark)
                    };
                    let mut points: Vec<[f64; 2]> = rows
                        .iter()
                        .filter(here)
                        .map(|row| [row.hvp, row.distance])
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
