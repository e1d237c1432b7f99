use crate::circle_figures::Drawing;
use crate::circles::{self, Ensemble};
use crate::prelude::*;
use crate::session::remove_folder;

pub const EXPERIMENT: Experiment = Experiment {
    name: "circle_convergence",
    summary: "Convergence test on circles: mean curvature flow and Willmore flow against the exact solutions.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[
        ResultFolder {
            name: "circle_convergence",
            title: "Flows of circles",
            description: "Mean curvature flow and Willmore flow of 30 circles against the exact solutions, by the hybrid \
                 scheme and by finite elements.",
            figures: &[
                (
                    "convergence",
                    "Mean L² error over the circles at the end against the resolution, mean curvature flow and Willmore flow.",
                ),
                (
                    "error_over_time",
                    "Mean L² error over the circles against time, by resolutions.",
                ),
                (
                    "error_over_radius",
                    "Error at the end against the initial radius.",
                ),
                (
                    "work_per_step",
                    "Hessian-vector products and Newton steps for each step of Willmore flow, mean over the circles.",
                ),
            ],
            options: Some(
                "--cells 64,128,256,512,1024 --methods hybrid,fe_implicit,fe_semi \
                 --without mcf.n1024.fe,willmore.n1024,willmore.n512.fe_implicit_calibrated",
            ),
        },
        ResultFolder {
            name: "circle_cost",
            title: "Accuracy against cost",
            description: "Not in the paper: what Willmore flow of circles costs by every method and scheme, n = 64 to 512, and \
                 how accurate it is.",
            figures: &[(
                "error_over_cost",
                "Error of Willmore flow at the end against the time that a circle takes.",
            )],
            options: Some(
                "--circles 2 --cells 64,128,256,512 --methods hybrid,fe_implicit,fe_semi",
            ),
        },
    ],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Circles",
    note: "The run of `circle_convergence` was paused at times and shared the machine with other work. Compare the times of `circle_cost`.",
    words: &[
        METHOD,
        (
            "FLOW",
            "`mcf`, mean curvature flow; `willmore`, Willmore flow",
        ),
    ],
    rows: &[
        (
            "FLOW.nN.METHOD.l2.stepK",
            "L2 distance to the exact solution, mean over the circles",
        ),
        (
            "FLOW.scale",
            "L2 distance between the first and the last exact solution, mean over the circles",
        ),
        (
            "willmore.nN.METHOD.hvp_per_step",
            "Hessian-vector products per time step; those on coarser grids count by their share of the unknowns",
        ),
        (
            "willmore.nN.METHOD.newton_per_step",
            "Newton steps per time step",
        ),
        (
            "willmore.nN.METHOD.seconds_per_step",
            "wall time per time step",
        ),
        (
            "willmore.nN.METHOD.energy_increases",
            "time steps in which the energy of the step did not fall or the Willmore energy rose; 0 is right",
        ),
        (
            "willmore.nN.METHOD.negative_curvature",
            "linear solves that met a direction of negative curvature",
        ),
    ],
};

/// Steps at which tables and summaries give the error.
const SHOWN_STEPS: [usize; 5] = [1, 8, 16, 32, 64];
/// Folder of finished circles, until all are finished.
const FINISHED: &str = "partial";

/// Mean curvature flow by all methods and Willmore flow by the learned operator (with --full by all) of 30 circles, eps = 2^-6, 64
/// steps of 2^-14: L2 distance to the exact solution over time, mean over the radii 0.05 pi + 0.15 pi i/30.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    study: StudyOptions,

    /// Take some of the 30 circles only, evenly chosen
    #[arg(long, value_name = "COUNT")]
    circles: Option<usize>,
}

fn program(options: &Options) -> Result<()> {
    let run = &options.study.run;
    let (all, steps) = run.either((4, 8), (circles::COUNT, circles::STEPS));
    let count = options.circles.unwrap_or(all);
    let most = circles::COUNT;
    let message = format!("--circles must be from 1 to {most}, not {count}");
    require((1..=most).contains(&count), message)?;
    // Nested finite elements take hours; everything else together some minutes.
    let usual = |method: Method, _| method.is_learned() || options.study.full;
    let willmore = options.study.variants(Flow::Willmore, usual);
    let mean_curvature = options.study.variants(Flow::MeanCurvature, |_, _| true);
    let variants = options.study.left([mean_curvature, willmore].concat())?;
    let study = Study::new(&options.study.networks, &variants)?;
    let has = |flow| study.variants().any(|variant| variant.flow == flow);
    let message =
        "no method is left for one of the two flows: choose other --methods, --scheme or --without";
    require(Flow::ALL.into_iter().all(has), message)?;
    let parameters = json!({
        "cells": study.cells, "runs": study.variants().collect::<Vec<_>>(), "networks": study.checksums(),
        "circles": count, "steps": steps, "eps": EPS, "time_step": STEP,
    });
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let mut ensembles = Vec::new();
    for planned in &study.plan {
        let Variant { flow, n, .. } = planned.variant;
        let title = format!("{}, {}, n = {n}", flow.title(), planned.variant.label());
        ensembles.push(session.phase(title, |stage| {
            Ensemble::run(planned, count, steps, FINISHED, stage)
        })?);
    }
    let report = Report { ensembles, steps };
    for (name, figure) in report.drawing().figures() {
        session.figure(figure, name)?;
    }
    report.data(&session)?;
    session.sheet(report.sheet(), "errors")?;
    for flow in Flow::ALL {
        session.metric(&format!("{flow}.scale"), report.scale(flow))?;
    }
    remove_folder(&session.output.subfolder(FINISHED)?)?;
    session.finish("Mean L2 distance to the exact solution")
}

