use crate::prelude::*;
use crate::storages::{self, StorageOptions};
use crate::{products, shares, surfaces, timing};
use geometry::shapes::Capsule;
use runs::Interrupt;

pub const EXPERIMENT: Experiment = Experiment {
    name: "performance",
    summary: "What a time step costs, and where the time goes.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[
        ResultFolder {
            name: "performance",
            title: "Performance",
            description: "Not in the paper: what a step of the hybrid scheme costs in two and three dimensions, where the time \
                 goes, and what bricks save.",
            figures: &[
                (
                    "performance",
                    "Time of a step, its products, and its parts.",
                ),
                (
                    "storages",
                    "The armadillo on the whole grid and on bricks near the surface: time, memory and stored cells.",
                ),
            ],
            options: Some(""),
        },
        ResultFolder {
            name: "time_shares",
            title: "Where the time goes",
            description: "Not in the paper: the parts of the time of a step and of the whole of `willmore fair`, and how near products are to \
                 what the memory allows.",
            figures: &[(
                "shares",
                "Parts of the wall time of flows, and of `willmore fair`.",
            )],
            options: Some("--shares"),
        },
        ResultFolder {
            name: "gpu",
            title: "Performance on a GPU",
            description: "Not in the paper: what a step costs on an NVIDIA H100 in double precision, with 16 cores for the \
                 work of the host, and what bricks save.",
            figures: &[
                ("performance", "Time of a step, and its parts."),
                (
                    "storages",
                    "The armadillo on the whole grid and on bricks near the surface: time, memory of the host and \
                     stored cells.",
                ),
            ],
            options: None,
        },
    ],
    metrics: &[&METRICS, &shares::METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Costs of a step",
    note: "On a GPU, which computes while the host goes on, the time of a single product is not measured.",
    words: &[
        (
            "CASE",
            "`cross`, `disc` in quick runs, `cube`, `blob`, `armadillo`",
        ),
        (
            "STORAGE",
            "`dense`, the whole grid; `bricks`, what is near the surface",
        ),
    ],
    rows: &[
        (
            "CASE.nN.steps, CASE.nN.seconds, CASE.nN.seconds_per_step",
            "number of steps, wall time of all, median of one",
        ),
        (
            "CASE.nN.hvp_per_step, CASE.nN.hvp_on_this_grid, CASE.nN.hvp_on_coarser_grids",
            "Hessian-vector products per step: all, those on the grid itself, those on coarser grids by their share \
             of the unknowns",
        ),
        ("CASE.nN.newton_per_step", "as for circles"),
        (
            "CASE.nN.ms_per_product, CASE.nN.product_over_floor, CASE.nN.pages_per_product",
            "of a product in the steps: milliseconds, these over its Fourier transforms alone, new pages of memory \
             after the first step",
        ),
        (
            "CASE.nN.peak_mib",
            "largest memory of the process in MiB, after all that earlier runs kept was given back",
        ),
        (
            "CASE.nN.distance_to_tighter",
            "L2 distance after 20 steps to the same flow minimized to a hundredth of the tolerance, over the way",
        ),
        (
            "CASE.nN.STORAGE.seconds, CASE.nN.STORAGE.peak_mib",
            "wall time of 16 steps of the armadillo and 32 of the cross by the accurate operator, with all between \
             minimizations; largest memory",
        ),
        (
            "CASE.nN.STORAGE.active_cells, CASE.nN.STORAGE.active_share, CASE.nN.STORAGE.w",
            "stored cells at the beginning, their part of the grid; Willmore energy of the scheme after the last step",
        ),
        (
            "CASE.nN.STORAGE.steps, CASE.nN.STORAGE.seconds_per_step, CASE.nN.STORAGE.newton_per_step, \
             CASE.nN.STORAGE.hvp_per_step, CASE.nN.STORAGE.hvp_on_this_grid, CASE.nN.STORAGE.hvp_on_coarser_grids, \
             CASE.nN.STORAGE.ms_per_product",
            "as above, for steps and substeps that were not refused",
        ),
        (
            "hvp.armadillo.nN.bricks_over_dense",
            "milliseconds of a Hessian-vector product on bricks over that on the whole grid",
        ),
        (
            "exponent.bricks.seconds, exponent.bricks.peak_mib, exponent.bricks.active_cells",
            "power of `n` with which these grow on bricks, from n = 128 on",
        ),
        (
            "hvp.NxN[xN].ms, hvp.NxN[xN].single_ms, hvp.NxN[xN].by_hand_ms, hvp.NxN[xN].evaluate_ms",
            "milliseconds of a Hessian-vector product through Burn in double and in single precision, of one written \
             by hand, of an energy with its gradient",
        ),
        (
            "hvp.NxN[xN].floor_ms, hvp.NxN[xN].floor_single_ms, hvp.NxN[xN].ratio, hvp.NxN[xN].over_floor",
            "milliseconds of its two pairs of Fourier transforms alone, in both precisions; what the product through \
             Burn takes over that by hand and over the transforms",
        ),
    ],
};

