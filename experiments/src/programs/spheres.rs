use crate::prelude::*;
use crate::surfaces::Setting;
use crate::training::{self, NetworkSpec, quality};
use geometry::exact::{WILLMORE_ENERGY_SPHERE, mean_curvature_radius};

pub const EXPERIMENT: Experiment = Experiment {
    name: "spheres",
    summary: "Spheres by the network for surfaces: mean curvature flow, Willmore energies, and standing still.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "spheres",
        title: "Spheres",
        description: "Not in the paper: the network for surfaces on spheres, their mean curvature flow, their energies, \
                 and whether they are stationary under Willmore flow.",
        figures: &[(
            "spheres",
            "Errors of mean curvature flow, and the Willmore energy, against the radius.",
        )],
        options: Some(""),
    }],
    metrics: &[&METRICS, &training::METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Spheres",
    note: "",
    words: &[METHOD],
    rows: &[
        (
            "spheres.rN.w",
            "`w` of the initial sphere of radius N/100, measured as for surfaces; `8 pi` is exact",
        ),
        (
            "spheres.rN[.METHOD].w_learned, spheres.rN[.METHOD].w_relaxed",
            "`w` as the scheme measures it, at the beginning and after 20 steps of Willmore flow",
        ),
        (
            "spheres.rN[.METHOD].radius_change_over_h",
            "change of the radius in these steps, in cells",
        ),
        (
            "spheres.rN[.METHOD].energy_increases, spheres.rN[.METHOD].hvp_per_step",
            "substeps in which the energy of the step rose; as for circles",
        ),
        (
            "spheres.rN.mcf.METHOD.l2.stepK",
            "L2 error under mean curvature flow",
        ),
    ],
};

const TITLE: &str = "Spheres by the network for surfaces";
/// Cells per unit length of a quick run and of the paper.
const CELLS: [usize; 2] = [32, 64];
/// Side of the box: the largest sphere, too, is seven interface widths from it.
const BOX: f64 = 1.25;
const RADII: [f64; 6] = [0.15, 0.2, 0.25, 0.3, 0.35, 0.4];
/// Steps of mean curvature flow after which errors are reported; the smallest sphere vanishes after 23 at n = 64.
const MCF_STEPS: [usize; 3] = [1, 4, 8];
const LAST: usize = MCF_STEPS.len() - 1;
/// Steps of Willmore flow, which should leave spheres alone.
const WILLMORE_STEPS: usize = 20;
const TAU: f64 = 1.0 / 262_144.0;

/// The network for surfaces on spheres, n = 64, eps = 2^-5, tautilde = 2^-12: L2 errors of mean curvature flow against
/// R^2 = r^2 - 4t beside finite elements, Willmore energies w against 8 pi, and the change of the radius in 20 steps of Willmore
/// flow, tau = 2^-18, which leaves spheres alone.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    figure: FigureOptions,
}

struct Measurement {
    radius: f64,
    /// Errors of mean curvature flow, in the order of [`of_mcf`], for each of the reported steps.
    mcf: Vec<[f64; MCF_STEPS.len()]>,
    /// `w` with the implicit finite-element step and the mass-matrix norm, as the paper measures.
    w_elements: f64,
    /// Willmore flow by the learned operator, in every formulation: [`MEASURES`] and `energy_increases`.
    willmore: Vec<Numbers>,
}

/// Measures of standing still: `w` of the start as the scheme measures it, by its factors of calibration; that of the end, where the profile is the
/// one of the scheme, which the calibration is about; radius of the ball with the final volume, less that at the beginning, in cells; the work.
const MEASURES: [(&str, Format, &str); 4] = [
    ("w", Fixed(2), "w_learned"),
    ("w in the end", Fixed(2), "w_relaxed"),
    ("change of radius / h", Fixed(4), "radius_change_over_h"),
    ("HVP/step", Fixed(1), "hvp_per_step"),
];

