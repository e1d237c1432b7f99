use crate::learning::{
    AdamParams, Correction, Curves, Example, Form, Pair, Taught, energy_of_exact_steps,
    from_energy, from_pairs,
};
use crate::prelude::*;
use direct::DirectSteps;
use reference::Curve;

pub const EXPERIMENT: Experiment = Experiment {
    name: "direct_learning",
    summary: "What a direct step of Willmore flow misses, and how much of it can be learned.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "direct_learning",
        title: "Learning beside the direct step",
        description: "Not in the paper: corrections of the derived step of Willmore flow, learned from exact flows and from the energy alone, \
                 on curves that they have and have not seen.",
        figures: &[
            (
                "errors",
                "Errors of one step over the motion, on curves that were taught and on others.",
            ),
            (
                "rollouts",
                "Largest distance to the exact curve over fifty steps, on curves that were not taught.",
            ),
            (
                "multipliers",
                "Factors of small waves on a circle in one step.",
            ),
        ],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Learning beside the direct step",
    note: "A step of size `tau` of a curve of largest curvature `kappa`; circles that are taught are less curved than that.",
    words: &[
        (
            "CURVES",
            "`training_circles`, `training_ellipses` and `training_waves`, which were taught; the others were not: `ellipse`, `waves` of another \
             seed, `cross` and `rectangle` from the time 32 / 16384 on",
        ),
        (
            "CORRECTION",
            "`derived`, the direct step, without one; `extrapolated`, two half steps and a whole one; `curvature`, a function of the \
             curvature alone, taught by circles; `geometry`, one of the curvature and the motion; `filters`, a pointwise network of the heat \
             kernels; `energy`, the same without exact flows",
        ),
    ],
    rows: &[
        (
            "CURVES.tauN.CORRECTION.rms, CURVES.tauN.CORRECTION.largest",
            "error of one step with `tau kappa^4 = N` at nodes next to the interface: the root of the mean square over that of the motion, and the \
             largest error over the largest motion; of several curves the root of the mean square, and the largest",
        ),
        (
            "CURVES.CORRECTION.rollout",
            "largest distance to the exact curve after the last of the steps, times `kappa`",
        ),
        (
            "CORRECTION.multiplier, CORRECTION.fast_multiplier",
            "largest absolute factor of a small wave on a circle in one step, over wave numbers, and over those of fast waves, whose exact factor \
             is below a hundredth",
        ),
        (
            "CORRECTION.loss_before, CORRECTION.loss_after",
            "loss of the first and of the last step of the training: the mean of the squared error over that of the derived step; of `energy` \
             by how much the mean energy is above that of the derived step, over that of its motion",
        ),
        (
            "CORRECTION.loss_exact",
            "what the latter is for exact steps",
        ),
    ],
};

/// Sizes of steps: `tau kappa^4` for the largest curvature.
const PARTS: [f64; 3] = [3e-4, 1e-3, 3e-3];
/// That of rollouts, of waves and of the energy.
const PART: f64 = PARTS[1];
/// The exact factor of waves that are called fast is at most this.
const FAST: f64 = 0.01;
/// Curves whose flow is shown over many steps.
const SHOWN: [&str; 3] = ["waves", "ellipse", "cross"];
/// Streams of random numbers for curves that are taught, and for others.
const TAUGHT: u64 = 1;
const HELD_OUT: u64 = 2;

/// How much there is to do.
#[derive(Clone, Copy, Debug, Serialize)]
struct Size {
    /// Circles, ellipses and curves with waves that are taught.
    taught: [usize; 3],
    held_out_waves: usize,
    /// The first so many of the other curves.
    held_out: usize,
    /// The middle so many of the sizes of steps.
    parts: usize,
    adam: AdamParams,
    energy: AdamParams,
    /// Steps of rollouts, and of how many one is measured.
    rollout: [usize; 2],
    /// The largest wave number.
    waves: usize,
}

const USUAL: Size = Size {
    taught: [8, 6, 16],
    held_out_waves: 4,
    held_out: 3,
    parts: 3,
    adam: AdamParams {
        steps: 2000,
        rates: [1e-2, 1e-4],
    },
    energy: AdamParams {
        steps: 200,
        rates: [1e-2, 1e-3],
    },
    rollout: [50, 5],
    waves: 46,
};

