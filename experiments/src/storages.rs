//! What a surface and a curve cost by what is stored of their phase fields: the whole grid, or bricks near them.

use crate::meshes::{ARMADILLO, Loaded, MeshOptions};
use crate::prelude::*;
use crate::surfaces::{centred_box, needed_network, scales};
use crate::timing;
use crate::truth::CROSS;

/// Steps on every grid, each twice as long as the one before,
const STEPS: usize = 16;
/// the first one in units of `h^4`: on finer grids smaller details vanish in shorter times. In the last one the limbs of the armadillo are
/// about to vanish at `n = 128`.
const FIRST_STEP: f64 = 1.0 / 32.0;
/// The one that takes less memory first, since what it takes is seen only from there on.
const STORAGES: [Storage; 2] = [Storage::Bricks, Storage::Dense];
/// Controlled steps of the cross, on bricks.
const CROSS_STEPS: usize = 32;
/// Steps of surfaces and of the cross in a quick run.
const QUICK_STEPS: usize = 2;
/// Exponents are those from here to the finest.
const COARSEST_FITTED: f64 = 128.0;

#[derive(Args, Clone, Debug)]
pub struct StorageOptions {
    #[command(flatten)]
    mesh: MeshOptions,

    /// Cells per unit length of the armadillo, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = [64, 128, 256, 512])]
    surface_cells: Vec<usize>,

    /// Finest grid of the armadillo that is stored as a whole
    #[arg(long, value_name = "N", default_value_t = 256)]
    dense_up_to: usize,

    /// Cells per unit length of the cross on bricks, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = [1024, 2048])]
    curve_cells: Vec<usize>,
}

/// What was measured at one resolution with one storage.
pub struct Measured {
    /// The name in metrics, also of what stands in for the armadillo.
    shape: &'static str,
    title: String,
    n: usize,
    storage: Storage,
    /// Wall time of all steps, with all that the engine does between minimizations; work, memory and cells.
    numbers: Numbers,
}

const COLUMNS: [(&str, Format, &str); 7] = [
    ("all steps [s]", Fixed(1), "seconds"),
    ("HVP/step", Fixed(1), "hvp_per_step"),
    ("ms/HVP", Fixed(2), "ms_per_product"),
    ("stored cells", Shortest, "active_cells"),
    ("of the grid", Fixed(3), "active_share"),
    ("peak memory [MiB]", Fixed(0), "peak_mib"),
    ("Willmore energy", Fixed(3), "w"),
];

impl StorageOptions {
    /// What is measured, for the manifest; what cannot be read or measured, or is not for all of the grids, is refused.
    pub fn about(&self, run: &RunOptions) -> Result<Value> {
        let possible = |n: &usize| *n >= 16 && n.is_multiple_of(8);
        let mut cells = self.surface_cells.iter().chain(&self.curve_cells);
        let message =
            "--surface-cells and --curve-cells must be multiples of 8, from 16 on, as bricks are";
        require(cells.all(possible), message)?;
        let [curve_cells, surface_cells] = self.cells(run);
        let mut mesh = Value::Null;
        for &n in &surface_cells {
            mesh = self.mesh(run, n)?.1.about;
        }
        Ok(json!({
            "mesh": mesh, "surface_cells": surface_cells, "dense_up_to": self.dense_up_to, "curve_cells": curve_cells,
        }))
    }

    /// Cells per unit length of the cross and of the armadillo.
    fn cells(&self, run: &RunOptions) -> [Vec<usize>; 2] {
        let usual = [&self.curve_cells[..], &self.surface_cells];
        run.either([&[64][..], &[32, 64]], usual).map(distinct)
    }

    /// The grid of the armadillo, and its mesh there: the built-in figure in a quick run, or if it is not here.
    fn mesh(&self, run: &RunOptions, n: usize) -> Result<(Grid<3>, Loaded)> {
        let mut options = self.mesh.clone();
        options.procedural |= run.quick;
        let grid = centred_box(n, options.box_side(&ARMADILLO))?;
        let mesh = options.load_or_built_in(&ARMADILLO, &grid)?;
        Ok((grid, mesh))
    }

    /// Lets the cross flow on bricks, and then the armadillo on both storages at every resolution.
    pub fn measure(&self, session: &mut Session) -> Result<Vec<Measured>> {
        let cross_steps = session.options.either(QUICK_STEPS, CROSS_STEPS);
        let [curves, surfaces] = self.cells(&session.options);
        let mut measured = Vec::new();
        let forget_memory = || {
            memory::release_kept();
            memory::forget_peak();
        };
        for n in curves {
            forget_memory();
            let grid = Grid::per_unit(n, CROSS.side)?;
            let mut scales = scales(n);
            scales.newton = NewtonParams::second_order();
            let initial = (CROSS.initial)(grid, scales.eps)?;
            let operator = operator(ACCURATE, &grid, &scales)?;
            let (rule, count) = (StepRule::Controlled, cross_steps);
            let case = Case::willmore(CROSS.key, initial, operator, scales, rule, count);
            measured.push(Measured::new(CROSS.key, n, Storage::Bricks, case, session)?);
        }
        for n in surfaces {
            for storage in STORAGES {
                if storage == Storage::Dense && n > self.dense_up_to {
                    continue;
                }
                forget_memory();
                let case = self.surface(session, n, storage)?;
                measured.push(Measured::new("armadillo", n, storage, case, session)?);
            }
        }
        Ok(measured)
    }