/// The discretizations of mean curvature flow.
fn of_mcf() -> impl Iterator<Item = Discretization> {
    study::discretizations().filter(|one| {
        let formulations = one.method.formulations(Flow::MeanCurvature);
        formulations.contains(&one.formulation)
    })
}

/// The learned operator in every formulation.
fn learned() -> impl Iterator<Item = Discretization> {
    let formulations = Method::Hybrid.formulations(Flow::Willmore).iter();
    formulations.map(|&formulation| Discretization::new(Method::Hybrid, formulation))
}

fn program(options: &Options) -> Result<()> {
    let run = &options.figure.run;
    let radii = if run.quick { &RADII[2..4] } else { &RADII };
    let willmore_steps = if run.quick { 2 } else { WILLMORE_STEPS };
    let discretizations: Vec<_> = learned().collect();
    let setting = Setting::new(&options.figure, &discretizations, CELLS, BOX)?;
    let end = MCF_STEPS[LAST] as f64 * setting.scales.mcf_step;
    let message =
        "the smallest sphere vanishes within the steps of mean curvature flow: give more --cells";
    require(mean_curvature_radius(radii[0], end, 3) > 0.0, message)?;
    let others = json!({ "tau": TAU, "willmore_steps": willmore_steps });
    let parameters = setting.parameters(others)?;
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let mut all = Vec::new();
    for &radius in radii {
        all.push(session.phase(format!("radius {radius}"), |stage| {
            measure(&setting, stage, radius, willmore_steps)
        })?);
    }
    session.sheet(sheet(&all), "spheres")?;
    if !run.quick {
        let (spec, papers) = (NetworkSpec::SURFACES, setting.operator(PAPERS)?);
        let network = &papers.network().expect("it is learned").network;
        let measured = [spec.measure(&mut session, network)?];
        let names = Sheet::of(&measured).text("network", |_| spec.name);
        session.sheet(quality(names, |measured| measured), "quality")?;
    }
    let note = format!(
        "n = {}, ε = 2/n, inner step 1/n². Energies by the schemes are those after the steps of Willmore flow, of the relaxed profile.",
        setting.n
    );
    let figure = Figure::new("Spheres", 2).with_panels([errors(&all), energies(&all)]);
    session.figure(figure.with_note(note), "spheres")?;
    session.finish(TITLE)
}

fn measure(
    setting: &Setting,
    stage: &Stage<'_>,
    radius: f64,
    willmore_steps: usize,
) -> Result<Measurement> {
    let (grid, scales) = (setting.grid, setting.scales);
    let ball = move |grid, radius| phase_field(grid, &Ball::new([0.5; 3], radius)?, scales.eps);
    let shape = format!("sphere of radius {radius}");
    let case = |discretization, tau, steps| -> Result<Case<3>> {
        let (initial, operator) = (ball(grid, radius)?, setting.operator(discretization)?);
        let rule = StepRule::Constant(tau);
        Ok(Case::willmore(
            &shape, initial, operator, scales, rule, steps,
        ))
    };
    let mut mcf = Vec::new();
    for discretization in of_mcf() {
        let exact = move |grid, t| ball(grid, mean_curvature_radius(radius, t, 3));
        let run = stage.run(Case {
            flow: Flow::MeanCurvature,
            measures: vec![Measure::distance_to(exact)],
            ..case(discretization, scales.mcf_step, MCF_STEPS[LAST])?
        })?;
        mcf.push(MCF_STEPS.map(|step| run.records()[step - 1].measures["l2"]));
    }
    let mut willmore = Vec::new();
    for discretization in learned() {
        let run = stage.run(case(discretization, TAU, willmore_steps)?)?;
        let (records, last) = (run.records(), run.records().last());
        // Of the ball with that volume.
        let radius = |volume: f64| (0.75 * volume / PI).cbrt();
        let end = last.map_or(f64::NAN, |record| record.measures["volume"]);
        let change = radius(end) - radius(run.start()["volume"]);
        let w_learned = records.first().and_then(Record::energy_at_rest);
        let w_relaxed = last.and_then(Record::willmore_energy);
        willmore.push(Numbers::from([
            ("w_learned", w_learned.unwrap_or(f64::NAN)),
            ("w_relaxed", w_relaxed.unwrap_or(f64::NAN)),
            ("radius_change_over_h", change * setting.n as f64),
            ("energy_increases", energy_increases(records) as f64),
            ("hvp_per_step", mean_hvp(records)),
        ]));
    }
    let still = case(PAPERS, TAU, 0)?;
    let (elements, u) = (still.implicit_elements()?, still.initial.field()?);
    Ok(Measurement {
        radius,
        mcf,
        w_elements: elements.willmore_energy(&u)?,
        willmore,
    })
}

