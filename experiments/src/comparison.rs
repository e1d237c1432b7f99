//! A shape by all methods and resolutions, against a finer run as in the paper, and against the exact flow.

use geometry::measure::perimeter;

use crate::prelude::*;
use crate::truth::{CELLS, Halves, Reached, Sample, Truth};

/// The figures of every shape.
pub const FIGURES: Figures = &[
    (
        "shapes",
        "The curve at the times that the paper shows; orange: the reference.",
    ),
    (
        "errors",
        "L² distance to the reference, and distance to the exact flow, against time.",
    ),
];

/// What is said about every shape.
pub const METRICS: MetricTable = MetricTable {
    title: "Cross and rectangle",
    note: "",
    words: &[METHOD],
    rows: &[
        ("SHAPE.nN.METHOD.l2.stepK", "L2 distance to the reference"),
        (
            "SHAPE.nN.METHOD.tip.stepK, SHAPE.nN.METHOD.diagonal.stepK",
            "distance from the centre to the zero crossing on the positive x axis, on the diagonal",
        ),
        (
            "SHAPE.nN.METHOD.area.stepK, SHAPE.nN.METHOD.perimeter.stepK",
            "area of `{u > 0}`, perimeter `P_eps`",
        ),
        (
            "SHAPE.nN.METHOD.energy.stepK",
            "energy `e[u_(k-1), u_k]` that the step minimized",
        ),
        (
            "SHAPE.nN.METHOD.hvp_per_step, SHAPE.nN.METHOD.newton_per_step, SHAPE.nN.METHOD.energy_increases",
            "as for circles; steps in which the energy of the step rose",
        ),
        ("SHAPE.nN.METHOD.seconds", "wall time of all steps"),
        (
            "SHAPE.reference.n, SHAPE.reference.seconds",
            "cells per unit length and wall time of the reference, implicit finite elements",
        ),
        (
            "SHAPE.reference.l2_to_half_n",
            "largest L2 distance of the reference to the same run with half as many cells",
        ),
        (
            "SHAPE.nN.METHOD.distance_to_exact.stepK, SHAPE.reference.distance_to_exact.stepK",
            "largest distance of the zero level from the exact curve",
        ),
        (
            "SHAPE.exact.tip.stepK, SHAPE.exact.diagonal.stepK, SHAPE.exact.area.stepK, SHAPE.exact.perimeter.stepK, \
             SHAPE.exact.w.stepK",
            "of the exact curve at `t = K 2^-14`: the extents, area, length and Willmore energy",
        ),
        (
            "SHAPE.nN.controlled.tip.stepK, SHAPE.nN.controlled.diagonal.stepK, SHAPE.nN.controlled.area.stepK, \
             SHAPE.nN.controlled.perimeter.stepK, SHAPE.nN.controlled.w.stepK",
            "the same of the zero set by coarea sums, from controlled steps of second order with the accurate \
             operator, `eps = 2/N`",
        ),
        (
            "SHAPE.nN.controlled.distance_to_exact.stepK, SHAPE.nN.controlled.hvp_total.stepK, \
             SHAPE.nN.controlled.steps.stepK, SHAPE.nN.controlled.estimated_error.stepK",
            "its largest distance from the exact curve, its Hessian-vector products and time steps so far, and their \
             estimated time error",
        ),
        (
            "SHAPE.extrapolated.tip.stepK, SHAPE.extrapolated.diagonal.stepK, SHAPE.extrapolated.area.stepK, \
             SHAPE.extrapolated.perimeter.stepK, SHAPE.extrapolated.w.stepK, \
             SHAPE.extrapolated.distance_to_exact.stepK, SHAPE.extrapolated.hvp_total.stepK, \
             SHAPE.extrapolated.steps.stepK, SHAPE.extrapolated.estimated_error.stepK",
            "the same extrapolated to `eps = 0` from strictly controlled runs with `eps = 1/64` and `1/128`, four \
             cells to each; the work is that of both",
        ),
    ],
};

pub struct Setting {
    /// Name of the experiment, and prefix of the metrics.
    pub program: &'static str,
    pub title: &'static str,
    /// The help.
    pub about: &'static str,
    /// Name of the shape with its measures.
    pub shape: &'static str,
    pub sample: Sample<2>,
    pub flow: Flow,
    pub shown: &'static [usize],
    /// Steps of the reference per step of the compared runs.
    pub reference_ratio: usize,
    pub window: f64,
}

