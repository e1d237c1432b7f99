//! Where the time of steps and of the whole of `willmore fair` goes, as shares, and how near it is to what the memory allows.

use std::hint::black_box;
use std::sync::Mutex;

use jobs::{FairOptions, Input, Job, Watcher};
use rayon::prelude::*;
use report::OKABE_ITO;
use solver::PhaseTimes;

use crate::meshes::folder;
use crate::prelude::*;
use crate::storages::StorageOptions;
use crate::timing;

pub const METRICS: MetricTable = MetricTable {
    title: "Where the time goes",
    note: "Shares are parts of the wall time of all steps, or of the whole of `willmore fair` with its page. What else the machine does \
         moves seconds more than shares.",
    words: &[(
        "PART",
        "`products`, `inverse_in_the_pure_phases`, `coarse_correction`, `samples_of_the_interface`, `factorization`, \
             `energies_and_gradients`, `starts_on_coarser_grids`, `other_work_of_steps`, `measures`; of fair also `signed_distances`, \
             `other_input`, `preparation`, `surface`, `pictures`, `files`, `page`, `rest`",
    )],
    rows: &[
        (
            "CASE.nN[.STORAGE].share.PART, fair.share.PART",
            "part of the time: Hessian-vector products; the preconditioner by parts; samples and factorization of its coarse correction; \
             energies and gradients; what the minimizations do besides; what is done between them. Of `fair` also what is made of \
             the input and of the end",
        ),
        (
            "CASE.nN[.STORAGE].shared_seconds, fair.shared_seconds",
            "the wall time of which these are parts",
        ),
        (
            "memory.gigabytes_per_second, memory.microseconds_per_page",
            "bandwidth of the memory: bytes read and written per second by copies of large vectors on all cores, the fastest of several; \
             what a new page of memory costs",
        ),
        (
            "CASE.nN[.STORAGE].product_over_bandwidth, CASE.nN[.STORAGE].inverse_over_bandwidth",
            "milliseconds of a product over those in which the memory moves what it reads and writes at least, four vectors in single \
             precision (the direction, two vectors of derivatives, the product); of the inverse in the pure phases likewise, two vectors",
        ),
        (
            "CASE.nN[.STORAGE].share.new_pages",
            "part of the time that new pages of memory take, which is in the other parts too",
        ),
    ],
};

