//! What a time step costs, and where the time goes.

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use engine::{Case, Method, Operator, Run, Scheme, StepRule};
use experiments::networks::{NetworkOptions, convergence_network};
use experiments::options::RunOptions;
use experiments::products::Candidates;
use experiments::session::Session;
use experiments::timing::{self, Columns, Numbers, Timed};
use experiments::{Error, harness, surfaces};
use geometry::measure::l2_distance;
use geometry::shapes::{Ball, Capsule, Cuboid};
use geometry::{Field, Grid, SignedDistanceExt, phase_field};
use operators::{ComputeDevice, DeviceKind, memory};
use report::{
    Axis, Colour, Figure, Format, LegendEntry, LineChart, LineStyle, Marker, Series, Table,
};
use serde::Serialize;
use serde_json::json;
use solver::StepRecord;

const PROGRAM: &str = "performance";
/// Steps of a comparison with a smaller tolerance, and how much smaller.
const COMPARED_STEPS: usize = 20;
const TIGHTER: f64 = 100.0;

/// Cost of Willmore steps by the hybrid scheme on this machine: the cross of the paper (128 steps, eps = 2^-6, tau = tautilde =
/// 2^-14) at n = 128, 256 and 512, and in 3D a cube at n = 64 and a blob at n = 128 (eps = 2h, tautilde = h^2, tau = 2^-18).
/// Hessian-vector products through Burn, by hand, and their Fourier transforms alone take turns in the same run.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    /// Seconds for the comparison of products on each grid
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    turns: f64,
}