struct Report {
    ensembles: Vec<Ensemble>,
    steps: usize,
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

    fn drawing(&self) -> Drawing {
        let scales = Flow::ALL.into_iter();
        let scales = scales.filter_map(|flow| Some((flow, self.scale(flow)?)));
        Drawing {
            averages: self.ensembles.iter().map(Ensemble::averages).collect(),
            scales: scales.collect(),
        }
    }

    fn data(&self, session: &Session) -> Result<()> {
        let times = (self.ensembles.iter()).flat_map(|e| (0..=self.steps).map(move |k| (e, k)));
        let times: Vec<(&Ensemble, usize)> = times.collect();
        let curves = Sheet::of(&times).data("flow", |(e, _)| e.variant.flow.to_string());
        let curves = Variant::columns(curves, |(e, _)| e.variant)
            .data("step", |(_, k)| *k)
            .data("time", |(_, k)| time(*k))
            .data("l2_mean", |(e, k)| e.mean_error(*k))
            .data("l2_min", |(e, k)| {
                e.errors(*k).fold(f64::INFINITY, f64::min)
            })
            .data("l2_max", |(e, k)| e.errors(*k).fold(0.0, f64::max));
        session.csv(curves, "curves")?;
        let (mut circles, mut steps) = (Vec::new(), Vec::new());
        for e in &self.ensembles {
            for circle in &e.circles {
                circles.extend(self.shown_steps().map(|k| (e, circle, k)));
                if e.variant.flow == Flow::Willmore {
                    // Without the beginning.
                    let run = (e.variant, circle.radius);
                    steps.extend(step_table::rows(run, &circle.trajectory).skip(1));
                }
            }
        }
        let sheet = Sheet::of(&circles).data("flow", |(e, ..)| e.variant.flow.to_string());
        let sheet = Variant::columns(sheet, |(e, ..)| e.variant)
            .data("radius", |(_, circle, _)| circle.radius)
            .data("step", |(.., k)| *k)
            .data("time", |(.., k)| time(*k))
            .data("l2", |(_, circle, k)| circle.error(*k));
        session.csv(sheet, "circles")?;
        let sheet = Variant::columns(Sheet::of(&steps), |step| step.run.0);
        let sheet = sheet.data("radius", |step| step.run.1);
        session.csv(step_table::columns(sheet, &steps), "steps")
    }

    /// The mean errors, and of Willmore flow the work.
    fn sheet(&self) -> Sheet<'_, Ensemble> {
        let mut sheet = Sheet::of(&self.ensembles)
            .keyed(|e, name| format!("{}.{}.{name}", e.variant.flow, e.variant.key()))
            .text("flow", |e| e.variant.flow.title())
            .column("n", Shortest, |e| e.variant.n)
            .text("method", |e| e.variant.label());
        for k in self.shown_steps() {
            let (metric, head) = (format!("l2.step{k}"), format!("step {k}"));
            sheet = sheet.measure(&metric, &head, Fixed(5), |e| e.mean_error(k));
        }
        // Of Willmore flow.
        let seconds = |e: &Ensemble| e.minimizations().next().map(|_| e.seconds_per_step());
        let hvp = |e: &Ensemble| study::mean(e.minimizations(), StepRecord::hvp);
        let newton = |e: &Ensemble| study::mean(e.minimizations(), |r| r.newton.newton as f64);
        // Steps that did not lower the energy `E[u_k, .]`, or that raised the Willmore energy.
        let raised =
            |r: &StepRecord| r.energy >= r.energy_before || r.willmore_energy > r.energy_at_rest();
        sheet
            .measure("hvp_per_step", "HVP/step", Fixed(1), hvp)
            .metric("newton_per_step", newton)
            .metric("seconds_per_step", seconds)
            .metric("energy_increases", |e| e.total(|r| raised(r).into()))
            .metric("negative_curvature", |e| {
                e.total(|r| r.newton.negative_curvature)
            })
    }
}