const QUICK: Size = Size {
    taught: [1, 1, 1],
    held_out_waves: 1,
    held_out: 1,
    parts: 1,
    adam: AdamParams {
        steps: 50,
        rates: [1e-2, 1e-3],
    },
    energy: AdamParams {
        steps: 3,
        rates: [1e-2, 1e-3],
    },
    rollout: [4, 2],
    waves: 10,
};

/// Teaches corrections of the direct step of Willmore flow: a function of the curvature alone, one of curvature and motion, and a pointwise
/// network of its heat kernels, from exact flows of circles, ellipses and curves with small waves; and that network again from the energy of the
/// minimizing movement. Then measures errors of one step, factors of small waves, and fifty steps, on curves that were taught and on others.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,
}

/// Curves of a kind.
struct Family {
    key: &'static str,
    title: &'static str,
    examples: Vec<Example>,
}

/// A step that is measured.
struct Method {
    key: &'static str,
    label: &'static str,
    looks: (Colour, LineStyle, Marker),
    step: Step,
}

enum Step {
    Corrected(Correction),
    Extrapolated,
}

fn program(options: &Options) -> Result<()> {
    let run = &options.run;
    let size = run.either(QUICK, USUAL);
    let parameters = json!({ "size": size, "parts": PARTS });
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let families = session.phase("curves", |stage| families(stage.options.seed, &size))?;
    let parts = if size.parts == 1 { &[PART][..] } else { &PARTS };
    let pairs = session.phase("exact steps", |stage| pairs(&families, parts, stage))?;
    let methods = teach(&mut session, &families, &pairs, &size)?;
    let rows = session.phase("single steps", |stage| {
        errors(&families, &pairs, parts, &methods, stage)
    })?;
    let waves = session.phase("waves", |stage| multipliers(&methods, size.waves, stage))?;
    let rollouts = session.phase("rollouts", |stage| {
        rollouts(&families, &methods, size.rollout, stage)
    })?;

    session.figure(errors_figure(&families, &methods, &rows), "errors")?;
    session.figure(rollouts_figure(&methods, &rollouts), "rollouts")?;
    session.figure(multipliers_figure(&waves), "multipliers")?;
    session.sheet(errors_sheet(&methods, &rows), "errors")?;
    session.sheet(rollouts_sheet(&methods, &rollouts), "rollouts")?;
    session.sheet(multipliers_sheet(&waves), "multipliers")?;
    session.finish("Learning beside the direct step")
}

/// The curves that are taught, and the others.
fn families(seed: u64, size: &Size) -> Result<Vec<Family>> {
    let [circles, ellipses, waves] = size.taught;
    let (mut taught, mut others) = (Curves::new(seed, TAUGHT), Curves::new(seed, HELD_OUT));
    let family = |key, title, examples: Result<Vec<Example>>| -> Result<Family> {
        let examples = examples?;
        Ok(Family {
            key,
            title,
            examples,
        })
    };
    let name = |kind: &str, k: usize| format!("{kind} {k}");
    let circles = (0..circles)
        .map(|k| taught.circle(name("circle", k)))
        .collect();
    let ellipses = (0..ellipses)
        .map(|k| taught.ellipse(name("ellipse", k)))
        .collect();
    let waves = (0..waves).map(|k| taught.waves(name("waves", k))).collect();
    let more = (0..size.held_out_waves).map(|k| others.waves(name("other waves", k)));
    let mut all = vec![
        family("training_circles", "taught: circles", circles)?,
        family("training_ellipses", "taught: ellipses", ellipses)?,
        family("training_waves", "taught: waves", waves)?,
        family("waves", "held out: waves", more.collect())?,
    ];
    let shapes: [(_, _, fn() -> Result<Example>); 3] = [
        (
            "ellipse",
            "held out: ellipse 3 : 2",
            Example::held_out_ellipse,
        ),
        ("cross", "held out: cross", Example::cross),
        ("rectangle", "held out: rectangle", Example::rectangle),
    ];
    for (key, title, example) in shapes.into_iter().take(size.held_out) {
        all.push(family(key, title, example().map(|example| vec![example]))?);
    }
    Ok(all)
}

/// Exact and direct steps: for each family, for each size, for each curve.
type Pairs<'a> = Vec<Vec<Vec<Pair<'a>>>>;