/// Steps of a comparison with a smaller tolerance, and how much smaller.
const COMPARED_STEPS: usize = 20;
const TIGHTER: f64 = 100.0;
/// The finest plane grid on which they are compared.
const FINEST_COMPARED: f64 = 256.0;

/// Cost of Willmore steps by the hybrid scheme on this machine: the cross of the paper (128 steps, eps = 2^-6, tau = tautilde =
/// 2^-14) at n = 128, 256 and 512, and in 3D a cube at n = 64 and a blob at n = 128 (eps = 2h, tautilde = h^2, tau = 2^-18).
/// Hessian-vector products through Burn, by hand, and their Fourier transforms alone take turns in the same run (not on a GPU). Then the armadillo
/// (eps = 2h, 16 steps of the accurate scheme, tau = h^4/32 doubled after every step) on the whole grid and on bricks near the surface, and the
/// cross (eps = 2h, 32 controlled steps of second order) on bricks.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    #[command(flatten)]
    storage: StorageOptions,

    /// Only measure where the time goes, of steps and of `willmore fair`, in a few minutes; not on a GPU
    #[arg(long)]
    shares: bool,

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
    /// system had to provide from the second step on; `distance_to_tighter` is the `L2` distance to a minimization with [much
    /// smaller](TIGHTER) tolerance after [some steps](COMPARED_STEPS), over the way from the start.
    steps: Numbers,
    /// None on a GPU: those by hand are written for the CPU.
    products: Numbers,
    /// Parts of the time of a step in seconds; what a GPU does counts where the host waits for it.
    parts: Vec<(&'static str, f64)>,
}

const STEPS: [(&str, Format, &str); 11] = [
    ("steps", Shortest, "steps"),
    ("all steps [s]", Fixed(1), "seconds"),
    ("median step [s]", Fixed(3), "seconds_per_step"),
    ("Newton/step", Fixed(1), "newton_per_step"),
    ("HVP/step", Fixed(1), "hvp_on_this_grid"),
    ("and on coarser grids", Fixed(1), "hvp_on_coarser_grids"),
    ("ms/HVP", Fixed(2), "ms_per_product"),
    ("times two FFT pairs (f32)", Fixed(2), "product_over_floor"),
    ("peak memory [MiB]", Fixed(0), "peak_mib"),
    ("new pages/HVP", Fixed(1), "pages_per_product"),
    (
        "to 100 times the precision",
        Scientific(1),
        "distance_to_tighter",
    ),
];

const PRODUCTS: [(&str, Format, &str); 7] = [
    ("Burn, f64 [ms]", Fixed(2), "ms"),
    ("by hand, f64 [ms]", Fixed(2), "by_hand_ms"),
    ("Burn / by hand", Fixed(2), "ratio"),
    ("two FFT pairs, f64 [ms]", Fixed(2), "floor_ms"),
    ("Burn, f32 [ms]", Fixed(2), "single_ms"),
    ("two FFT pairs, f32 [ms]", Fixed(2), "floor_single_ms"),
    ("energy and gradient [ms]", Fixed(2), "evaluate_ms"),
];