/// Noise of the mesh that `fair` takes it off, up to so many times its longest side.
const NOISE: f64 = 0.004;
const ROCKER_ARM: &str = "rocker-arm.obj";
/// Cells per side of the grid on which the built-in lever is made.
const LEVER_CELLS: [usize; 2] = [48, 96];
/// Entries of the vectors that are copied: far more than caches hold.
const COPIED: usize = 1 << 25;
/// Copies, of which the fastest counts.
const COPIES: usize = 7;
/// Bytes of new memory that are touched.
const TOUCHED: usize = 1 << 28;
/// Vectors that a product and the inverse in the pure phases have to move, of numbers of so many bytes.
const OF_PRODUCT: f64 = 4.0;
const OF_INVERSE: f64 = 2.0;
const SINGLE: f64 = 4.0;
/// What the figure shows together: a name, and the parts that it stands for.
type Group = (&'static str, &'static [&'static str]);
const OF_STEPS: [Group; 8] = [
    ("products", &["products"]),
    (
        "inverse in the pure phases",
        &["inverse in the pure phases"],
    ),
    ("coarse correction", &["coarse correction"]),
    (
        "its samples and factorization",
        &["samples of the interface", "factorization"],
    ),
    ("energies and gradients", &["energies and gradients"]),
    ("starts on coarser grids", &["starts on coarser grids"]),
    ("other work of steps", &["other work of steps"]),
    ("measures", &["measures"]),
];
const OF_FAIR: [Group; 8] = [
    ("signed distances", &["signed distances"]),
    ("other input", &["other input"]),
    (
        "steps",
        &[
            "products",
            "inverse in the pure phases",
            "coarse correction",
            "samples of the interface",
            "factorization",
            "energies and gradients",
            "starts on coarser grids",
            "other work of steps",
        ],
    ),
    ("measures", &["measures"]),
    ("surface", &["surface"]),
    ("pictures", &["pictures"]),
    ("page", &["page"]),
    ("files and the rest", &["files", "preparation", "rest"]),
];

/// Where the time of a flow or of `fair` went.
struct Spent {
    key: String,
    title: String,
    /// Wall time in seconds.
    seconds: f64,
    /// Its parts, which add up to it.
    parts: Vec<(&'static str, f64)>,
    /// What is set against the memory.
    numbers: Numbers,
}

/// What the memory of this machine can do.
struct MemorySpeed {
    bytes_per_second: f64,
    seconds_per_page: Option<f64>,
}

/// Measures it all: the cross on the whole grid, the armadillo on bricks, and `fair` of a mesh with noise. Parts of the time of a GPU, which
/// computes while the host goes on, would mean nothing.
pub fn measure(session: &mut Session, storage: &StorageOptions) -> Result<()> {
    let speed = session.phase("bandwidth of the memory", |_| Ok(MemorySpeed::measured()))?;
    let quick = session.options.quick;
    let mut flows = Vec::new();
    let planes: &[usize] = if quick { &[128] } else { &[128, 256] };
    for &n in planes {
        let needed = convergence_network(n)?;
        let operator = Chosen::default().learned(Formulation::Paper, &needed)?;
        let case = timing::plane(&operator, n, if quick { 2 } else { 128 }, quick)?;
        let key = format!("{}.n{n}", if quick { "disc" } else { "cross" });
        flows.push(Spent::by_flow(key, case, &speed, session)?);
    }
    let solids: &[usize] = if quick { &[32] } else { &[128] };
    for &n in solids {
        let case = storage.surface(session, n, Storage::Bricks)?;
        let key = format!("armadillo.n{n}.bricks");
        flows.push(Spent::by_flow(key, case, &speed, session)?);
    }
    let fair = Spent::by_fair(session)?;
    write(&flows, fair, &speed, session)
}

impl MemorySpeed {
    fn measured() -> Self {
        memory::release_kept();
        let (from, mut to) = (vec![1.0_f64; COPIED], vec![0.0_f64; COPIED]);
        let chunk = COPIED / (8 * rayon::current_num_threads()).max(1);
        let seconds = (0..COPIES).map(|_| {
            let clock = Instant::now();
            let chunks = to.par_chunks_mut(chunk).zip(from.par_chunks(chunk));
            chunks.for_each(|(to, from)| to.copy_from_slice(from));
            black_box(&mut to);
            clock.elapsed().as_secs_f64()
        });
        let bytes_per_second =
            (2 * COPIED * size_of::<f64>()) as f64 / seconds.fold(f64::INFINITY, f64::min);
        drop((from, to));
        memory::release_kept();
        Self {
            bytes_per_second,
            seconds_per_page: seconds_per_page(),
        }
    }
}

/// What a new page of memory costs beside the writing of its bytes, where the system tells of pages.
fn seconds_per_page() -> Option<f64> {
    let before = memory::pages()?;
    let mut block: Vec<u8> = Vec::with_capacity(TOUCHED);
    let [first, again] = [(); 2].map(|()| {
        let clock = Instant::now();
        block.clear();
        block.resize(TOUCHED, 1);
        black_box(&mut block);
        clock.elapsed().as_secs_f64()
    });
    let pages = memory::pages()?.saturating_sub(before);
    Some((first - again).max(0.0) / pages.max(1) as f64)
}

impl Spent {
    fn by_flow<const D: usize>(
        key: String,
        mut case: Case<D>,
        speed: &MemorySpeed,
        session: &mut Session,
    ) -> Result<Self> {
        case.measures.clear();
        let title = format!(
            "{}, n = {}",
            case.shape,
            case.grid().spacing().recip().round()
        );
        memory::release_kept();
        let mut run = Run::new(case, &session.device)?;
        let before = memory::pages();
        let name = format!("{title}: where the time of its steps goes");
        let seconds = session.phase(name, |stage| {
            let clock = Instant::now();
            stage.finish(&mut run)?;
            Ok(clock.elapsed().as_secs_f64())
        })?;
        let pages = (memory::pages().zip(before)).map(|(after, before)| (after - before) as f64);
        let (mut steps, mut times, mut products) = (0.0, PhaseTimes::default(), 0);
        for made in minimizations(run.records()) {
            steps += made.seconds;
            times = times + made.times;
            products += made.newton.hvp;
        }
        let mut parts = times.parts().to_vec();
        parts.push(("other work of steps", steps - total(&parts)));
        parts.push(("measures", seconds - steps));
        let vector = SINGLE * run.stored_cells() as f64 / speed.bytes_per_second;
        let of_inverse = times.preconditioner - times.coarse;
        let over = |seconds: f64, vectors: f64| seconds / (products as f64 * vectors * vector);
        let mut numbers = Numbers::from([
            ("product_over_bandwidth", over(times.products, OF_PRODUCT)),
            ("inverse_over_bandwidth", over(of_inverse, OF_INVERSE)),
        ]);
        let new = pages.zip(speed.seconds_per_page);
        numbers.extend(new.map(|(pages, each)| ("share.new_pages", pages * each / seconds)));
        Ok(Self {
            key,
            title,
            seconds,
            parts,
            numbers,
        })
    }

    /// The whole of `willmore fair` at its defaults, in a folder that goes.
    fn by_fair(session: &mut Session) -> Result<Self> {
        let quick = session.options.quick;
        let path = Some(folder().join(ROCKER_ARM)).filter(|path| path.exists() && !quick);
        let (title, mut mesh) = match path {
            Some(path) => ("rocker arm", surfaces::read(&path)?),
            None => {
                let lever = surfaces::samples::lever(LEVER_CELLS[usize::from(!quick)])?;
                ("built-in lever", lever.mesh().clone())
            }
        };
        let longest = mesh
            .bounding_box()
            .map_or(1.0, |bounds| bounds.longest_side());
        mesh.roughen(NOISE * longest, session.options.seed);
        let scratch = tempfile::tempdir()?;
        let mut options = FairOptions::of(Input::mesh("noisy", &mesh)?);
        options.run.output = Some(scratch.path().join("run"));
        memory::release_kept();
        let clocks = Clocks::default();
        let seconds = session.phase(format!("fair of the {title}"), |_| {
            let clock = Instant::now();
            jobs::run_in_folder(Job::Fair(options), &clocks)?;
            Ok(clock.elapsed().as_secs_f64())
        })?;
        Ok(Self {
            key: "fair".to_owned(),
            title: format!("fair, {title}"),
            seconds,
            parts: clocks.parts(seconds)?,
            numbers: Numbers::new(),
        })
    }

    fn share(&self, part: &str) -> f64 {
        let of_part = self.parts.iter().filter(|(name, _)| *name == part);
        of_part.map(|(_, seconds)| seconds / self.seconds).sum()
    }
}

fn total(parts: &[(&'static str, f64)]) -> f64 {
    parts.iter().map(|(_, seconds)| seconds).sum()
}

/// Adds up what a job tells of its time.
#[derive(Default)]
struct Clocks(Mutex<BTreeMap<&'static str, f64>>);

impl Watcher for Clocks {
    fn spent(&self, part: &'static str, seconds: f64) {
        let mut all = self.0.lock().expect("nobody panics with it");
        *all.entry(part).or_default() += seconds;
    }
}

impl Clocks {
    /// Parts of so many seconds without overlap.
    fn parts(self, seconds: f64) -> Result<Vec<(&'static str, f64)>> {
        let all = self.0.into_inner().map_err(|_| "a clock is lost")?;
        let of = |part: &str| all.get(part).copied().unwrap_or(0.0);
        let mut parts = vec![
            ("signed distances", of("signed distances")),
            ("other input", of("input") - of("signed distances")),
            ("preparation", of("preparation")),
        ];
        parts.extend(PhaseTimes::PARTS.map(|part| (part, of(part))));
        let files = of("output") - of("surface") - of("pictures");
        parts.extend(
            ["other work of steps", "measures", "surface", "pictures"].map(|part| (part, of(part))),
        );
        parts.extend([("files", files), ("page", of("page"))]);
        parts.push(("rest", seconds - total(&parts)));
        Ok(parts)
    }
}

/// Writes tables, metrics and the figure.
fn write(flows: &[Spent], fair: Spent, speed: &MemorySpeed, session: &mut Session) -> Result<()> {
    let page = speed.seconds_per_page.map(|seconds| 1e6 * seconds);
    session.metrics(
        "memory",
        [
            (
                "gigabytes_per_second",
                (1e-9 * speed.bytes_per_second).into(),
            ),
            ("microseconds_per_page", page.into()),
        ],
    )?;
    let limits = [
        (
            "product / memory's limit",
            Fixed(1),
            "product_over_bandwidth",
        ),
        (
            "inverse / memory's limit",
            Fixed(1),
            "inverse_over_bandwidth",
        ),
        ("new pages, part of all", Fixed(3), "share.new_pages"),
    ];
    let sheet = table(flows).numbers(&limits, |row| &row.numbers);
    session.sheet(sheet, "shares")?;
    let fair = [fair];
    session.sheet(table(&fair), "fair_shares")?;
    session.figure(figure(flows, &fair, &session.device), "shares")
}

fn table(rows: &[Spent]) -> Sheet<'_, Spent> {
    let mut sheet = Sheet::of(rows)
        .keyed(|row, name| format!("{}.{name}", row.key))
        .text("flow", |row| row.title.clone())
        .measure("shared_seconds", "seconds", Fixed(1), |row| row.seconds);
    let names = rows.first().map_or(&[][..], |row| &row.parts);
    for (part, _) in names {
        let metric = format!("share.{}", part.replace(' ', "_"));
        sheet = sheet.measure(&metric, part, Fixed(3), move |row| row.share(part));
    }
    sheet
}

/// Stacked bars: one for each flow, and one for `fair`, in colours that colour-blind people can tell apart.
fn figure(flows: &[Spent], fair: &[Spent], device: &ComputeDevice) -> Figure {
    Figure::new("Where the time goes", 2)
        .with_panel(bars("steps", flows, &OF_STEPS))
        .with_panel(bars("the whole of willmore fair", fair, &OF_FAIR))
        .with_note(format!(
            "Wall time, on {}. From bottom to top in the order of the legends, which goes from left to right, row by row.",
            timing::machine(device)
        ))
}

fn bars(title: &str, rows: &[Spent], groups: &[Group]) -> LineChart {
    const WIDTH: f64 = 34.0;
    let mut curves = Vec::new();
    for (at, row) in rows.iter().enumerate() {
        let (x, mut low) = (at as f64 + 1.0, 0.0);
        for (k, (_, parts)) in groups.iter().enumerate() {
            let share = 100.0 * parts.iter().map(|part| row.share(part)).sum::<f64>();
            let bar = Series::new("", [[x, low], [x, low + share]]);
            curves.push(bar.with_colour(OKABE_ITO[k]).with_width(WIDTH));
            low += share;
        }
    }
    let entries = groups.iter().enumerate();
    let entries =
        entries.map(|(k, (name, _))| LegendEntry::line(*name, OKABE_ITO[k], LineStyle::Solid));
    let names = rows.iter().enumerate();
    let names = names.map(|(at, row)| format!("{}: {}", at + 1, row.title));
    let names: Vec<String> = names.collect();
    LineChart::new(
        title,
        Axis::linear(names.join("; ")).with_range(0.0, rows.len() as f64 + 1.0),
        Axis::linear("part of the wall time, %").with_range(0.0, 100.0),
    )
    .with_curves(curves)
    .with_entries(entries)
}