/// What was measured for one shape on one grid.
#[derive(Serialize)]
struct Measurement {
    case: &'static str,
    n: usize,
    cells: Vec<usize>,
    /// Seconds, work and memory of the steps. Products on coarser grids count by their shares of the unknowns; pages are those that the
    /// system had to provide from the second step on; `distance_to_tighter` is the `L2` distance to a minimization with a [much
    /// smaller](TIGHTER) tolerance after [some steps](COMPARED_STEPS), over the way from the start.
    steps: Numbers,
    products: Numbers,
    /// Parts of the time of a step in seconds.
    parts: [(&'static str, f64); 7],
}

const STEPS: &Columns = &[
    ("steps", Format::Shortest, "steps"),
    ("all steps [s]", Format::Fixed(1), "seconds"),
    ("median step [s]", Format::Fixed(3), "seconds_per_step"),
    ("Newton/step", Format::Fixed(1), "newton_per_step"),
    ("HVP/step", Format::Fixed(1), "hvp_on_this_grid"),
    (
        "and on coarser grids",
        Format::Fixed(1),
        "hvp_on_coarser_grids",
    ),
    ("ms/HVP", Format::Fixed(2), "ms_per_product"),
    (
        "times two FFT pairs (f32)",
        Format::Fixed(2),
        "product_over_floor",
    ),
    ("peak memory [MiB]", Format::Fixed(0), "peak_mib"),
    ("new pages/HVP", Format::Fixed(1), "pages_per_product"),
    (
        "to 100 times the precision",
        Format::Scientific(1),
        "distance_to_tighter",
    ),
];

const PRODUCTS: &Columns = &[
    ("Burn, f64 [ms]", Format::Fixed(2), "ms"),
    ("by hand, f64 [ms]", Format::Fixed(2), "by_hand_ms"),
    ("Burn / by hand", Format::Fixed(2), "ratio"),
    ("two FFT pairs, f64 [ms]", Format::Fixed(2), "floor_ms"),
    ("Burn, f32 [ms]", Format::Fixed(2), "single_ms"),
    (
        "two FFT pairs, f32 [ms]",
        Format::Fixed(2),
        "floor_single_ms",
    ),
    ("energy and gradient [ms]", Format::Fixed(2), "evaluate_ms"),
];

fn main() -> ExitCode {
    harness::main(program)
}

fn program(options: &Options) -> Result<(), Error> {
    let (run, quick) = (&options.run, options.run.quick);
    if !(options.turns.is_finite() && options.turns > 0.0) {
        return Err(Error::Options("--turns must be positive".to_owned()));
    }
    let device = run.open_device()?;
    if !matches!(device.kind(), DeviceKind::Flex | DeviceKind::NdArray) {
        return Err(Error::Options(format!(
            "{PROGRAM} compares with products written for the CPU: choose --device flex or ndarray, not {}",
            device.kind()
        )));
    }
    let planes: &[usize] = if quick { &[128] } else { &[128, 256, 512] };
    let solids = if quick {
        [("cube", 24, 2), ("blob", 32, 2)]
    } else {
        [("cube", 64, 20), ("blob", 128, 8)]
    };
    let mut needs =
        (planes.iter().map(|&n| convergence_network(n))).collect::<Result<Vec<_>, _>>()?;
    needs.push(surfaces::needed_network());
    let networks = options.networks.load(&needs)?;
    let turns = if quick { 0.05 } else { options.turns };
    let parameters = json!({ "turns": turns, "threads": rayon::current_num_threads() });
    let mut session = Session::open(PROGRAM, run, device, parameters)?;
    let mut all = Vec::new();
    for &n in planes {
        let operator = networks.operator((Method::Hybrid, Scheme::Paper), n)?;
        let case = timing::plane(&operator, n, if quick { 2 } else { 128 }, quick)?;
        all.push(Measurement::of(
            "cross",
            &case,
            &mut session,
            turns,
            n <= 256,
        )?);
    }
    for (name, n, steps) in solids {
        let network = networks.find(Scheme::Paper, &surfaces::needed_network())?;
        let operator = Operator::learned(Scheme::Paper, network)?;
        let time = (StepRule::Constant(0.5_f64.powi(18)), steps);
        let initial = solid_shape(name, n)?;
        let case = surfaces::willmore_flow(name, initial, operator, surfaces::scales(n), time);
        all.push(Measurement::of(name, &case, &mut session, turns, false)?);
    }
    let steps = Table::of(&all).text("shape", |m| format!("{}, n = {}", m.case, m.n));
    let steps = timing::with_columns(steps.text("grid", Measurement::grid), STEPS, |m| &m.steps);
    session.table(steps, "steps")?;
    let products = Table::of(&all).text("grid", Measurement::grid);
    let products = timing::with_columns(products, PRODUCTS, |m| &m.products);
    session.table(products, "products")?;
    let summary = &mut session.summary;
    for m in &all {
        timing::summarize(summary, &format!("{}.n{}", m.case, m.n), &m.steps)?;
        timing::summarize(summary, &format!("hvp.{}", m.grid()), &m.products)?;
    }
    session.output.write_json("performance.json", &all)?;
    session.figure(figure(&all), "performance")?;
    session.finish("Willmore steps by the hybrid scheme on this machine")
}

/// A cube of side 1/2, or a body with arms: a ball with three capsules through it.
fn solid_shape(name: &str, n: usize) -> Result<Field<3>, Error> {
    let (grid, eps) = (Grid::<3>::per_unit(n, 1.0)?, surfaces::scales(n).eps);
    if name == "cube" {
        return Ok(phase_field(grid, &Cuboid::new([0.25, 0.25, 0.25])?, eps)?);
    }
    let arm = |to: [f64; 3], radius| Capsule::new([0.0; 3], to, radius);
    let blob = Ball::new([0.0; 3], 0.2)?
        .union(arm([0.25, 0.1, 0.05], 0.1)?)
        .union(arm([-0.2, 0.2, -0.1], 0.09)?)
        .union(arm([0.0, -0.25, 0.15], 0.11)?);
    Ok(phase_field(grid, &blob, eps)?)
}

/// Distance of the end of some steps to that with a smaller tolerance.
fn distance_to_tighter<const D: usize>(
    case: &Case<D>,
    device: &ComputeDevice,
) -> Result<f64, Error> {
    let end = |case: Case<D>| -> Result<Field<D>, Error> {
        let mut run = Run::new(case, device)?;
        while run.steps() < COMPARED_STEPS && run.step()?.is_some() {}
        Ok(run.field().clone())
    };
    let mut tighter = case.clone();
    let newton = &mut tighter.scales.newton;
    newton.tolerance /= TIGHTER;
    // Linear solves that leave a tenth would take a Newton step for every digit.
    newton.cg_tolerance /= TIGHTER.sqrt();
    let (loose, tight) = (end(case.clone())?, end(tighter)?);
    Ok(l2_distance(&loose, &tight)? / l2_distance(&case.initial, &tight)?)
}

impl Measurement {
    fn of<const D: usize>(
        name: &'static str,
        case: &Case<D>,
        session: &mut Session<'_>,
        turns: f64,
        compared: bool,
    ) -> Result<Self, Error> {
        let grid = *case.grid();
        let (n, device) = (
            (1.0 / grid.spacing()).round() as usize,
            session.device.clone(),
        );
        let bar = session.progress.counter(format!("{name}, n = {n}"));
        memory::forget_peak();
        let mut timed = Timed::new(case.clone(), &device, bar)?;
        let mut warm = None;
        session.phase(format!("{name}, n = {n}: steps"), || {
            while timed.step()? {
                warm = warm.or_else(memory::pages);
            }
            Ok(())
        })?;
        let pages = memory::pages()
            .zip(warm)
            .map(|(now, warm)| (now - warm) as f64);
        let peak_mib = memory::peak_mib();
        let (products, distance) = session.phase(format!("{name}, n = {n}: products"), || {
            let distance = compared.then(|| distance_to_tighter(case, &device));
            let network = &case.operator.network().expect("a learned operator").network;
            let mut candidates = Candidates::new(network, timed.run.field(), &device)?;
            let products = candidates.measure(Duration::from_secs_f64(turns))?;
            Ok((products, distance.transpose()?))
        })?;
        let mut steps = timed.numbers();
        let later = timed.minimizations().skip(1).map(|r| r.newton.hvp as f64);
        let pages = pages.map(|pages| pages / later.sum::<f64>().max(1.0));
        steps.insert(
            "product_over_floor",
            steps["ms_per_product"] / products["floor_single_ms"],
        );
        steps.extend(pages.map(|pages| ("pages_per_product", pages)));
        steps.extend(peak_mib.map(|peak| ("peak_mib", peak)));
        steps.extend(distance.map(|distance| ("distance_to_tighter", distance)));
        Ok(Self {
            case: name,
            n,
            cells: vec![grid.cells(); D],
            parts: parts(&timed, products["floor_single_ms"]),
            steps,
            products,
        })
    }

    fn grid(&self) -> String {
        let cells: Vec<String> = self.cells.iter().map(ToString::to_string).collect();
        cells.join("x")
    }

    fn unknowns(&self) -> f64 {
        self.cells.iter().product::<usize>() as f64
    }
}

/// Parts of the time of a step, where two pairs of transforms, timed alone, take so many milliseconds.
fn parts<const D: usize>(timed: &Timed<D>, floor_ms: f64) -> [(&'static str, f64); 7] {
    let mean = |of: fn(&StepRecord) -> f64| timed.mean(of);
    let products = mean(|r| r.times.products);
    let convolutions = (1e-3 * floor_ms * mean(|r| r.newton.hvp as f64)).min(products);
    let [preconditioner, assembly, energies, start] = [
        mean(|r| r.times.preconditioner),
        mean(|r| r.times.assembly),
        mean(|r| r.times.energies),
        mean(|r| r.times.start),
    ];
    let rest = mean(|r| r.seconds) - products - preconditioner - assembly - energies - start;
    [
        ("convolutions of products", convolutions),
        ("other work of products", products - convolutions),
        ("preconditioner", preconditioner),
        ("coarse assembly", assembly),
        ("energies and gradients", energies),
        ("start on the half grid", start),
        ("rest", rest.max(0.0)),
    ]
}

/// Exponent of a power law through the first and the last point.
fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let (first, last) = (points.first()?, points.last()?);
    (last[0] > first[0]).then(|| (last[1] / first[1]).ln() / (last[0] / first[0]).ln())
}

/// Dimensions with their measurements and line styles.
fn dimensions(all: &[Measurement]) -> [(String, Vec<&Measurement>, LineStyle); 2] {
    [(2, LineStyle::Solid), (3, LineStyle::Dashed)].map(|(dimension, style)| {
        let rows = all.iter().filter(|m| m.cells.len() == dimension);
        (format!("{dimension}D"), rows.collect(), style)
    })
}

fn figure(all: &[Measurement]) -> Figure {
    let mut slopes = Vec::new();
    let cost = dimensions(all).map(|(name, rows, style)| {
        let curve = Series::of(&name, rows, |m| [m.unknowns(), m.steps["seconds_per_step"]]);
        slopes.extend(slope(&curve.points).map(|slope| format!("{slope:.2} in {name}")));
        curve
            .with_colour(Colour::Black)
            .with_style(style)
            .with_marker(Marker::Circle)
    });
    let axes = (Axis::log("unknowns"), Axis::log("median step [s]"));
    let cost = LineChart::new("cost of a step", axes.0, axes.1).with_curves(cost);
    Figure::new("Willmore steps by the hybrid scheme", 2)
        .with_panel(cost.with_entries([]))
        .with_panel(shares(all))
        .with_shared_legend()
        .with_note(format!(
            "2D: a cross, eps = 2⁻⁶, tau = 2⁻¹⁴. 3D: a cube at n = 64, a blob at n = 128, eps = 2h, tau = 2⁻¹⁸. {} threads. Cost \
             of a step ~ unknowns to the power {}.",
            rayon::current_num_threads(),
            slopes.join(" and ")
        ))
}

/// Where the time goes: a colour for each part, a line style for each dimension.
fn shares(all: &[Measurement]) -> LineChart {
    let axes = (Axis::log("unknowns"), Axis::log("mean per step [s]"));
    let mut chart = LineChart::new("where the time goes", axes.0, axes.1);
    let (mut phases, mut entries) = (Vec::new(), Vec::new());
    for (dimension, rows, style) in dimensions(all) {
        phases.clear();
        for (k, (name, _)) in all[0].parts.into_iter().enumerate() {
            let points = rows.iter().map(|m| [m.unknowns(), m.parts[k].1]);
            let points: Vec<[f64; 2]> = points.filter(|[_, seconds]| *seconds > 0.0).collect();
            let curve = Series::new(format!("{name}, {dimension}"), points).with_colour(k);
            chart = chart.with_series(curve.with_style(style).with_marker(Marker::Circle));
            phases.push(LegendEntry::line(name, k, LineStyle::Solid));
        }
        entries.push(LegendEntry::line(dimension, Colour::Black, style));
    }
    chart.with_entries(phases).with_entries(entries)
}