fn program(options: &Options) -> Result<()> {
    let (run, quick) = (&options.run, options.run.quick);
    let possible = options.turns.is_finite() && options.turns > 0.0;
    require(possible, "--turns must be positive")?;
    let planes: &[usize] = if quick { &[128] } else { &[128, 256, 512] };
    let solids = run.either(
        [("cube", 24, 2), ("blob", 32, 2)],
        [("cube", 64, 20), ("blob", 128, 8)],
    );
    let networks = timing::networks(&options.networks, planes)?;
    let turns = if quick { 0.05 } else { options.turns };
    let parameters = json!({ "turns": turns, "threads": rayon::current_num_threads(), "storages": options.storage.about(run)? });
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    if options.shares {
        require(session.device.kind().is_cpu(), "--shares needs a CPU")?;
        shares::measure(&mut session, &options.storage)?;
        return session.finish("Where the time goes");
    }
    let mut all = Vec::new();
    let shape = run.either("disc", "cross");
    for &n in planes {
        let operator = networks.learned(Formulation::Paper, &convergence_network(n)?)?;
        let case = timing::plane(&operator, n, if quick { 2 } else { 128 }, quick)?;
        all.push(Measurement::of(shape, &case, &mut session, turns)?);
    }
    let stored = options.storage.measure(&mut session)?;
    for (name, n, steps) in solids {
        let operator = networks.learned(Formulation::Paper, &surfaces::needed_network())?;
        let (initial, scales) = (solid_shape(name, n)?, surfaces::scales(n));
        let rule = StepRule::Constant(0.5_f64.powi(18));
        let case = Case::willmore(name, initial, operator, scales, rule, steps);
        all.push(Measurement::of(name, &case, &mut session, turns)?);
    }
    let steps = Sheet::of(&all)
        .keyed(|m, name| format!("{}.n{}.{name}", m.case, m.n))
        .text("shape", |m| format!("{}, n = {}", m.case, m.n))
        .text("grid", Measurement::grid)
        .numbers(&STEPS, |m| &m.steps);
    session.sheet(steps, "steps")?;
    if session.device.kind().is_cpu() {
        let products = Sheet::of(&all)
            .keyed(|m, name| format!("hvp.{}.{name}", m.grid()))
            .text("grid", Measurement::grid)
            .numbers(&PRODUCTS, |m| &m.products);
        session.sheet(products, "products")?;
    }
    session.output.write_json("performance.json", &all)?;
    session.figure(figure(&all, shape, &session.device), "performance")?;
    storages::write(&stored, &mut session)?;
    session.finish("Willmore steps by the hybrid scheme on this machine")
}

