//! What a surface and a curve cost by what is stored of their phase fields: the whole grid, or bricks near them.

use derive_more::Display;
use engine::Storage;
use operators::memory;

use crate::meshes::{ARMADILLO, Loaded, MeshOptions};
use crate::prelude::*;
use crate::surfaces::{accurate_operator, centred_box, needed_network, scales, willmore_flow};
use crate::timing::{self, Numbers, Timed};
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
/// Exponents are those from here to the finest.
const COARSEST_FITTED: usize = 128;

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
#[derive(Display, Serialize)]
#[display("{shape}.n{n}.{storage}")]
pub struct Stored {
    pub shape: &'static str,
    pub n: usize,
    pub storage: Storage,
    /// Wall time of all steps, with all that the engine does between minimizations; work, memory and cells.
    pub numbers: Numbers,
}

/// Columns of the table.
pub const COLUMNS: [(&str, Format, &str); 7] = [
    ("all steps [s]", Fixed(1), "seconds"),
    ("HVP/step", Fixed(1), "hvp_per_step"),
    ("ms/HVP", Fixed(2), "ms_per_product"),
    ("stored cells", Shortest, "active_cells"),
    ("of the grid", Fixed(3), "active_share"),
    ("peak memory [MiB]", Fixed(0), "peak_mib"),
    ("Willmore energy", Fixed(3), "w"),
];

impl StorageOptions {
    /// Refuses resolutions that cannot be measured.
    pub fn check(&self) -> Result<(), Error> {
        let possible = |n: &usize| *n >= 16 && n.is_multiple_of(8);
        require(
            self.surface_cells
                .iter()
                .chain(&self.curve_cells)
                .all(possible),
            "--surface-cells and --curve-cells must be multiples of 8, from 16 on, as bricks are",
        )
    }

    /// Lets the cross flow on bricks, and then the armadillo on both storages at every resolution; the built-in figure in a quick run, or if it
    /// is not here.
    pub fn measure(
        &self,
        networks: &NetworkOptions,
        session: &mut Session<'_>,
    ) -> Result<Vec<Stored>, Error> {
        let networks = networks.load(&[needed_network()])?;
        let network = networks.find(Scheme::Accurate, &needed_network())?;
        let mut operator = Operator::learned(Scheme::Accurate, network)?;
        let mut measured = Vec::new();
        let quick = session.options.quick;
        let curves = if quick {
            vec![64]
        } else {
            self.curve_cells.clone()
        };
        for n in curves {
            measured.push(curve(n, session)?);
        }
        for n in self.resolutions(quick) {
            for storage in STORAGES {
                if storage == Storage::Dense && n > self.dense_up_to {
                    continue;
                }
                operator.storage = storage;
                measured.push(self.surface(n, operator.clone(), session)?);
            }
        }
        Ok(measured)
    }

    fn resolutions(&self, quick: bool) -> Vec<usize> {
        if quick {
            vec![32, 64]
        } else {
            self.surface_cells.clone()
        }
    }

    fn mesh(&self, grid: &Grid<3>, quick: bool) -> Result<Loaded, Error> {
        let procedural = self.mesh.procedural || quick;
        let options = MeshOptions {
            procedural,
            ..self.mesh.clone()
        };
        options.load_or_built_in(&ARMADILLO, grid)
    }

    fn surface(
        &self,
        n: usize,
        operator: Operator,
        session: &mut Session<'_>,
    ) -> Result<Stored, Error> {
        let quick = session.options.quick;
        memory::release_freed();
        memory::forget_peak();
        let grid = centred_box(n, self.mesh.box_side(&ARMADILLO))?;
        let mesh = self.mesh(&grid, quick)?;
        let title = format!("armadillo, n = {n}, {}: signed distance", operator.storage);
        let initial = session.phase(title, |stage| {
            mesh.phase_field(grid, scales(n).eps, &stage.bar)
        })?;
        drop(mesh);
        let steps = if quick { 2 } else { STEPS };
        let time = (
            StepRule::Doubling(FIRST_STEP * grid.spacing().powi(4)),
            steps,
        );
        let case = willmore_flow("armadillo", initial, operator, scales(n), time);
        Stored::measure("armadillo", n, case, session)
    }
}