fn pairs<'a>(families: &'a [Family], parts: &[f64], stage: &Stage<'_>) -> Result<Pairs<'a>> {
    let tasks: Vec<(&Example, f64)> = (families.iter())
        .flat_map(|family| parts.iter().map(move |part| (family, *part)))
        .flat_map(|(family, part)| family.examples.iter().map(move |example| (example, part)))
        .collect();
    stage.bar.set_length(tasks.len() as u64);
    let made = harness::in_parallel(tasks.len(), harness::workers(stage.device), |k| {
        let (example, part) = tasks[k];
        let pair = example.pair(part)?;
        stage.bar.inc(1);
        Ok(pair)
    })?;
    let mut made = made.into_iter();
    let of_family = |family: &Family| {
        let of_part = |_: &f64| made.by_ref().take(family.examples.len()).collect();
        parts.iter().map(of_part).collect()
    };
    Ok(families.iter().map(of_family).collect())
}

/// Trains the corrections, and lists them among the steps to compare them with.
fn teach(
    session: &mut Session,
    families: &[Family],
    pairs: &Pairs<'_>,
    size: &Size,
) -> Result<Vec<Method>> {
    let seed = session.options.seed;
    let taught: Vec<&Pair<'_>> = (families.iter().zip(pairs))
        .filter(|(family, _)| family.key.starts_with("training_"))
        .flat_map(|(_, pairs)| pairs.iter().flatten())
        .collect();
    let circles: Vec<&Pair<'_>> = pairs[0].iter().flatten().collect();
    // The energy is slow: a few curves of each kind, and one size of steps.
    let few = pairs[..3].iter().flat_map(|of_kind| {
        let middle = of_kind.len() / 2;
        of_kind[middle].iter().take(2)
    });
    let few: Vec<&Pair<'_>> = few.collect();
    let mut methods = vec![
        method("derived", "derived", 6, Step::Corrected(Correction::None)),
        method(
            "extrapolated",
            "derived, extrapolated",
            5,
            Step::Extrapolated,
        ),
    ];
    let forms = [
        (
            "curvature",
            "network of κ, by circles",
            4,
            Form::Curvature,
            &circles,
        ),
        ("geometry", "network of κ and d", 2, Form::Geometry, &taught),
        (
            "filters",
            "network of the filters",
            0,
            Form::Filters,
            &taught,
        ),
    ];
    for (key, label, colour, form, pairs) in forms {
        let taught = session.phase(format!("training: {key}"), |stage| {
            from_pairs(form, pairs, size.adam, seed, stage.device)
        })?;
        methods.push(learned(session, key, label, colour, taught)?);
    }
    let taught = session.phase("training: energy", |stage| {
        from_energy(Form::Filters, &few, size.energy, seed, stage.device)
    })?;
    let of_exact = energy_of_exact_steps(&few, &session.device)?;
    session.metric("energy.loss_exact", of_exact)?;
    methods.push(learned(
        session,
        "energy",
        "network of the filters, by energy",
        1,
        taught,
    )?);
    Ok(methods)
}

fn method(key: &'static str, label: &'static str, colour: usize, step: Step) -> Method {
    let (style, marker) = match &step {
        Step::Corrected(Correction::None) => (LineStyle::Solid, Marker::Square),
        Step::Extrapolated => (LineStyle::Dashed, Marker::Square),
        Step::Corrected(Correction::Learned(network)) if network.form == Form::Curvature => {
            // It lies on the derived one where curves are no circles.
            (LineStyle::Dashed, Marker::Triangle)
        }
        Step::Corrected(_) => (LineStyle::Solid, Marker::Circle),
    };
    let looks = (colour.into(), style, marker);
    Method {
        key,
        label,
        looks,
        step,
    }
}

/// A trained correction; its losses are metrics.
fn learned(
    session: &mut Session,
    key: &'static str,
    label: &'static str,
    colour: usize,
    (network, [before, after]): Taught,
) -> Result<Method> {
    let losses = [("loss_before", before.into()), ("loss_after", after.into())];
    session.metrics(key, losses)?;
    let step = Step::Corrected(Correction::Learned(network));
    Ok(method(key, label, colour, step))
}

/// Errors of one step on the curves of a family.
struct Row {
    family: &'static str,
    part: f64,
    /// Mean and largest ones for each method.
    errors: Vec<[f64; 2]>,
}

