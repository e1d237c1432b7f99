//! What a time step costs, and where the time goes.

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use engine::{Case, Method, Operator, Run, Scheme, StepRule};
use experiments::networks::{NetworkOptions, convergence_network};
use experiments::options::RunOptions;
use experiments::products::{Candidates, ProductTimes};
use experiments::session::Session;
use experiments::timing::{self, Timed, median};
use experiments::{Error, harness, memory, surfaces};
use geometry::measure::l2_distance;
use geometry::shapes::{Ball, Capsule, Cuboid};
use geometry::{Field, Grid, SignedDistanceExt, phase_field};
use operators::{ComputeDevice, DeviceKind};
use report::{
    Axis, Colour, Figure, Format, LegendEntry, LineChart, LineStyle, Marker, Series, Summary, Table,
};
use serde::Serialize;
use serde_json::json;
use solver::{PhaseTimes, StepRecord};

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
    case: String,
    dimension: usize,
    n: usize,
    cells_per_side: usize,
    unknowns: usize,
    steps: usize,
    /// Wall time of all steps.
    seconds: f64,
    /// Median over the steps.
    seconds_per_step: f64,
    newton_per_step: f64,
    /// On this grid.
    hvp_per_step: f64,
    /// On coarser grids, by their shares of the unknowns.
    coarser_hvp_per_step: f64,
    /// Wall time of one product during the steps.
    seconds_per_product: f64,
    /// Sums over the steps.
    times: PhaseTimes,
    /// Largest resident memory of the process while the steps ran, in MiB, where the system tells.
    peak_mib: Option<f64>,
    products: ProductTimes,
    /// `L2` distance to a minimization with a [much smaller](TIGHTER) tolerance after [some steps](COMPARED_STEPS), over the way
    /// from the start; where it was measured.
    distance_to_tighter: Option<f64>,
    /// Pages of memory that the system had to provide per product, from the second step on, all other work of the steps included.
    pages_per_product: Option<f64>,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
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
    let parameters =
        json!({ "turns": turns, "quick": quick, "threads": rayon::current_num_threads() });
    let mut session = Session::open(PROGRAM, run, device, &parameters)?;
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
    let (steps, products) = (step_table(&all)?, product_table(&all)?);
    steps.write(&session.output, "steps")?;
    products.write(&session.output, "products")?;
    session.output.write_json("performance.json", &all)?;
    session.figure(figure(&all), "performance")?;
    let report = format!("{}\n{}", steps.to_markdown(), products.to_markdown());
    let title = "Willmore steps by the hybrid scheme on this machine";
    session.finish(title, summary(&all)?, &report)
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
        name: &str,
        case: &Case<D>,
        session: &mut Session<'_>,
        turns: f64,
        compared: bool,
    ) -> Result<Self, Error> {
        let grid = *case.grid();
        let n = (1.0 / grid.spacing()).round() as usize;
        let bar = session.progress.counter(format!("{name}, n = {n}"));
        memory::forget_peak();
        let mut timed = Timed::new(case.clone(), &session.device, bar)?;
        let mut warm = None;
        session.phase(format!("{name}, n = {n}: steps"), || {
            while timed.goes_on() {
                timed.step()?;
                warm = warm.or_else(memory::pages);
            }
            timed
                .failure
                .clone()
                .map_or(Ok(()), |reason| Err(Error::Options(reason)))
        })?;
        let pages = memory::pages().zip(warm).map(|(now, warm)| now - warm);
        let peak_mib = memory::peak_mib();
        let network = &case
            .operator
            .network()
            .expect("the operator is learned")
            .network;
        let device = session.device.clone();
        let (products, distance) = session.phase(format!("{name}, n = {n}: products"), || {
            let distance = compared
                .then(|| distance_to_tighter(case, &device))
                .transpose()?;
            let mut candidates = Candidates::new(network, timed.run.field(), &device)?;
            Ok((
                candidates.measure(Duration::from_secs_f64(turns))?,
                distance,
            ))
        })?;
        let sum = |of: fn(&StepRecord) -> f64| timed.minimizations().map(of).sum::<f64>();
        let times = PhaseTimes {
            products: sum(|r| r.times.products),
            preconditioner: sum(|r| r.times.preconditioner),
            assembly: sum(|r| r.times.assembly),
            energies: sum(|r| r.times.energies),
            start: sum(|r| r.times.start),
        };
        let later = timed.minimizations().skip(1).map(|r| r.newton.hvp as f64);
        let later = later.sum::<f64>().max(1.0);
        Ok(Self {
            case: name.to_owned(),
            dimension: D,
            n,
            cells_per_side: grid.cells(),
            unknowns: grid.len(),
            steps: timed.run.steps(),
            seconds: sum(|r| r.seconds),
            seconds_per_step: median(timed.seconds()),
            newton_per_step: timed.mean(|r| r.newton.newton as f64),
            hvp_per_step: timed.mean(|r| r.newton.hvp as f64),
            coarser_hvp_per_step: timed.mean(|r| r.start.hvp),
            seconds_per_product: times.products / sum(|r| r.newton.hvp as f64),
            times,
            peak_mib,
            products,
            distance_to_tighter: distance,
            pages_per_product: pages.map(|pages| pages as f64 / later),
        })
    }

    fn key(&self) -> String {
        format!("{}.n{}", self.case, self.n)
    }

    fn grid(&self) -> String {
        vec![self.cells_per_side.to_string(); self.dimension].join("x")
    }

    /// Parts of the time of a step in seconds, with their names.
    fn parts(&self) -> [(&'static str, f64); 7] {
        let PhaseTimes {
            products,
            preconditioner,
            assembly,
            energies,
            start,
        } = self.times;
        // Two pairs of transforms per product, timed alone.
        let calls = self.hvp_per_step * self.steps as f64;
        let convolutions = (calls * self.products.floor_single).min(products);
        let rest = self.seconds - products - preconditioner - assembly - energies - start;
        [
            ("convolutions of products", convolutions),
            ("other work of products", products - convolutions),
            ("preconditioner", preconditioner),
            ("coarse assembly", assembly),
            ("energies and gradients", energies),
            ("start on the half grid", start),
            ("rest", rest.max(0.0)),
        ]
        .map(|(name, seconds)| (name, seconds / self.steps as f64))
    }
}

