//! What a time step costs, and where the time goes.

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use experiments::circles::{EPS, STEP};
use experiments::comparison::cross;
use experiments::networks::{NetworkOptions, convergence_ratios};
use experiments::options::RunOptions;
use experiments::products::{Candidates, ProductTimes, median};
use experiments::{Error, harness, memory};
use geometry::measure::l2_distance;
use geometry::shapes::{Ball, Capsule, Cuboid};
use geometry::{Field, Grid, SignedDistanceExt, phase_field};
use indicatif::ProgressBar;
use model::{Network, Ratios};
use operators::ComputeDevice;
use report::{
    Axis, Colour, Column, Figure, Format, LegendEntry, LineChart, LineStyle, Marker, Series,
    Summary, Table,
};
use serde::Serialize;
use solver::{FlowParams, NewtonParams, PhaseTimes, StepRecord, WillmoreFlow};

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

#[derive(Serialize)]
struct Parameters {
    turns: f64,
    quick: bool,
    threads: usize,
}

/// What was measured for one shape on one grid.
#[derive(Serialize, Clone, Debug)]
struct Measurement {
    case: &'static str,
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

impl Measurement {
    fn key(&self) -> String {
        format!("{}.n{}", self.case, self.n)
    }

    fn label(&self) -> String {
        format!("{}, n = {}", self.case, self.n)
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

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    if !(options.turns.is_finite() && options.turns > 0.0) {
        return Err(Error::Options("--turns must be positive".to_owned()));
    }
    let device = options.run.open_device()?;
    if !device.kind().is_cpu() {
        return Err(Error::Options(format!(
            "{PROGRAM} compares with products written for the CPU: choose --device flex or ndarray, not {}",
            device.kind()
        )));
    }
    let planes: &[usize] = if quick { &[128] } else { &[128, 256, 512] };
    let solid = Ratios {
        dimension: 3,
        width: 17,
        eps_over_h: 2.0,
        step_over_h2: 1.0,
    };
    let mut ratios = planes
        .iter()
        .map(|&n| convergence_ratios(n))
        .collect::<Result<Vec<_>, _>>()?;
    ratios.push(solid);
    let networks = options.networks.find(&ratios)?;
    let output = options.run.open_output(PROGRAM)?;
    let turns = if quick { 0.05 } else { options.turns };
    let parameters = Parameters {
        turns,
        quick,
        threads: rayon::current_num_threads(),
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let progress = options.run.progress();
    let turns = Duration::from_secs_f64(turns);
    let mut all = Vec::new();
    for (&n, network) in planes.iter().zip(&networks) {
        let steps = if quick { 2 } else { 128 };
        let bar = progress.bar(format!("cross, n = {n}"), steps as u64);
        let initial = cross_or_disc(n, quick)?;
        let case = Case {
            name: "cross",
            eps: EPS,
            mcf_step: STEP,
            tau: STEP,
            steps,
            compared: n <= 256,
        };
        all.push(manifest.phase(format!("cross, n = {n}"), || {
            case.measure(&initial, network, &device, turns, &bar)
        })?);
        bar.finish();
    }
    let network = &networks[networks.len() - 1];
    let solids = if quick {
        [("cube", 24, 2), ("blob", 32, 2)]
    } else {
        [("cube", 64, 20), ("blob", 128, 8)]
    };
    for (name, n, steps) in solids {
        let spacing = 1.0 / n as f64;
        let bar = progress.bar(format!("{name}, n = {n}"), steps as u64);
        let initial = solid_shape(name, n)?;
        let case = Case {
            name,
            eps: 2.0 * spacing,
            mcf_step: spacing * spacing,
            tau: 0.5_f64.powi(18),
            steps,
            compared: false,
        };
        all.push(manifest.phase(format!("{name}, n = {n}"), || {
            case.measure(&initial, network, &device, turns, &bar)
        })?);
        bar.finish();
    }

    let (steps, products) = (step_table(&all)?, product_table(&all)?);
    steps.write(&output, "steps")?;
    products.write(&output, "products")?;
    output.write("performance.json", report::data::to_json(&all)?)?;
    figure(&options.run, &all).write(&output, "performance")?;
    summary(&all)?.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\n{}\nResults are in {}",
        options
            .run
            .title("Willmore steps by the hybrid scheme on this machine"),
        steps.to_markdown(),
        products.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

fn cross_or_disc(n: usize, quick: bool) -> Result<Field<2>, Error> {
    if quick {
        let grid = Grid::per_unit(n, 0.75)?;
        return Ok(phase_field(grid, &Ball::new([0.0, 0.0], 0.2)?, EPS)?);
    }
    cross(Grid::per_unit(n, 2.0)?, EPS)
}

/// A cube of side 1/2, or a body with arms: a ball with three capsules through it.
fn solid_shape(name: &str, n: usize) -> Result<Field<3>, Error> {
    let grid = Grid::<3>::per_unit(n, 1.0)?;
    let eps = 2.0 * grid.spacing();
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

/// A flow to be measured.
struct Case {
    name: &'static str,
    eps: f64,
    mcf_step: f64,
    tau: f64,
    steps: usize,
    /// Whether it is compared with a smaller tolerance.
    compared: bool,
}

/// A flow as the experiments run it.
fn begun<const D: usize>(
    params: FlowParams,
    initial: &Field<D>,
    network: &Network,
    device: &ComputeDevice,
) -> Result<WillmoreFlow<D>, Error> {
    let mut flow = WillmoreFlow::with_network(network, initial, params, device)?;
    flow.begin_on_half_grids(network)?;
    Ok(flow)
}

impl Case {
    fn params(&self) -> FlowParams {
        FlowParams {
            eps: self.eps,
            mcf_step: self.mcf_step,
            newton: NewtonParams::default(),
            calibration: solver::Factors::PAPER,
        }
    }

    fn distance_to_tighter<const D: usize>(
        &self,
        initial: &Field<D>,
        network: &Network,
        device: &ComputeDevice,
    ) -> Result<f64, Error> {
        let end = |params| -> Result<Field<D>, Error> {
            let mut flow = begun(params, initial, network, device)?;
            for _ in 0..self.steps.min(COMPARED_STEPS) {
                flow.advance(self.tau)?;
            }
            Ok(flow.field()?)
        };
        let params = self.params();
        let mut tighter = params;
        tighter.newton.tolerance /= TIGHTER;
        // Linear solves that leave a tenth would take a Newton step for every digit.
        tighter.newton.cg_tolerance /= TIGHTER.sqrt();
        let (loose, tight) = (end(params)?, end(tighter)?);
        Ok(l2_distance(&loose, &tight)? / l2_distance(initial, &tight)?)
    }

    fn measure<const D: usize>(
        &self,
        initial: &Field<D>,
        network: &Network,
        device: &ComputeDevice,
        turns: Duration,
        bar: &ProgressBar,
    ) -> Result<Measurement, Error> {
        let grid = *initial.grid();
        memory::forget_peak();
        let mut flow = begun(self.params(), initial, network, device)?;
        let mut records: Vec<StepRecord> = Vec::new();
        let mut warm = None;
        for _ in 0..self.steps {
            records.push(flow.advance(self.tau)?);
            warm = warm.or_else(memory::pages);
            bar.inc(1);
        }
        let pages = memory::pages().zip(warm).map(|(now, warm)| now - warm);
        let peak_mib = memory::peak_mib();
        let field = flow.field()?;
        drop(flow);
        let distance_to_tighter = if self.compared {
            Some(self.distance_to_tighter(initial, network, device)?)
        } else {
            None
        };
        let products = Candidates::new(network, &field, device)?.measure(turns);
        let count = records.len() as f64;
        let sum = |f: &dyn Fn(&StepRecord) -> f64| records.iter().map(f).sum::<f64>();
        let hvp = sum(&|r| r.newton.hvp as f64);
        let times = PhaseTimes {
            products: sum(&|r| r.times.products),
            preconditioner: sum(&|r| r.times.preconditioner),
            assembly: sum(&|r| r.times.assembly),
            energies: sum(&|r| r.times.energies),
            start: sum(&|r| r.times.start),
        };
        Ok(Measurement {
            case: self.name,
            dimension: D,
            n: (1.0 / grid.spacing()).round() as usize,
            cells_per_side: grid.cells(),
            unknowns: grid.len(),
            steps: self.steps,
            seconds: sum(&|r| r.seconds),
            seconds_per_step: median(records.iter().map(|r| r.seconds).collect()),
            newton_per_step: sum(&|r| r.newton.newton as f64) / count,
            hvp_per_step: hvp / count,
            coarser_hvp_per_step: sum(&|r| r.start.hvp) / count,
            seconds_per_product: times.products / hvp,
            times,
            peak_mib,
            products,
            distance_to_tighter,
            pages_per_product: pages.map(|pages| {
                let later = records.iter().skip(1).map(|r| r.newton.hvp as f64);
                pages as f64 / later.sum::<f64>().max(1.0)
            }),
        })
    }
}

fn step_table(all: &[Measurement]) -> Result<Table, Error> {
    let mut table = Table::new([
        Column::text("shape"),
        Column::text("grid"),
        Column::number("steps", Format::Shortest),
        Column::number("all steps [s]", Format::Fixed(1)),
        Column::number("median step [s]", Format::Fixed(3)),
        Column::number("Newton/step", Format::Fixed(1)),
        Column::number("HVP/step", Format::Fixed(1)),
        Column::number("and on coarser grids", Format::Fixed(1)),
        Column::number("ms/HVP", Format::Fixed(2)),
        Column::number("times two FFT pairs (f32)", Format::Fixed(2)),
        Column::number("peak memory [MiB]", Format::Fixed(0)),
        Column::number("new pages/HVP", Format::Fixed(1)),
        Column::number("to 100 times the precision", Format::Scientific(1)),
    ]);
    for m in all {
        table.push([
            m.label().into(),
            m.grid().into(),
            m.steps.into(),
            m.seconds.into(),
            m.seconds_per_step.into(),
            m.newton_per_step.into(),
            m.hvp_per_step.into(),
            m.coarser_hvp_per_step.into(),
            (1e3 * m.seconds_per_product).into(),
            (m.seconds_per_product / m.products.floor_single).into(),
            m.peak_mib.into(),
            m.pages_per_product.into(),
            m.distance_to_tighter.into(),
        ])?;
    }
    Ok(table)
}

fn product_table(all: &[Measurement]) -> Result<Table, Error> {
    let mut table = Table::new([
        Column::text("grid"),
        Column::number("Burn, f64 [ms]", Format::Fixed(2)),
        Column::number("by hand, f64 [ms]", Format::Fixed(2)),
        Column::number("Burn / by hand", Format::Fixed(2)),
        Column::number("two FFT pairs, f64 [ms]", Format::Fixed(2)),
        Column::number("Burn, f32 [ms]", Format::Fixed(2)),
        Column::number("two FFT pairs, f32 [ms]", Format::Fixed(2)),
        Column::number("energy and gradient [ms]", Format::Fixed(2)),
    ]);
    for m in all {
        let p = m.products;
        table.push([
            m.grid().into(),
            (1e3 * p.burn).into(),
            (1e3 * p.by_hand).into(),
            p.ratio.into(),
            (1e3 * p.floor).into(),
            (1e3 * p.burn_single).into(),
            (1e3 * p.floor_single).into(),
            (1e3 * p.evaluate).into(),
        ])?;
    }
    Ok(table)
}

/// Exponent of a power law through the first and the last point.
fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let (first, last) = (points.first()?, points.last()?);
    (last[0] > first[0]).then(|| (last[1] / first[1]).ln() / (last[0] / first[0]).ln())
}

/// Line style in figures.
fn style(dimension: usize) -> LineStyle {
    if dimension == 2 {
        LineStyle::Solid
    } else {
        LineStyle::Dashed
    }
}

fn figure(run: &RunOptions, all: &[Measurement]) -> Figure {
    let mut cost = LineChart::new(
        "cost of a step",
        Axis::log("unknowns"),
        Axis::log("median step [s]"),
    );
    let mut slopes = Vec::new();
    for dimension in [2, 3] {
        let points: Vec<[f64; 2]> = all
            .iter()
            .filter(|m| m.dimension == dimension)
            .map(|m| [m.unknowns as f64, m.seconds_per_step])
            .collect();
        if let Some(slope) = slope(&points) {
            slopes.push(format!("{slope:.2} in {dimension}D"));
        }
        cost = cost.with_series(
            Series::new(format!("{dimension}D"), points)
                .with_colour(Colour::Black)
                .with_style(style(dimension))
                .with_marker(Marker::Circle),
        );
    }
    let mut parts = LineChart::new(
        "where the time goes",
        Axis::log("unknowns"),
        Axis::log("mean per step [s]"),
    );
    let mut entries = Vec::new();
    for dimension in [2, 3] {
        let rows: Vec<&Measurement> = all.iter().filter(|m| m.dimension == dimension).collect();
        let Some(first) = rows.first() else { continue };
        let style = style(dimension);
        let name = format!("{dimension}D");
        entries.push(LegendEntry::line(name, Colour::Black, style));
        for (k, (name, _)) in first.parts().into_iter().enumerate() {
            let points: Vec<[f64; 2]> = rows
                .iter()
                .map(|m| [m.unknowns as f64, m.parts()[k].1])
                .filter(|[_, seconds]| *seconds > 0.0)
                .collect();
            parts = parts.with_series(
                Series::new(format!("{name}, {dimension}D"), points)
                    .with_colour(k)
                    .with_style(style)
                    .with_marker(Marker::Circle),
            );
        }
    }
    let names = all.first().map(Measurement::parts).unwrap_or_default();
    let phases = names
        .iter()
        .enumerate()
        .map(|(k, (name, _))| LegendEntry::line(*name, k, LineStyle::Solid));
    Figure::new(run.title("Willmore steps by the hybrid scheme"), 2)
        .with_panel(cost.with_entries([]))
        .with_panel(parts.with_entries(phases).with_entries(entries))
        .with_shared_legend()
        .with_note(format!(
            "2D: a cross, eps = 2⁻⁶, tau = 2⁻¹⁴. 3D: a cube at n = 64, a blob at n = 128, eps = 2h, tau = 2⁻¹⁸. {} threads. Cost \
             of a step ~ unknowns to the power {}.",
            rayon::current_num_threads(),
            slopes.join(" and ")
        ))
}

fn summary(all: &[Measurement]) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    for m in all {
        let key = m.key();
        summary.insert(&format!("{key}.seconds"), m.seconds)?;
        summary.insert(&format!("{key}.seconds_per_step"), m.seconds_per_step)?;
        let hvp = m.hvp_per_step + m.coarser_hvp_per_step;
        summary.insert(&format!("{key}.hvp_per_step"), hvp)?;
        summary.insert(&format!("{key}.newton_per_step"), m.newton_per_step)?;
        if let Some(pages) = m.pages_per_product {
            summary.insert(&format!("{key}.pages_per_product"), pages)?;
        }
        if let Some(distance) = m.distance_to_tighter {
            summary.insert(&format!("{key}.distance_to_tighter"), distance)?;
        }
        if let Some(peak) = m.peak_mib {
            summary.insert(&format!("{key}.peak_mib"), peak)?;
        }
        let grid = m.grid();
        summary.insert(&format!("hvp.{grid}.ratio"), m.products.ratio)?;
        summary.insert(&format!("hvp.{grid}.ms"), 1e3 * m.products.burn)?;
        summary.insert(
            &format!("hvp.{grid}.single_ms"),
            1e3 * m.products.burn_single,
        )?;
        let floor = m.products.burn / m.products.floor;
        summary.insert(&format!("hvp.{grid}.over_floor"), floor)?;
    }
    Ok(summary)
}