/// Time steps of `2^-14`.
const STEPS: usize = 128;

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

/// Runs an experiment with these settings.
pub fn run(own: &Experiment, setting: &Setting) -> ExitCode {
    own.run_with_help(setting.about, |options| compare(setting, options))
}

const MEASURES: [&str; 4] = ["tip", "diagonal", "perimeter", "area"];

struct Compared {
    variant: Variant,
    trajectory: Trajectory<2>,
    /// Its steps for each of `2^-14`.
    ratio: usize,
    /// Steps of `2^-14` and `L2` distances; none for the reference itself.
    errors: BTreeMap<usize, f64>,
    /// Such steps and the largest distances to the exact curve.
    from_exact: BTreeMap<usize, f64>,
}

struct Comparison<'a> {
    setting: &'a Setting,
    steps: usize,
    study: Study,
    runs: Vec<Compared>,
    /// The reference, and perhaps the same at half its resolution, to estimate its error.
    references: Vec<Compared>,
    exact: Vec<Truth>,
    /// Runs of second order with their names, at the times at which they are compared with the exact flow.
    second_order: Vec<(String, Vec<Reached>)>,
}

/// What a run is compared with: a reference, unless it is the same one, and the exact flow.
#[derive(Clone, Copy)]
struct Yardsticks<'a> {
    reference: Option<&'a Compared>,
    exact: &'a [Truth],
}

fn compare(setting: &Setting, options: &Options) -> Result<()> {
    let (flow, quick, cells) = (setting.flow, options.study.run.quick, options.study.cells());
    let finest = cells.iter().copied().max().unwrap_or(0);
    let usual = if quick { finest } else { 2 * finest };
    let reference_n = options.reference_n.unwrap_or(usual);
    for n in &cells {
        let message = format!(
            "--reference-n {reference_n} must be a multiple of every n compared with it, also of {n}"
        );
        require(reference_n.is_multiple_of(*n), message)?;
    }
    let steps = (options.steps).unwrap_or(if quick { 2 } else { STEPS });
    require(steps > 0, "--steps must be at least 1")?;
    // Franken, Rumpf and Wirth: for eps = 2h the nested scheme is unstable.
    let nested = |method: Method| flow == Flow::Willmore && !method.is_learned();
    let stable = |method, n| !nested(method) || n as f64 * EPS >= 4.0;
    let variants = options.study.left(options.study.variants(flow, stable))?;
    let study = Study::new(&options.study.networks, &variants)?;
    let message = "no method is left: choose other --methods, --scheme, --cells or --without";
    require(!study.plan.is_empty(), message)?;
    let parameters = json!({
        "shape": setting.shape, "flow": flow, "side": setting.sample.side,
        "cells": cells, "reference_n": reference_n, "reference_steps_per_step": setting.reference_ratio,
        "eps": EPS, "time_step": STEP, "steps": steps, "networks": study.checksums(),
        "runs": study.variants().collect::<Vec<_>>(),
    });
    let mut session = Session::open(setting.program, &options.study.run, parameters)?;
    let marks: Vec<_> = sampled(steps).skip(1).map(|k| (k, time(k))).collect();
    let exact = session.phase("the exact flow", |_| setting.sample.exact(flow, &marks))?;
    let half = reference_n / 2;
    let halved = (reference_n.is_multiple_of(2) && finest <= half).then_some(half);
    let mut references: Vec<Compared> = Vec::new();
    for n in [Some(reference_n), halved].into_iter().flatten() {
        let what = ["reference: ", "for the reference's error: "][references.len()];
        let planned = Planned {
            variant: Variant::new(flow, ELEMENTS, n),
            operator: study.networks.operator(ELEMENTS, n)?,
        };
        let to = Yardsticks {
            reference: references.first(),
            exact: &exact,
        };
        let ratio = setting.reference_ratio;
        let run = setting.run(&mut session, what, &planned, steps, ratio, to)?;
        references.push(run);
    }
    let mut runs = Vec::new();
    let to = Yardsticks {
        reference: references.first(),
        exact: &exact,
    };
    for planned in &study.plan {
        runs.push(setting.run(&mut session, "", planned, steps, 1, to)?);
    }
    let mut second_order = Vec::new();
    if flow == Flow::Willmore {
        // At the end and at halves of that time.
        let halvings = (steps / 8).checked_ilog2().unwrap_or(0);
        let halvings = halvings.min(steps.trailing_zeros());
        let is_half = |mark: usize| (0..=halvings).any(|k| mark == steps >> k);
        let exact: Vec<&Truth> = exact.iter().filter(|exact| is_half(exact.mark)).collect();
        let (n, end) = (CELLS[1], time(steps));
        let halves = Halves { end, halvings };
        let reached = (setting.sample).second_order(&mut session, n, halves, &exact)?;
        let controlled = format!("second order, controlled steps, n = {n}");
        let labels = [controlled, "second order, extrapolated to ε = 0".to_owned()];
        second_order.extend(labels.into_iter().zip(reached));
    }
    let comparison = Comparison {
        setting,
        steps,
        study,
        runs,
        references,
        exact,
        second_order,
    };
    comparison.write(session)
}