/// The cross in controlled steps of second order.
fn curve(n: usize, session: &mut Session<'_>) -> Result<Stored, Error> {
    memory::release_freed();
    memory::forget_peak();
    let grid = Grid::per_unit(n, CROSS.side)?;
    let scales = Scales {
        newton: NewtonParams::second_order(),
        ..scales(n)
    };
    let initial = (CROSS.initial)(grid, scales.eps)?;
    let mut operator = accurate_operator(&grid, &scales)?;
    operator.storage = Storage::Bricks;
    let steps = TimeSteps::controlled(ErrorControl::default());
    let count = if session.options.quick {
        2
    } else {
        CROSS_STEPS
    };
    let mut case = willmore_flow(CROSS.key, initial, operator, scales, (steps.rule, count));
    case.steps = steps;
    Stored::measure(CROSS.key, n, case, session)
}

impl Stored {
    fn measure<const D: usize>(
        shape: &'static str,
        n: usize,
        mut case: Case<D>,
        session: &mut Session<'_>,
    ) -> Result<Self, Error> {
        case.measures.clear();
        let (storage, nodes) = (case.operator.storage, case.grid().len() as f64);
        let mut timed = Timed::new(case, &session.device)?;
        let cells = timed.run.stored_cells() as f64;
        let seconds = session.phase(format!("{shape}, n = {n}, {storage}: steps"), |stage| {
            let clock = Instant::now();
            while timed.step(&stage.bar)? {}
            Ok(clock.elapsed().as_secs_f64())
        })?;
        let mut numbers = timed.numbers();
        numbers.extend([
            ("seconds", seconds),
            ("active_cells", cells),
            ("active_share", cells / nodes),
        ]);
        let last = timed.minimizations().last();
        numbers.extend(last.map(|made| ("w", made.willmore_energy)));
        numbers.extend(memory::peak_mib().map(|peak| ("peak_mib", peak)));
        Ok(Self {
            shape,
            n,
            storage,
            numbers,
        })
    }
}

fn surfaces(measured: &[Stored]) -> impl Iterator<Item = &Stored> {
    measured.iter().filter(|row| row.shape != CROSS.key)
}

/// Hessian-vector products on bricks over those on the whole grid, by resolution.
pub fn product_ratios(measured: &[Stored]) -> impl Iterator<Item = (usize, f64)> {
    let of = |n, storage| {
        let mut rows = measured.iter().filter(move |row| row.n == n);
        rows.find(|row| row.storage == storage)
    };
    measured.iter().filter_map(move |dense| {
        let bricks = of(dense.n, Storage::Bricks)?;
        let [ours, theirs] = [bricks, dense].map(|row| row.numbers["ms_per_product"]);
        (dense.storage == Storage::Dense).then_some((dense.n, ours / theirs))
    })
}

/// The exponent of a number on bricks in `n`, from 128 on.
pub fn exponent(measured: &[Stored], name: &str) -> Option<f64> {
    let rows = surfaces(measured).filter(|row| row.storage == Storage::Bricks);
    let rows = rows.filter(|row| row.n >= COARSEST_FITTED);
    let point = |row: &Stored| Some([row.n as f64, *row.numbers.get(name)?]);
    timing::exponent(&rows.filter_map(point).collect::<Vec<_>>())
}

/// Seconds and memory against `n`, a colour for each storage.
pub fn figure(measured: &[Stored]) -> Figure {
    let panel = |title: &str, y: &str, name: &str| {
        let chart = LineChart::new(title, Axis::log("cells per unit length n"), Axis::log(y));
        (STORAGES.into_iter().enumerate()).fold(chart, |chart, (colour, storage)| {
            let rows = surfaces(measured).filter(|row| row.storage == storage);
            let point = |row: &Stored| Some([row.n as f64, *row.numbers.get(name)?]);
            let points: Vec<_> = rows.filter_map(point).collect();
            let series = Series::new(storage.to_string(), points).with_colour(colour);
            chart.with_series(series.with_marker(Marker::Circle))
        })
    };
    let fitted = exponent(measured, "seconds").map(|exponent| {
        format!(" On bricks seconds grow like n to the power {exponent:.2} from n = {COARSEST_FITTED} on.")
    });
    Figure::new("The armadillo on the whole grid and on bricks", 3)
        .with_panel(panel("time", "all steps [s]", "seconds"))
        .with_panel(panel("memory", "largest memory [MiB]", "peak_mib"))
        .with_panel(panel("size", "stored cells", "active_cells"))
        .with_shared_legend()
        .with_note(format!(
            "{STEPS} steps of Willmore flow, tau = h⁴/32 doubled after every step, eps = 2h; {} threads.{}",
            rayon::current_num_threads(),
            fitted.unwrap_or_default()
        ))
}