    /// The flow of the armadillo.
    pub fn surface(&self, session: &mut Session, n: usize, storage: Storage) -> Result<Case<3>> {
        let (grid, mesh) = self.mesh(&session.options, n)?;
        let (title, scales) = (mesh.title.clone(), scales(n));
        let distances = format!("{title}, n = {n}, {storage}: signed distance");
        let initial = session.phase(distances, |stage| {
            mesh.phase_field(grid, scales.eps, &stage.bar)
        })?;
        let rule = StepRule::Doubling(FIRST_STEP * grid.spacing().powi(4));
        let operator = Chosen::default().learned(Formulation::Accurate, &needed_network())?;
        let steps = session.options.either(QUICK_STEPS, STEPS);
        let mut case = Case::willmore(&title, initial, operator, scales, rule, steps);
        case.operator.storage = storage;
        Ok(case)
    }
}

impl Measured {
    fn new<const D: usize>(
        shape: &'static str,
        n: usize,
        storage: Storage,
        mut case: Case<D>,
        session: &mut Session,
    ) -> Result<Self> {
        case.measures.clear();
        case.operator.storage = storage;
        let (title, nodes) = (case.shape.clone(), case.grid().len() as f64);
        let mut run = Run::new(case, &session.device)?;
        let cells = run.stored_cells() as f64;
        let steps = format!("{title}, n = {n}, {storage}: steps");
        let seconds = session.phase(steps, |stage| {
            let clock = Instant::now();
            stage.finish(&mut run)?;
            Ok(clock.elapsed().as_secs_f64())
        })?;
        let mut numbers = timing::numbers(&run, &session.device);
        numbers.extend([
            ("seconds", seconds),
            ("active_cells", cells),
            ("active_share", cells / nodes),
        ]);
        let last = minimizations(run.records()).last();
        numbers.extend(last.map(|made| ("w", made.willmore_energy)));
        numbers.extend(memory::peak_mib().map(|peak| ("peak_mib", peak)));
        Ok(Self {
            shape,
            title,
            n,
            storage,
            numbers,
        })
    }
}

/// Writes the table, the metrics and the figure of the two storages.
pub fn write(stored: &[Measured], session: &mut Session) -> Result<()> {
    let sheet = Sheet::of(stored)
        .keyed(|row, name| format!("{}.n{}.{}.{name}", row.shape, row.n, row.storage))
        .text("shape", |row| row.shape)
        .text("n", |row| row.n.to_string())
        .text("storage", |row| row.storage.to_string())
        .numbers(&COLUMNS, |row| &row.numbers);
    session.sheet(sheet, "storages")?;
    let products = |storage| surfaces(stored, storage, "ms_per_product");
    for [n, dense] in products(Storage::Dense) {
        let bricks = products(Storage::Bricks).find(|[m, _]| m.to_bits() == n.to_bits());
        let ratio = bricks.map(|[_, bricks]| bricks / dense);
        session.metric(&format!("hvp.armadillo.n{n}.bricks_over_dense"), ratio)?;
    }
    for name in ["seconds", "peak_mib", "active_cells"] {
        session.metric(&format!("exponent.bricks.{name}"), exponent(stored, name))?;
    }
    let steps = session.options.either(QUICK_STEPS, STEPS);
    session.figure(figure(stored, steps, &session.device), "storages")
}

fn surfaces(measured: &[Measured], storage: Storage, name: &str) -> impl Iterator<Item = [f64; 2]> {
    let is_own = move |row: &&Measured| row.shape != CROSS.key && row.storage == storage;
    let rows = measured.iter().filter(is_own);
    rows.filter_map(move |row| Some([row.n as f64, *row.numbers.get(name)?]))
}

/// The exponent of a number on bricks in `n`, from 128 on.
fn exponent(measured: &[Measured], name: &str) -> Option<f64> {
    let points = surfaces(measured, Storage::Bricks, name);
    let points: Vec<_> = points.filter(|[n, _]| *n >= COARSEST_FITTED).collect();
    timing::exponent(&points)
}

/// Seconds and memory against `n`, a colour for each storage.
fn figure(measured: &[Measured], steps: usize, device: &ComputeDevice) -> Figure {
    let memory = if device.kind().is_cpu() {
        "largest memory [MiB]"
    } else {
        "memory of the host [MiB]"
    };
    let panel = |title: &str, y: &str, name: &str| {
        let curves = STORAGES.into_iter().enumerate().map(|(colour, storage)| {
            let points: Vec<_> = surfaces(measured, storage, name).collect();
            let series = Series::new(storage.to_string(), points).with_colour(colour);
            series.with_marker(Marker::Circle)
        });
        LineChart::new(title, Axis::log("cells per unit length n"), Axis::log(y))
            .with_curves(curves)
    };
    let fitted = exponent(measured, "seconds").map(|exponent| {
        format!(" On bricks seconds grow like n to the power {exponent:.2} from n = {COARSEST_FITTED} on.")
    });
    let title = measured.last().map_or("surface", |row| &row.title);
    Figure::new(format!("The {title} on the whole grid and on bricks"), 3)
        .with_panel(panel("time", "all steps [s]", "seconds"))
        .with_panel(panel("memory", memory, "peak_mib"))
        .with_panel(panel("size", "stored cells", "active_cells"))
        .with_shared_legend()
        .with_note(format!(
            "{steps} steps of Willmore flow, tau = h⁴/32 doubled after every step, eps = 2h; on {}.{}",
            timing::machine(device),
            fitted.unwrap_or_default()
        ))
}