impl Setting {
    /// A run in so many steps of `2^-14`, each divided into `ratio` of its own, and how far it is from the yardsticks.
    fn run(
        &self,
        session: &mut Session,
        what: &str,
        planned: &Planned,
        steps: usize,
        ratio: usize,
        to: Yardsticks<'_>,
    ) -> Result<Compared> {
        let Planned { variant, operator } = planned;
        let grid = Grid::<2>::per_unit(variant.n, self.sample.side)?;
        let initial = (self.sample.initial)(grid, EPS)?;
        let (tau, count) = (STEP / ratio as f64, steps * ratio);
        let mut case = planar_flow(self.flow, operator, self.shape, initial, tau, count);
        case.measures = Measure::crossings(0.0);
        case.measures.extend([
            Measure::new("perimeter", |u, _| perimeter(u, EPS).map(Some)),
            Measure::new("area", |u, _| Ok(Some(zero_set_volume(u)))),
        ]);
        let title = format!("{what}{}, n = {}", variant.label(), variant.n);
        let name = format!("{}-{ratio}", variant.key());
        let trajectory = session.trajectory(&title, case, &name, &samples(ratio))?;
        let (mut errors, mut from_exact) = (BTreeMap::new(), BTreeMap::new());
        if let Some(reference) = to.reference
            && (reference.variant, reference.ratio) != (*variant, ratio)
        {
            for k in sampled(steps) {
                let (own, its) = (k * ratio, k * reference.ratio);
                errors.insert(k, trajectory.distance(own, &reference.trajectory, its)?);
            }
        }
        for Truth { mark, outline, .. } in to.exact {
            let points = (self.sample.level)(&trajectory.field(mark * ratio)?, EPS)?;
            from_exact.insert(*mark, outline.largest_distance_of(&points));
        }
        Ok(Compared {
            variant: *variant,
            trajectory,
            ratio,
            errors,
            from_exact,
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

fn sampled(steps: usize) -> impl Iterator<Item = usize> {
    (0..=steps).filter(move |&step| samples(1).holds(step) || step == steps)
}

impl Compared {
    fn loops(&self, step: usize) -> Result<Curve> {
        let field = self.trajectory.field(step * self.ratio)?;
        Ok(study::zero_level_curve(&field))
    }
}

impl Comparison<'_> {
    fn shown(&self) -> Vec<usize> {
        let drawn = |step: &usize| self.setting.shown.contains(step) || *step == self.steps;
        sampled(self.steps).filter(drawn).collect()
    }

    fn reference(&self) -> &Compared {
        &self.references[0]
    }

    /// Largest distance over time between the reference and the same method at half the resolution.
    fn reference_difference(&self) -> Option<f64> {
        let errors = self.references.get(1)?.errors.values();
        Some(errors.copied().fold(0.0, f64::max))
    }

    fn about_the_reference(&self) -> String {
        let n = self.reference().variant.n;
        let step = match self.reference().ratio {
            1 => String::new(),
            ratio => format!(", {ratio} steps for each"),
        };
        let estimate = self.reference_difference().map_or(String::new(), |distance| {
            let (half, error) = (n / 2, distance / 3.0);
            format!(
                "; it differs from n = {half} by at most {distance:.1e}, so its own error in h is about {error:.0e}"
            )
        });
        format!("Reference: implicit finite elements, n = {n}{step}{estimate}.")
    }

    fn write(&self, mut session: Session) -> Result<()> {
        session.figure(self.error_figure(), "errors")?;
        session.figure(self.shape_figure()?, "shapes")?;
        session.sheet(self.sheet(), "error_table")?;
        session.remark(self.about_the_reference());
        self.data(&session)?;
        let (program, reference) = (self.setting.program, self.reference());
        let metrics = [
            ("reference.n", reference.variant.n.into()),
            ("reference.seconds", reference.trajectory.seconds().into()),
            ("reference.l2_to_half_n", self.reference_difference().into()),
        ];
        session.metrics(program, metrics)?;
        for (k, distance) in &reference.from_exact {
            let name = format!("{program}.reference.distance_to_exact.step{k}");
            session.metric(&name, *distance)?;
        }
        (self.exact.iter()).try_for_each(|exact| exact.record(&mut session, program))?;
        session.finish(self.setting.title)
    }

    fn data(&self, session: &Session) -> Result<()> {
        let mut errors = Vec::new();
        for run in &self.runs {
            errors.extend(run.errors.iter().map(|(step, l2)| (run, *step, *l2)));
        }
        let errors = Variant::columns(Sheet::of(&errors), |(run, ..)| run.variant)
            .data("step", |(_, step, _)| *step)
            .data("time", |(_, step, _)| time(*step))
            .data("l2", |(.., l2)| *l2)
            .data("distance_to_exact", |(run, step, _)| {
                run.from_exact.get(step).copied()
            });
        session.csv(errors, "errors")?;
        let compared = self.runs.iter().map(|run| (run, "false"));
        let all = compared.chain(self.references.iter().map(|run| (run, "true")));
        let steps = all.flat_map(|run| step_table::rows(run, &run.0.trajectory));
        let steps: Vec<_> = steps.collect();
        let sheet = Variant::columns(Sheet::of(&steps), |step| step.run.0.variant)
            .data("reference", |step| step.run.1);
        session.csv(step_table::columns(sheet, &steps), "steps")
    }

    fn error_figure(&self) -> Figure {
        let chart = |title, y, distances: fn(&Compared) -> &BTreeMap<usize, f64>| {
            let compared = self.runs.iter().filter(|run| !distances(run).is_empty());
            let curves = compared.map(|run| {
                let points = distances(run).iter();
                let points = points.map(|(&k, &distance)| [time(k), distance]);
                self.study.series(run.variant, points.collect())
            });
            let chart = LineChart::new(title, Axis::linear("time t"), Axis::log(y));
            self.study.chart(chart, curves)
        };
        // The reference may be all that is compared.
        let papers = self.runs.iter().any(|run| !run.errors.is_empty());
        let papers = papers.then(|| chart("to the reference", "L² distance", |run| &run.errors));
        let largest = "largest distance of the curves";
        let mut exact = chart("to the exact flow", largest, |run| &run.from_exact);
        let (mut entries, styles) = (Vec::new(), [LineStyle::Solid, LineStyle::Dotted]);
        for ((label, reached), style) in self.second_order.iter().zip(styles) {
            let series = Series::of(label, reached, |at| {
                [time(at.mark), at.numbers["distance_to_exact"]]
            });
            let series = series.with_colour(Colour::Grey).with_style(style);
            exact = exact.with_curves([series.with_marker(Marker::Circle)]);
            entries.push(LegendEntry::line(label, Colour::Grey, style));
        }
        let reference = self.about_the_reference();
        let panels: Vec<_> = papers
            .into_iter()
            .chain([exact.with_entries(entries)])
            .collect();
        let title = format!("{}: distances over time", self.setting.title);
        Figure::new(title, panels.len())
            .with_panels(panels)
            .with_shared_legend()
            .with_note(format!("ε = 2⁻⁶, time step 2⁻¹⁴. {reference}"))
    }

    /// Rows: methods at their finest resolution, and the reference; columns: times.
    fn shape_figure(&self) -> Result<Figure> {
        let mut rows: Vec<(&Compared, String)> = Vec::new();
        for shown in study::discretizations() {
            let own =
                |run: &&Compared| run.variant.discretization == shown && !run.errors.is_empty();
            if let Some(run) = self.runs.iter().filter(own).max_by_key(|run| run.variant.n) {
                rows.push((run, run.variant.label().replace(", ", "\n")));
            }
        }
        rows.push((self.reference(), "reference".to_owned()));
        let label = |(run, label): &(&Compared, String)| format!("{label}\nn = {}", run.variant.n);
        let (shown, half) = (self.shown(), self.setting.window);
        let about = self.about_the_reference();
        let note = format!("Orange: the reference. Blue: the exact flow. {about}");
        let mut figure = Figure::new(format!("{}: shapes", self.setting.title), shown.len())
            .with_column_labels(shown.iter().map(|&k| format!("t = {}", time_label(k))))
            .with_row_labels(rows.iter().map(label))
            .with_note(note);
        for (run, _) in &rows {
            for &step in &shown {
                let curve = run.loops(step)?.filled(Colour::LightGrey);
                let mut panel = Shapes::new("", [[-half, half]; 2]).with_curve(curve);
                if !run.errors.is_empty() {
                    let reference = self.reference().loops(step)?;
                    panel = panel.with_curve(reference.with_colour(1).with_width(1.0));
                }
                if let Some(exact) = self.exact.iter().find(|exact| exact.mark == step) {
                    let exact = Curve::new([exact.outline.points()]).with_colour(0);
                    panel = panel.with_curve(exact.with_width(1.0));
                }
                figure = figure.with_panel(panel);
            }
        }
        Ok(figure)
    }

    /// Errors, measures and energies over time, and the work.
    fn sheet(&self) -> Sheet<'_, Compared> {
        let mut sheet = Sheet::of(&self.runs)
            .keyed(|run, name| format!("{}.{}.{name}", self.setting.program, run.variant.key()))
            .text("method", |run| run.variant.label())
            .column("n", Shortest, |run| run.variant.n);
        for k in self.shown().into_iter().filter(|k| *k > 0) {
            let error = |run: &Compared| run.errors.get(&k).copied();
            sheet = sheet.column(format!("error, step {k}"), Fixed(5), error);
        }
        for k in sampled(self.steps) {
            let energy = |run: &Compared| Some(run.trajectory.record(k)?.minimization?.energy);
            sheet = sheet
                .metric(&format!("l2.step{k}"), |run| run.errors.get(&k).copied())
                .metric(&format!("energy.step{k}"), energy)
                .metric(&format!("distance_to_exact.step{k}"), |run| {
                    run.from_exact.get(&k).copied()
                });
            for name in MEASURES {
                sheet = sheet.metric(&format!("{name}.step{k}"), |run| {
                    run.trajectory.measures(k)?.get(name).copied()
                });
            }
        }
        let of_steps = |run: &Compared, of: fn(&StepRecord) -> f64| {
            study::mean(minimizations(&run.trajectory.records), of)
        };
        let hvp = |run: &Compared| of_steps(run, StepRecord::hvp);
        let newton = |run: &Compared| of_steps(run, |made| made.newton.newton as f64);
        let per_step = |run: &Compared| run.trajectory.seconds() / run.trajectory.steps() as f64;
        let increases = |run: &Compared| energy_increases(&run.trajectory.records);
        sheet
            .measure("hvp_per_step", "HVP/step", Fixed(1), hvp)
            .column("s/step", Fixed(2), per_step)
            .metric("newton_per_step", newton)
            .metric("energy_increases", |run| {
                newton(run).map(|_| increases(run))
            })
            .metric("seconds", |run| run.trajectory.seconds())
    }
}

/// A multiple of `2^-14` as the paper writes it: `0`, `2⁻⁹`, `3·2⁻⁹`.
fn time_label(step: usize) -> String {
    if step == 0 {
        return "0".to_owned();
    }
    let power = step.trailing_zeros();
    let unit = study::power_of_two(time(1 << power));
    match step >> power {
        1 => unit,
        factor => format!("{factor}·{unit}"),
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
}
