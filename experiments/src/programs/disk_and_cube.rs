use crate::prelude::*;
use crate::surfaces::{self, Flowed, FormulationOptions, Setting, Surface, VIEW};
use crate::truth::{DISK, ELLIPSOID, Halves, Reached, Sample, THICK_DISK, Truth};

pub const EXPERIMENT: Experiment = Experiment {
    name: "disk_and_cube",
    summary: "A cube and a thick disk under Willmore flow.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "disk_and_cube",
        title: "Cube and thick disk",
        description: "Willmore flow of two solids by the hybrid scheme beside nested finite elements.",
        figures: &[(
            "surfaces",
            "The surfaces at steps 0, 1 and 100, with their Willmore energies.",
        )],
        options: Some(""),
    }],
    metrics: &[&surfaces::METRICS, &METRICS],
    words: &[("SURFACE", "`cube`, `disk`, `ellipsoid`")],
};

const METRICS: MetricTable = MetricTable {
    title: "Surfaces against the exact flow",
    note: "",
    words: &[],
    rows: &[
        (
            "SURFACE.exact.area.stepK, SURFACE.exact.volume.stepK, SURFACE.exact.w.stepK",
            "area, volume and Willmore energy of the exact flow of the surface of revolution, at `t = K 2^-18`",
        ),
        (
            "SURFACE.nN.controlled.area.stepK, SURFACE.nN.controlled.volume.stepK, SURFACE.nN.controlled.w.stepK",
            "the same of the zero set by coarea sums, from controlled steps of second order with the accurate \
             operator, `eps = 2/N`",
        ),
        (
            "SURFACE.nN.controlled.distance_to_exact.stepK",
            "largest distance of the vertices of the isosurface from the exact surface",
        ),
        (
            "SURFACE.nN.controlled.hvp_total.stepK, SURFACE.nN.controlled.steps.stepK, \
             SURFACE.nN.controlled.estimated_error.stepK",
            "Hessian-vector products and time steps so far, and their estimated time error",
        ),
        (
            "SURFACE.extrapolated.area.stepK, SURFACE.extrapolated.volume.stepK, SURFACE.extrapolated.w.stepK, \
             SURFACE.extrapolated.distance_to_exact.stepK, SURFACE.extrapolated.hvp_total.stepK, \
             SURFACE.extrapolated.steps.stepK, SURFACE.extrapolated.estimated_error.stepK",
            "the same extrapolated to `eps = 0` from strictly controlled runs with `eps = 1/32` and `1/64`, two cells \
             to each, and half of that where corners are not yet round (`K` = 1); the work is that of both",
        ),
    ],
};

const TITLE: &str = "Willmore flow of a cube and of a thick disk";
/// Cells per unit length of a quick run and of the paper.
const CELLS: [usize; 2] = [24, 64];
const TAU: f64 = 1.0 / 262_144.0;
const STEPS: usize = 100;
/// Half the side of the cube; the paper does not say, but this fits its initial energy.
const CUBE_HALF_SIDE: f64 = 0.25;
/// How often the time until the 64th step is halved to the first times at which controlled steps are compared with the exact flow.
const HALVINGS: u32 = 6;
/// The Willmore energies that the paper reports for the hybrid scheme.
const CUBE_ENERGIES: [(usize, f64); 3] = [(0, 132.65), (1, 52.26), (STEPS, 25.78)];
const DISK_ENERGIES: [(usize, f64); 3] = [(0, 87.15), (1, 50.49), (STEPS, 25.59)];

/// Willmore flow of a cube and of a thick disk, n = 64, eps = 2^-5, tautilde = 2^-12, tau = 2^-18, by the hybrid scheme and by
/// nested implicit finite elements: pictures, Willmore energies w and L2 distances after 0, 1 and 100 steps.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    figure: FigureOptions,

    /// Number of time steps [default: 100]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,

    /// Methods, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum, default_values_t = [Method::Hybrid, Method::FeImplicit])]
    methods: Vec<Method>,

    #[command(flatten)]
    formulations: FormulationOptions,
}