/// The errors of mean curvature flow and the energies, a row for each radius.
fn sheet(all: &[Measurement]) -> Sheet<'_, Measurement> {
    let mut sheet = Sheet::of(all)
        .keyed(|m, name| format!("spheres.r{:03.0}.{name}", 100.0 * m.radius))
        .column("radius", Fixed(2), |m| m.radius);
    for (k, discretization) in of_mcf().enumerate() {
        for (j, step) in MCF_STEPS.into_iter().enumerate() {
            let head = format!("MCF error, {}, step {step}", discretization.label());
            let metric = format!("mcf.{}.l2.step{step}", discretization.key());
            sheet = sheet.measure(&metric, &head, Fixed(5), |m| m.mcf[k][j]);
        }
    }
    let relative = |m: &Measurement| m.w_elements / WILLMORE_ENERGY_SPHERE;
    sheet = sheet.measure("w", "w, FE measure", Fixed(2), |m| m.w_elements);
    sheet = sheet.column("w / 8π (FE)", Fixed(4), relative);
    for (k, discretization) in learned().enumerate() {
        let prefix = match discretization {
            PAPERS => String::new(),
            other => format!("{}.", other.key()),
        };
        let label = discretization.label();
        for (head, format, name) in MEASURES {
            let (metric, head) = (format!("{prefix}{name}"), format!("{head}, {label}"));
            sheet = sheet.measure(&metric, &head, format, |m| m.willmore[k][name]);
        }
        let increases = |m: &Measurement| m.willmore[k]["energy_increases"];
        sheet = sheet.metric(&format!("{prefix}energy_increases"), increases);
    }
    sheet
}

/// The curve of a discretization; markers tell formulations apart where lines are short.
fn curve(
    discretization: Discretization,
    all: &[Measurement],
    value: impl Fn(&Measurement) -> f64,
) -> Series {
    let marker = match discretization.formulation {
        Formulation::Paper => Marker::Circle,
        Formulation::Calibrated => Marker::Triangle,
        Formulation::Accurate => Marker::Diamond,
    };
    Series::of(discretization.label(), all, |m| [m.radius, value(m)])
        .with_colour(study::colour(discretization))
        .with_marker(marker)
}

fn errors(all: &[Measurement]) -> LineChart {
    let title = format!("Mean curvature flow, {} steps", MCF_STEPS[LAST]);
    let curves = of_mcf().enumerate();
    let curves = curves.map(|(k, one)| curve(one, all, |m| m.mcf[k][LAST]));
    LineChart::new(title, Axis::linear("radius"), Axis::log("L² error")).with_curves(curves)
}

fn energies(all: &[Measurement]) -> LineChart {
    let elements = Series::of("implicit FE measure", all, |m| [m.radius, m.w_elements]);
    let relaxed = learned().enumerate();
    let relaxed = relaxed.map(|(k, one)| curve(one, all, |m| m.willmore[k]["w_relaxed"]));
    let exact = Series::of("exact, 8π", all, |m| [m.radius, WILLMORE_ENERGY_SPHERE])
        .with_colour(Colour::Black)
        .with_style(LineStyle::Dashed);
    LineChart::new("Willmore energy", Axis::linear("radius"), Axis::linear("w"))
        .with_curves([elements.with_colour(1).with_marker(Marker::Square)])
        .with_curves(relaxed)
        .with_curves([exact])
}
