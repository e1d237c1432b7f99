use crate::prelude::*;

pub const EXPERIMENT: Experiment = Experiment {
    name: "ellipse_orders",
    summary: "The order of convergence of Willmore flow of an ellipse in h and in tau, against its own finest run.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "ellipse_orders",
        title: "Orders of convergence",
        description: "Not in the paper: Willmore flow of an ellipse with the grid spacing and the time step halved again \
                 and again.",
        figures: &[(
            "orders",
            "L² distances at t = 2⁻¹⁰ between successive runs, and to the finest run.",
        )],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Orders of convergence",
    note: "",
    words: &[],
    rows: &[
        (
            "ellipse.to_next.h.pairN, ellipse.to_next.tau.pairN",
            "L2 distance between the N-th run and the next one, with `h` (`tau`) halved",
        ),
        (
            "ellipse.order.h.pairN, ellipse.order.tau.pairN",
            "order of convergence: binary logarithm of the ratio of this distance to the next",
        ),
    ],
};

const TITLE: &str = "Willmore flow of an ellipse, each h with its network";
const HALF_AXES: [f64; 2] = [0.3, 0.2];
const SIDE: f64 = 1.25;
/// Steps of `2^-14`, and how little the minimizations leave: much less than the errors.
const STEPS: usize = 16;
const TOLERANCE: f64 = 1e-4;
/// Cells per unit length at `tau = 2^-14`, and parts of that at `n = 128`.
const CELLS: [usize; 4] = [64, 128, 256, 512];
const PARTS: [usize; 5] = [1, 2, 4, 8, 16];

/// Willmore flow of the ellipse with half axes 0.3 and 0.2 by the calibrated scheme with the accurate network, eps = 2^-6, tautilde =
/// 2^-14, until t = 2^-10: L2 distances between runs with h and tau halved, and the orders of convergence.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,
}

fn program(Options { run: options }: &Options) -> Result<()> {
    let (used, steps) = if options.quick { (3, 2) } else { (4, STEPS) };
    let parameters =
        json!({ "half_axes": HALF_AXES, "side": SIDE, "steps": steps, "tolerance": TOLERANCE });
    let mut session = Session::open(EXPERIMENT.name, options, parameters)?;
    let mut run = |size: f64, n: usize, parts: usize| {
        let operator = Chosen::default().operator(ACCURATE, n)?;
        let initial = phase_field(Grid::per_unit(n, SIDE)?, &Ellipse::new(HALF_AXES)?, EPS)?;
        let (flow, shape) = (Flow::Willmore, "ellipse");
        let (tau, count) = (STEP / parts as f64, steps * parts);
        let mut case = planar_flow(flow, &operator, shape, initial, tau, count);
        case.scales.newton.tolerance = TOLERANCE;
        let name = format!("n{n}-{parts}");
        let end = session.trajectory(&name, case, &name, &Samples::every(count))?;
        Ok::<_, Error>((size, end))
    };
    let in_h = CELLS[..used].iter().map(|&n| run(1.0 / n as f64, n, 1));
    let h = refinements("h", &in_h.collect::<Result<Vec<_>, _>>()?)?;
    let in_tau = PARTS[..=used].iter().map(|&k| run(STEP / k as f64, 128, k));
    let tau = refinements("tau", &in_tau.collect::<Result<Vec<_>, _>>()?)?;
    let figure = Figure::new(format!("{TITLE}: convergence"), 2)
        .with_panels([chart(&h), chart(&tau)])
        .with_shared_legend();
    session.figure(figure, "orders")?;
    let rows = [h, tau].concat();
    let sheet = Sheet::of(&rows)
        .keyed(|row, name| format!("ellipse.{name}.{}.pair{}", row.refined, row.pair))
        .text("refined", |row| row.refined)
        .column("size", Scientific(2), |row| row.size)
        .column("to the finest", Scientific(2), |row| row.to_finest)
        .measure("to_next", "to the next", Scientific(2), |row| row.to_next)
        .measure("order", "order", Fixed(2), |row| row.order);
    session.sheet(sheet, "orders")?;
    session.finish(&format!("{TITLE}: orders of convergence"))
}

/// A run in a sequence in which a size, `h` or `tau`, is halved from one to the next.
#[derive(Clone, Copy)]
struct Refinement {
    refined: &'static str,
    /// Its number in the sequence, from 1, the coarsest.
    pair: usize,
    size: f64,
    /// `L2` distance of its end to that of the finest run, which is small only as long as the finest run is much finer,
    to_finest: f64,
    /// and to that of the next one, which is of the order of the error whatever the finest run is.
    to_next: f64,
    /// The order `p` as the distances to the next fall like `size^p` up to the next run; none for the last.
    order: Option<f64>,
}

/// What the runs say, coarsest first; the finest one has no row.
fn refinements(refined: &'static str, runs: &[(f64, Trajectory<2>)]) -> Result<Vec<Refinement>> {
    let distance = |coarse: &Trajectory<2>, fine: &Trajectory<2>| {
        coarse.distance(coarse.steps(), fine, fine.steps())
    };
    let pairs = runs.windows(2).map(|pair| distance(&pair[0].1, &pair[1].1));
    let to_next = pairs.collect::<Result<Vec<f64>, _>>()?;
    let finest = &runs[to_next.len()].1;
    let row = |k: usize| {
        Ok(Refinement {
            refined,
            pair: k + 1,
            size: runs[k].0,
            to_finest: distance(&runs[k].1, finest)?,
            to_next: to_next[k],
            order: to_next.get(k + 1).map(|next| (to_next[k] / next).log2()),
        })
    };
    (0..to_next.len()).map(row).collect()
}

/// The refinements of a size as a chart, with slopes 1 and 2 for comparison.
fn chart(rows: &[Refinement]) -> LineChart {
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let guide = |slope: i32, style| {
        let power = |size: f64| first.to_next * (size / first.size).powi(slope);
        let line = [first, last].map(|row| [row.size, power(row.size)]);
        let guide = Series::new(format!("slope {slope}"), line).with_colour(Colour::Grey);
        guide.with_style(style)
    };
    let next = Series::of("to the next finer run", rows, |row| [row.size, row.to_next]);
    let finest = Series::of("to the finest run", rows, |row| [row.size, row.to_finest]);
    let distance = Axis::log("L² distance at the end");
    LineChart::new("", Axis::log(first.refined), distance).with_curves([
        next.with_marker(Marker::Circle),
        finest.with_colour(1).with_marker(Marker::Square),
        guide(1, LineStyle::Dashed),
        guide(2, LineStyle::Dotted),
    ])
}