fn errors(
    families: &[Family],
    pairs: &Pairs<'_>,
    parts: &[f64],
    methods: &[Method],
    stage: &Stage<'_>,
) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (family, pairs) in families.iter().zip(pairs) {
        for (part, pairs) in parts.iter().zip(pairs) {
            let of_method = |k: usize| of_pairs(&methods[k].step, pairs, stage.device);
            let workers = harness::workers(stage.device);
            rows.push(Row {
                family: family.key,
                part: *part,
                errors: harness::in_parallel(methods.len(), workers, of_method)?,
            });
        }
    }
    Ok(rows)
}

/// Errors of a method over several pairs: the root of the mean of their squares, and the largest.
fn of_pairs(step: &Step, pairs: &[Pair<'_>], device: &ComputeDevice) -> Result<[f64; 2]> {
    let (mut squares, mut largest) = (0.0, 0.0_f64);
    for pair in pairs {
        let before = &pair.example.distances;
        let mut steps = DirectSteps::new(pair.example.grid);
        let after = match step {
            Step::Corrected(correction) => correction.step(&mut steps, before, pair.tau, device)?,
            Step::Extrapolated => {
                let middle = steps.step(before, 0.5 * pair.tau).distances;
                let half = steps.step(&middle, 0.5 * pair.tau).distances;
                extrapolated(&half, &pair.derived.distances)
            }
        };
        let [mean, most] = pair.errors(&after);
        squares += mean * mean;
        largest = largest.max(most);
    }
    Ok([(squares / pairs.len() as f64).sqrt(), largest])
}

/// What steps of half the size and whole ones extrapolate to.
fn extrapolated(half: &[f64], whole: &[f64]) -> Vec<f64> {
    let both = half.iter().zip(whole);
    both.map(|(half, whole)| {
        if half.is_finite() && whole.is_finite() {
            2.0 * half - whole
        } else {
            *half
        }
    })
    .collect()
}

/// Factors of small waves.
struct Waves<'a> {
    method: &'a Method,
    /// Wave numbers with their factors.
    factors: Vec<[f64; 2]>,
}

impl Waves<'_> {
    /// The largest absolute factor of waves whose exact factor is at most this.
    fn largest(&self, exact: f64) -> f64 {
        let waves = self
            .factors
            .iter()
            .filter(|[k, _]| exact_multiplier(*k) <= exact);
        waves.map(|[_, factor]| factor.abs()).fold(0.0, f64::max)
    }
}

/// On a circle of radius 1, by the steps that are made of one.
fn multipliers<'a>(
    methods: &'a [Method],
    most: usize,
    stage: &Stage<'_>,
) -> Result<Vec<Waves<'a>>> {
    let circle = Example::unit_circle()?;
    let single = methods.iter().filter_map(|method| match &method.step {
        Step::Corrected(correction) => Some((method, correction)),
        Step::Extrapolated => None,
    });
    let single: Vec<(&Method, &Correction)> = single.collect();
    let workers = harness::workers(stage.device);
    harness::in_parallel(single.len(), workers, |k| {
        let (method, correction) = single[k];
        let of = |number| multiplier(correction, &circle, number, stage.device);
        let factors = (2..=most).map(|number| Ok([number as f64, of(number)?]));
        let factors = factors.collect::<Result<_>>()?;
        Ok(Waves { method, factors })
    })
}

/// By how much a step multiplies a wave of this number, by least squares at the nodes next to the circle.
fn multiplier(
    correction: &Correction,
    circle: &Example,
    number: usize,
    device: &ComputeDevice,
) -> Result<f64> {
    /// The size of the wave, in spacings.
    const SMALL: f64 = 1e-3;
    let (grid, tau, number) = (circle.grid, circle.tau(PART), number as f64);
    let h = grid.spacing();
    let wave = |node: usize| {
        let [x, y] = grid.node(node);
        (number * y.atan2(x)).cos()
    };
    let raised = circle.distances.iter().enumerate();
    let raised: Vec<f64> = raised.map(|(node, s)| s - SMALL * h * wave(node)).collect();
    let mut steps = DirectSteps::new(grid);
    let mut after = |before: &[f64]| correction.step(&mut steps, before, tau, device);
    let (without, with) = (after(&circle.distances)?, after(&raised)?);
    let (mut product, mut square) = (0.0, 0.0);
    for node in (0..grid.len()).filter(|node| without[*node].abs() < h) {
        product += (without[node] - with[node]) * wave(node);
        square += wave(node).powi(2);
    }
    Ok(product / (square * SMALL * h))
}