fn program(options: &Options) -> Result<()> {
    let [radius, half_height] = THICK_DISK;
    let run = &options.figure.run;
    let steps = (options.steps).unwrap_or(if run.quick { 2 } else { STEPS });
    // Finite elements are the paper's reference, unless another formulation is wanted of all.
    let elements = match options.formulations.formulation {
        None | Some(Formulation::Paper) => Formulation::Paper,
        Some(_) => Formulation::Calibrated,
    };
    let of_method = |&method: &Method| {
        if method.is_learned() {
            options.formulations.learned()
        } else {
            vec![Discretization::new(method, elements)]
        }
    };
    let discretizations: Vec<_> = options.methods.iter().flat_map(of_method).collect();
    let message = "--steps must be at least 1, and --methods must name a method";
    require(steps > 0 && !discretizations.is_empty(), message)?;
    let setting = Setting::new(&options.figure, &discretizations, CELLS, 1.0)?;
    let (n, grid, eps) = (setting.n, setting.grid, setting.scales.eps);
    let cube = Cuboid::new([CUBE_HALF_SIDE; 3])?.translated([0.5; 3]);
    let disk = Cylinder::new(radius, half_height)?.translated([0.5; 3]);
    let start = |key, title: &str, shape: &dyn SignedDistance<3>, energies: [(usize, f64); 3]| {
        let surface = Surface {
            key,
            title: title.to_owned(),
            shown: energies.map(|(step, w)| (step, Some(w))).to_vec(),
            view: VIEW,
        };
        phase_field(grid, shape, eps).map(|initial| (surface, initial.into()))
    };
    let surfaces = [
        start("cube", "cube", &cube, CUBE_ENERGIES)?,
        start("disk", "thick disk", &disk, DISK_ENERGIES)?,
    ];
    let variants = discretizations.iter();
    let variants: Vec<_> = variants.map(|one| (one.method, one.formulation)).collect();
    let others = json!({
        "tau": TAU, "steps": steps, "variants": variants, "cube_half_side": CUBE_HALF_SIDE, "disk_radius": radius,
        "disk_half_height": half_height,
    });
    let parameters = setting.parameters(others)?;
    let session = Session::open(EXPERIMENT.name, run, parameters)?;
    let rule = StepRule::Constant(TAU).into();
    let comparisons = |session: &mut Session, all: &mut [Flowed]| {
        compare_with_finite_elements(session, all)?;
        let mut rows = Vec::new();
        for sample in [&DISK, &ELLIPSOID] {
            rows.extend(compare_with_exact(session, sample, n, steps)?);
        }
        session.sheet(sheet(&rows, n), "exact")?;
        Ok(String::new())
    };
    setting.run(session, TITLE, &surfaces, rule, steps, comparisons)
}

/// What a run of a surface of revolution, in controlled steps or extrapolated, has reached.
struct Compared {
    surface: &'static str,
    run: String,
    reached: Reached,
}

/// Lets a surface flow in controlled steps of second order, and compares it and its extrapolation in `eps` with the exact flow after
/// 1, 2, 4, ... 64 and all steps of the paper.
fn compare_with_exact(
    session: &mut Session,
    sample: &Sample<3>,
    n: usize,
    steps: usize,
) -> Result<Vec<Compared>> {
    let powers = (0..=HALVINGS).map(|k| 1_usize << k).filter(|k| *k < steps);
    let marks = powers.chain([steps]).map(|k| (k, k as f64 * TAU));
    let marks: Vec<(usize, f64)> = marks.collect();
    let title = format!("{}: the exact flow", sample.title);
    let exact = session.phase(title, |_| sample.exact(Flow::Willmore, &marks))?;
    (exact.iter()).try_for_each(|exact| exact.record(session, sample.key))?;
    let halves = Halves {
        end: TAU * f64::from(1 << HALVINGS),
        halvings: HALVINGS,
    };
    let all: Vec<&Truth> = exact.iter().collect();
    let runs = sample.second_order(session, n, halves, &all)?;
    let mut rows = Vec::new();
    let names = [format!("n = {n}"), "extrapolated".to_owned()];
    for (run, reached) in names.into_iter().zip(runs) {
        rows.extend(reached.into_iter().map(|reached| Compared {
            surface: sample.title,
            run: run.clone(),
            reached,
        }));
    }
    Ok(rows)
}

fn sheet(rows: &[Compared], n: usize) -> Sheet<'_, Compared> {
    let mut sheet = Sheet::of(rows)
        .text("surface", |row| row.surface)
        .text("run", |row| &row.run)
        .column("step", Shortest, |row| row.reached.mark);
    for (name, digits) in [("area", 5), ("volume", 5), ("w", 3)] {
        let (exact, format) = (format!("exact {name}"), Fixed(digits));
        sheet = sheet
            .column(name, format, |row| row.reached.numbers[name])
            .column(exact, format, |row| row.reached.exact[name]);
    }
    let distance = |row: &Compared| row.reached.numbers["distance_to_exact"] * n as f64;
    sheet
        .column("largest distance / h", Fixed(3), distance)
        .column("HVP", Fixed(0), |row| row.reached.numbers["hvp_total"])
}

/// Adds the L2 distances of the learned operators to the finite elements, where both ran, to captions and metrics.
fn compare_with_finite_elements(session: &mut Session, all: &mut [Flowed]) -> Result<()> {
    let method = |one: &Flowed| one.trajectory.case.operator.discretization.method;
    let (elements, mut others): (Vec<_>, Vec<_>) =
        (all.iter_mut()).partition(|one| method(one) == Method::FeImplicit);
    for one in others.iter_mut().filter(|one| method(one).is_learned()) {
        let Some(elements) = elements.iter().find(|e| e.surface.key == one.surface.key) else {
            continue;
        };
        let key = one.key();
        for shown in one.snapshots.iter_mut().filter(|shown| shown.step > 0) {
            let step = shown.step;
            let l2 = one.trajectory.distance(step, &elements.trajectory, step)?;
            shown.caption = format!("{}\nL² distance to FE {l2:.4}", shown.caption);
            session.metric(&format!("{key}.l2_to_fe.step{step}"), l2)?;
        }
    }
    Ok(())
}