/// A cube of side 1/2, or a body with arms: a ball with three capsules through it.
fn solid_shape(name: &str, n: usize) -> Result<Field<3>> {
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

/// Distance of the end of some steps to that with a smaller tolerance, over the way from the start.
fn distance_to_tighter<const D: usize>(case: &Case<D>, device: &ComputeDevice) -> Result<f64> {
    let end = |mut case: Case<D>| -> Result<Field<D>> {
        case.stops.push(Stop::Steps(COMPARED_STEPS));
        let mut run = Run::new(case, device)?;
        run.advance(None, &mut [], &Interrupt::never())?;
        Ok(run.field().clone())
    };
    let mut tighter = case.clone();
    let newton = &mut tighter.scales.newton;
    newton.tolerance /= TIGHTER;
    // Linear solves that leave a tenth would take a Newton step for every digit.
    newton.cg_tolerance /= TIGHTER.sqrt();
    let (loose, tight) = (end(case.clone())?, end(tighter)?);
    Ok(l2_distance(&loose, &tight)? / l2_distance(&case.initial.field()?, &tight)?)
}

impl Measurement {
    fn of<const D: usize>(
        case_name: &'static str,
        case: &Case<D>,
        session: &mut Session,
        turns: f64,
    ) -> Result<Self> {
        let grid = *case.grid();
        let n = grid.spacing().recip().round();
        let name = format!("{case_name}, n = {n}");
        memory::release_kept();
        memory::forget_peak();
        let mut run = Run::new(case.clone(), &session.device)?;
        let mut warm = None;
        session.phase(format!("{name}: steps"), |stage| {
            while run.step()?.is_some() {
                stage.bar.inc(1);
                warm = warm.or_else(memory::pages);
            }
            Ok(())
        })?;
        let later = minimizations(run.records()).skip(1);
        let later: f64 = later.map(|made| made.newton.hvp as f64).sum();
        let pages = memory::pages().zip(warm);
        let pages = pages.map(|(now, warm)| (now - warm) as f64 / later.max(1.0));
        let peak_mib = memory::peak_mib();
        let (products, distance) = session.phase(format!("{name}: products"), |stage| {
            let (device, network) = (stage.device, case.operator.network());
            let network = &network.expect("a learned operator").network;
            let compared = D == 2 && n <= FINEST_COMPARED;
            let distance = compared.then(|| distance_to_tighter(case, device));
            let on_cpu = device.kind().is_cpu();
            let products = on_cpu.then(|| products::measure(network, run.field(), device, turns));
            let products = products.transpose()?.unwrap_or_default();
            Ok((products, distance.transpose()?))
        })?;
        let mut steps = timing::numbers(&run, &session.device);
        let floor = products.get("floor_single_ms").copied();
        let over_floor = floor.map(|ms| steps["ms_per_product"] / ms);
        let others = [
            ("product_over_floor", over_floor),
            ("pages_per_product", pages),
            ("peak_mib", peak_mib),
            ("distance_to_tighter", distance),
        ];
        let others = others.into_iter();
        steps.extend(others.filter_map(|(name, value)| Some((name, value?))));
        Ok(Self {
            case: case_name,
            n: n as usize,
            cells: vec![grid.cells(); D],
            parts: parts(&run, floor),
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

/// Parts of the time of a step, where two pairs of transforms, if they were timed alone, take so many milliseconds.
fn parts<const D: usize>(run: &Run<D>, floor_ms: Option<f64>) -> Vec<(&'static str, f64)> {
    let mean = |of: fn(&StepRecord) -> f64| timing::mean(run, of);
    let products = mean(|r| r.times.products);
    let mut parts = match floor_ms {
        Some(ms) => {
            let convolutions = (1e-3 * ms * mean(|r| r.newton.hvp as f64)).min(products);
            vec![
                ("convolutions of products", convolutions),
                ("other work of products", products - convolutions),
            ]
        }
        None => vec![("products", products)],
    };
    parts.extend([
        ("preconditioner", mean(|r| r.times.preconditioner)),
        ("coarse assembly", mean(|r| r.times.assembly)),
        ("energies and gradients", mean(|r| r.times.energies)),
        ("start on the half grid", mean(|r| r.times.start)),
    ]);
    let all = parts.iter().map(|(_, seconds)| seconds).sum::<f64>();
    parts.push(("rest", (mean(|r| r.seconds) - all).max(0.0)));
    parts
}

/// The cost of a step, and where the time goes: a colour for each part, a line style for each dimension.
fn figure(all: &[Measurement], plane: &str, device: &ComputeDevice) -> Figure {
    let solids = all.iter().filter(|m| m.cells.len() == 3);
    let solids = solids.map(|m| format!("a {} at n = {}", m.case, m.n));
    let solids: Vec<String> = solids.collect();
    let chart = |title: &str, y: &str| LineChart::new(title, Axis::log("unknowns"), Axis::log(y));
    let mut cost = chart("cost of a step", "median step [s]");
    let mut shares = chart("where the time goes", "mean per step [s]");
    let (mut slopes, mut entries) = (Vec::new(), Vec::new());
    for (dimension, style) in [(2, LineStyle::Solid), (3, LineStyle::Dashed)] {
        let rows = || all.iter().filter(|m| m.cells.len() == dimension);
        let name = format!("{dimension}D");
        let curve = |name: &str, points: Vec<[f64; 2]>| {
            let curve = Series::new(name, points).with_style(style);
            curve.with_marker(Marker::Circle)
        };
        let seconds = rows().map(|m| [m.unknowns(), m.steps["seconds_per_step"]]);
        let seconds = curve(&name, seconds.collect()).with_colour(Colour::Black);
        slopes.extend(timing::exponent(&seconds.points).map(|p| format!("{p:.2} in {name}")));
        cost = cost.with_curves([seconds]);
        for (k, (part, _)) in all[0].parts.iter().enumerate() {
            let seconds = rows().map(|m| [m.unknowns(), m.parts[k].1]);
            let seconds = seconds.filter(|[_, seconds]| *seconds > 0.0).collect();
            let curve = curve(&format!("{part}, {name}"), seconds);
            shares = shares.with_curves([curve.with_colour(k)]);
        }
        entries.push(LegendEntry::line(name, Colour::Black, style));
    }
    let parts = all[0].parts.iter().enumerate();
    let parts = parts.map(|(k, (part, _))| LegendEntry::line(*part, k, LineStyle::Solid));
    let waiting = if device.kind().is_cpu() {
        ""
    } else {
        " What the GPU does counts where the host waits for it."
    };
    Figure::new("Willmore steps by the hybrid scheme", 2)
        .with_panel(cost.with_entries([]))
        .with_panel(shares.with_entries(parts).with_entries(entries))
        .with_shared_legend()
        .with_note(format!(
            "2D: a {}, eps = 2⁻⁶, tau = 2⁻¹⁴. 3D: {}, eps = 2h, tau = 2⁻¹⁸. On {}. Cost of a step ~ unknowns to the power {}.{waiting}",
            plane,
            solids.join(", "),
            timing::machine(device),
            slopes.join(" and ")
        ))
}