/// The factor that the exact flow has on the circle, which grows: of `eta' = -(k^2 - 1) (k^2 - 3/2) / R^4 eta` with `R^4 = 1 + 2 t`.
fn exact_multiplier(number: f64) -> f64 {
    let square = number * number;
    (1.0 + 2.0 * PART).powf(-0.5 * (square - 1.0) * (square - 1.5))
}

/// Distances to the exact curve on the way.
struct Rollout {
    key: &'static str,
    title: &'static str,
    /// Steps made, and the largest distance times the curvature of the start, for each method.
    ways: Vec<Vec<[f64; 2]>>,
}

fn rollouts(
    families: &[Family],
    methods: &[Method],
    [steps, every]: [usize; 2],
    stage: &Stage<'_>,
) -> Result<Vec<Rollout>> {
    let is_shown = |family: &&Family| SHOWN.contains(&family.key);
    let mut all = Vec::new();
    for family in families.iter().filter(is_shown) {
        let example = &family.examples[0];
        let after = |k: usize| (k * every) as f64 * example.tau(PART);
        let times: Vec<f64> = (1..=steps / every).map(after).collect();
        let exact = example.exact(&times)?;
        let workers = harness::workers(stage.device);
        let ways = harness::in_parallel(methods.len(), workers, |k| {
            let states = states(
                &methods[k].step,
                example,
                [times.len(), every],
                stage.device,
            )?;
            let grid = DirectSteps::new(example.grid);
            let point = |(k, (state, exact)): (usize, (&Vec<f64>, &Curve))| {
                let points = grid.level(state).points;
                let points: Vec<[f64; 2]> = points.iter().map(|point| point.position).collect();
                let distance = exact.largest_distance_of(&points) * example.curvature;
                [((k + 1) * every) as f64, distance]
            };
            let all = states.iter().zip(&exact).enumerate().map(point);
            Ok(all.collect())
        })?;
        all.push(Rollout {
            key: family.key,
            title: family.title,
            ways,
        });
    }
    Ok(all)
}

/// The distances after every so many steps.
fn states(
    step: &Step,
    example: &Example,
    [count, every]: [usize; 2],
    device: &ComputeDevice,
) -> Result<Vec<Vec<f64>>> {
    let rolled = |correction: &Correction, halves: usize| {
        let tau = example.tau(PART) / halves as f64;
        roll(correction, example, tau, [count, every * halves], device)
    };
    match step {
        Step::Corrected(correction) => rolled(correction, 1),
        Step::Extrapolated => {
            let half = rolled(&Correction::None, 2)?;
            let whole = rolled(&Correction::None, 1)?;
            let both = half.iter().zip(&whole);
            Ok(both
                .map(|(half, whole)| extrapolated(half, whole))
                .collect())
        }
    }
}

/// The distances after every so many of the steps.
fn roll(
    correction: &Correction,
    example: &Example,
    tau: f64,
    [count, every]: [usize; 2],
    device: &ComputeDevice,
) -> Result<Vec<Vec<f64>>> {
    let (mut steps, mut now) = (DirectSteps::new(example.grid), example.distances.clone());
    let mut states = Vec::new();
    for _ in 0..count {
        for _ in 0..every {
            now = correction.step(&mut steps, &now, tau, device)?;
        }
        states.push(now.clone());
    }
    Ok(states)
}

fn errors_sheet<'a>(methods: &'a [Method], rows: &'a [Row]) -> Sheet<'a, Row> {
    let sheet = Sheet::of(rows)
        .keyed(|row, name| format!("{}.tau{}.{name}", row.family, row.part))
        .text("curves", |row| row.family.replace('_', " "))
        .column("τ κ⁴", Shortest, |row| row.part);
    let with = |sheet: Sheet<'a, Row>, (k, method): (usize, &Method)| {
        let (rms, largest) = (
            format!("{}.rms", method.key),
            format!("{}.largest", method.key),
        );
        let head = format!("{}, largest", method.key);
        sheet
            .measure(&rms, method.key, Fixed(4), move |row| row.errors[k][0])
            .measure(&largest, &head, Fixed(4), move |row| row.errors[k][1])
    };
    methods.iter().enumerate().fold(sheet, with)
}