fn step_table(all: &[Measurement]) -> Result<Table, Error> {
    let over_floor = |m: &Measurement| m.seconds_per_product / m.products.floor_single;
    Ok(Table::of(all)
        .text("shape", |m| format!("{}, n = {}", m.case, m.n))
        .text("grid", Measurement::grid)
        .number("steps", Format::Shortest, |m| m.steps)
        .number("all steps [s]", Format::Fixed(1), |m| m.seconds)
        .number("median step [s]", Format::Fixed(3), |m| m.seconds_per_step)
        .number("Newton/step", Format::Fixed(1), |m| m.newton_per_step)
        .number("HVP/step", Format::Fixed(1), |m| m.hvp_per_step)
        .number("and on coarser grids", Format::Fixed(1), |m| {
            m.coarser_hvp_per_step
        })
        .number("ms/HVP", Format::Fixed(2), |m| 1e3 * m.seconds_per_product)
        .number("times two FFT pairs (f32)", Format::Fixed(2), over_floor)
        .number("peak memory [MiB]", Format::Fixed(0), |m| m.peak_mib)
        .number("new pages/HVP", Format::Fixed(1), |m| m.pages_per_product)
        .number("to 100 times the precision", Format::Scientific(1), |m| {
            m.distance_to_tighter
        })
        .finish()?)
}

fn product_table(all: &[Measurement]) -> Result<Table, Error> {
    let ms = Format::Fixed(2);
    Ok(Table::of(all)
        .text("grid", Measurement::grid)
        .number("Burn, f64 [ms]", ms, |m| 1e3 * m.products.burn)
        .number("by hand, f64 [ms]", ms, |m| 1e3 * m.products.by_hand)
        .number("Burn / by hand", ms, |m| m.products.ratio)
        .number("two FFT pairs, f64 [ms]", ms, |m| 1e3 * m.products.floor)
        .number("Burn, f32 [ms]", ms, |m| 1e3 * m.products.burn_single)
        .number("two FFT pairs, f32 [ms]", ms, |m| {
            1e3 * m.products.floor_single
        })
        .number("energy and gradient [ms]", ms, |m| {
            1e3 * m.products.evaluate
        })
        .finish()?)
}

/// Exponent of a power law through the first and the last point.
fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let (first, last) = (points.first()?, points.last()?);
    (last[0] > first[0]).then(|| (last[1] / first[1]).ln() / (last[0] / first[0]).ln())
}

/// Dimensions with their measurements and line styles.
fn dimensions(all: &[Measurement]) -> [(String, Vec<&Measurement>, LineStyle); 2] {
    [(2, LineStyle::Solid), (3, LineStyle::Dashed)].map(|(dimension, style)| {
        let rows = all.iter().filter(|m| m.dimension == dimension);
        (format!("{dimension}D"), rows.collect(), style)
    })
}

fn figure(all: &[Measurement]) -> Figure {
    let mut slopes = Vec::new();
    let cost = dimensions(all).map(|(name, rows, style)| {
        let curve = Series::of(&name, rows, |m| [m.unknowns as f64, m.seconds_per_step]);
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
        .with_panel(parts(all))
        .with_shared_legend()
        .with_note(format!(
            "2D: a cross, eps = 2⁻⁶, tau = 2⁻¹⁴. 3D: a cube at n = 64, a blob at n = 128, eps = 2h, tau = 2⁻¹⁸. {} threads. Cost \
             of a step ~ unknowns to the power {}.",
            rayon::current_num_threads(),
            slopes.join(" and ")
        ))
}

/// Where the time goes: a colour for each part, a line style for each dimension.
fn parts(all: &[Measurement]) -> LineChart {
    let names = all[0].parts().map(|(name, _)| name);
    let axes = (Axis::log("unknowns"), Axis::log("mean per step [s]"));
    let mut chart = LineChart::new("where the time goes", axes.0, axes.1);
    let mut entries = Vec::new();
    for (dimension, rows, style) in dimensions(all) {
        for (k, name) in names.into_iter().enumerate() {
            let points = rows.iter().map(|m| [m.unknowns as f64, m.parts()[k].1]);
            let points: Vec<[f64; 2]> = points.filter(|[_, seconds]| *seconds > 0.0).collect();
            chart = chart.with_series(
                Series::new(format!("{name}, {dimension}"), points)
                    .with_colour(k)
                    .with_style(style)
                    .with_marker(Marker::Circle),
            );
        }
        entries.push(LegendEntry::line(dimension, Colour::Black, style));
    }
    let phases = names.into_iter().enumerate();
    let phases = phases.map(|(k, name)| LegendEntry::line(name, k, LineStyle::Solid));
    chart.with_entries(phases).with_entries(entries)
}

fn summary(all: &[Measurement]) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for m in all {
        let (grid, products) = (m.grid(), &m.products);
        let of_steps = [
            ("seconds", Some(m.seconds)),
            ("seconds_per_step", Some(m.seconds_per_step)),
            (
                "hvp_per_step",
                Some(m.hvp_per_step + m.coarser_hvp_per_step),
            ),
            ("newton_per_step", Some(m.newton_per_step)),
            ("pages_per_product", m.pages_per_product),
            ("distance_to_tighter", m.distance_to_tighter),
            ("peak_mib", m.peak_mib),
        ];
        for (what, value) in of_steps {
            if let Some(value) = value {
                summary.insert(&format!("{}.{what}", m.key()), value)?;
            }
        }
        let of_products = [
            ("ratio", products.ratio),
            ("ms", 1e3 * products.burn),
            ("single_ms", 1e3 * products.burn_single),
            ("over_floor", products.burn / products.floor),
        ];
        for (what, value) in of_products {
            summary.insert(&format!("hvp.{grid}.{what}"), value)?;
        }
    }
    Ok(summary)
}