fn rollouts_sheet<'a>(methods: &'a [Method], rollouts: &'a [Rollout]) -> Sheet<'a, Rollout> {
    let sheet = Sheet::of(rollouts)
        .keyed(|rollout, name| format!("{}.{name}.rollout", rollout.key))
        .text("curve", |rollout| rollout.key);
    let with = |sheet: Sheet<'a, Rollout>, (k, method): (usize, &Method)| {
        let end = move |rollout: &'a Rollout| rollout.ways[k].last().map(|point| point[1]);
        sheet.measure(method.key, method.key, Scientific(2), end)
    };
    methods.iter().enumerate().fold(sheet, with)
}

fn multipliers_sheet<'a>(waves: &'a [Waves<'a>]) -> Sheet<'a, Waves<'a>> {
    let (all, fast) = ("largest factor", "largest factor of fast waves");
    Sheet::of(waves)
        .keyed(|waves, name| format!("{}.{name}", waves.method.key))
        .text("correction", |waves| waves.method.key)
        .measure("multiplier", all, Fixed(4), |waves| waves.largest(1.0))
        .measure("fast_multiplier", fast, Fixed(4), |waves| {
            waves.largest(FAST)
        })
}

/// A panel for each family: errors over the size of the step.
fn errors_figure(families: &[Family], methods: &[Method], rows: &[Row]) -> Figure {
    let panel = |family: &Family| {
        let own: Vec<&Row> = rows.iter().filter(|row| row.family == family.key).collect();
        let curves = methods.iter().enumerate().map(|(k, method)| {
            let points = own.iter().map(|row| [row.part, row.errors[k][0]]);
            method.series(points.collect())
        });
        let x = Axis::log("τ κ⁴").with_range(2e-4, 5e-3);
        LineChart::new(family.title, x, Axis::log("error / motion")).with_curves(curves)
    };
    Figure::new("Errors of one step", 4)
        .with_panels(families.iter().map(panel))
        .with_shared_legend()
        .with_note("Root mean squares at nodes next to the interface. κ: the largest curvature; d: the motion of the derived step.")
        .with_width(1200.0)
}

fn rollouts_figure(methods: &[Method], rollouts: &[Rollout]) -> Figure {
    let panel = |rollout: &Rollout| {
        let ways = methods.iter().zip(&rollout.ways);
        let curves = ways.map(|(method, way)| method.series(way.clone()));
        let y = Axis::log("largest distance · κ");
        LineChart::new(rollout.title, Axis::linear("steps"), y).with_curves(curves)
    };
    Figure::new(format!("Steps of τ κ⁴ = {PART}"), SHOWN.len())
        .with_panels(rollouts.iter().map(panel))
        .with_shared_legend()
        .with_note("Distance to the exact curve. κ: the largest curvature of the start; d: the motion of the derived step.")
        .with_width(1200.0)
}

fn multipliers_figure(waves: &[Waves<'_>]) -> Figure {
    let curves = waves.iter().map(|waves| {
        let absolute = waves.factors.iter().map(|[k, factor]| [*k, factor.abs()]);
        waves.method.series(absolute.collect())
    });
    let numbers = waves[0]
        .factors
        .iter()
        .map(|[k, _]| [*k, exact_multiplier(*k)]);
    let exact = Series::new("exact", numbers.collect::<Vec<_>>())
        .with_colour(Colour::Black)
        .with_style(LineStyle::Dashed);
    let y = Axis::log("|factor in one step|").with_range(1e-3, 2.0);
    let chart = LineChart::new("", Axis::linear("wave number on the circle"), y);
    Figure::new(format!("Small waves, τ κ⁴ = {PART}"), 1)
        .with_panel(chart.with_curves(curves).with_curves([exact]))
        .with_note("κ: the curvature of the circle; d: the motion of the derived step.")
}

impl Method {
    fn series(&self, points: Vec<[f64; 2]>) -> Series {
        let (colour, style, marker) = self.looks;
        Series::new(self.label, points)
            .with_colour(colour)
            .with_style(style)
            .with_marker(marker)
    }
}
