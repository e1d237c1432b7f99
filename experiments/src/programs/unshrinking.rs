//! Segmentations made smooth by Willmore flow with and without their volume kept, by Taubin's smoothing and by Laplacian smoothing.

use chacha20::ChaCha8Rng;

use crate::prelude::*;
use crate::smoothing::{LAPLACIAN, fairing_flow, mesh_raster, rms_distance, rounds};
use rand::{RngExt, SeedableRng};
use surfaces::{TAUBIN, samples};
use volumes::{Body, Inside, Volume};

pub const EXPERIMENT: Experiment = Experiment {
    name: "unshrinking",
    summary: "Segmentations without their steps, and their volumes.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "unshrinking",
        title: "Segmentations",
        description: "Not in the paper: voxels become smooth surfaces by Willmore flow, with their volume kept and \
                 without, beside other smoothing.",
        figures: &[(
            "surfaces",
            "The surface by marching tetrahedra, and what becomes of it; the change of the volume.",
        )],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Segmentations",
    note: "",
    words: &[
        ("BODY", "`ball`, with wrong labels; `figure`"),
        (
            "TREATMENT",
            "`marched`, the surface by marching tetrahedra; `fair` and `free`, Willmore flow of the surface of the \
             voxels, whose staircase is taken off, with the volume kept and without; `marched_fair` and \
             `marched_free`, the same from the surface `marched`; `taubin` and `laplacian`, smoothing of that with \
             the best number of iterations",
        ),
    ],
    rows: &[
        (
            "unshrinking.BODY.TREATMENT.volume",
            "change of the volume of the voxels (without specks, with holes of a few voxels) in percent",
        ),
        (
            "unshrinking.BODY.TREATMENT.w_over_8pi",
            "Willmore energy by implicit finite elements, in units of a sphere's",
        ),
        (
            "unshrinking.BODY.TREATMENT.displacement",
            "largest distance of the vertices from the surface `marched`, in voxels",
        ),
        (
            "unshrinking.BODY.TREATMENT.rms",
            "root of the mean square distance of the vertices to the shape, in voxels",
        ),
    ],
};

const TITLE: &str = "Segmentations without their steps, and their volumes";
/// Bodies with their voxels along the longest side, in quick runs and usually.
const BODIES: [(&str, [usize; 2]); 2] = [("ball", [16, 32]), ("figure", [24, 48])];
/// Within a voxel of the surface, this part of the labels of the ball is wrong.
const WRONG: f64 = 0.15;
/// Layers of voxels around a body.
const MARGIN: f64 = 3.0;
/// Part of the box that the body fills, and cells along a voxel.
const PART: f64 = 0.8;
const FINE: f64 = 1.25;
/// Time of the flow, and how far the surface may go, as `willmore fair` has them.
const TIME: f64 = 6.5536;
const FARTHEST: f64 = 0.35;
/// The most iterations of Taubin's and of Laplacian smoothing.
const ITERATIONS: usize = 200;

/// A ball with wrong labels and a figure, as voxels: their surface by marching tetrahedra, what `willmore fair` makes of the voxels and of
/// that surface, with the volume kept and without, and Taubin's and Laplacian smoothing of it with the number of iterations that comes
/// nearest to the shape: volumes, energies, displacements.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,
}

/// A shape as voxels, whose sides are the unit of length.
struct Segmented {
    name: &'static str,
    shape: Box<dyn SignedDistance<3>>,
    up: UpAxis,
    body: Body,
    /// By marching tetrahedra, with all steps but without specks.
    marched: ClosedMesh,
    grid: Grid<3>,
}

/// What became of it, with key and words for how.
struct Row<'a> {
    of: &'a Segmented,
    treatment: (&'static str, &'static str),
    iterations: Option<usize>,
    numbers: Numbers,
    surface: TriangleMesh,
}

/// The change of the volume from that of the voxels in percent, the Willmore energy in units of a sphere's, the largest distance from the
/// surface by marching tetrahedra, and the root of the mean square distance to the shape.
const COLUMNS: [(&str, Format, &str); 4] = [
    ("volume, %", Fixed(4), "volume"),
    ("w / 8 pi by elements", Fixed(3), "w_over_8pi"),
    ("largest displacement", Fixed(3), "displacement"),
    ("distance to the shape", Fixed(4), "rms"),
];

fn program(options: &Options) -> Result<()> {
    let full = usize::from(!options.run.quick);
    let parameters = json!({ "bodies": BODIES, "wrong": WRONG, "time": TIME, "taubin": TAUBIN, "laplacian": LAPLACIAN, "iterations": ITERATIONS });
    let mut session = Session::open(EXPERIMENT.name, &options.run, parameters)?;
    let seed = session.options.seed;
    let bodies = BODIES.map(|(name, voxels)| Segmented::new(name, voxels[full] as f64, seed));
    let bodies = bodies.into_iter().collect::<Result<Vec<_>, _>>()?;
    let (mut rows, mut pictures) = (Vec::new(), Vec::new());
    for body in &bodies {
        let treated = body.treated(&mut session)?;
        let drawn = session.phase("pictures", |_| {
            let shown = [0, 1, 2, 5, 6].map(|k: usize| treated[k].picture());
            shown.into_iter().collect::<Result<Vec<_>, _>>()
        });
        pictures.extend(drawn?);
        rows.extend(treated);
    }
    let table = Sheet::of(&rows)
        .keyed(|row, name| format!("unshrinking.{}.{}.{name}", row.of.name, row.treatment.0))
        .text("body", |row| row.of.name)
        .text("surface", |row| row.treatment.1)
        .column("iterations", Shortest, |row| row.iterations)
        .numbers(&COLUMNS, |row| &row.numbers);
    session.sheet(table, "unshrinking")?;
    let figure = Figure::new(TITLE, 5).with_row_labels(BODIES.map(|(name, _)| name));
    session.figure(figure.with_panels(pictures), "surfaces")?;
    session.finish(TITLE)
}

impl Segmented {
    fn new(name: &'static str, voxels: f64, seed: u64) -> Result<Self> {
        let centre = [0.5 * voxels + MARGIN + 0.2; 3];
        let (shape, wrong, up): (Box<dyn SignedDistance<3>>, _, _) = if name == "ball" {
            (Box::new(Ball::new(centre, 0.5 * voxels)?), WRONG, UpAxis::Z)
        } else {
            let figure = samples::figure(96)?;
            let bounds = figure.bounding_box();
            let scale = voxels / bounds.longest_side();
            let corner = std::array::from_fn(|i| bounds.centre()[i] - centre[i] / scale);
            let placed = figure.placed(&Placement::about(corner, scale)?);
            (Box::new(MeshDistance::new(&placed)), 0.0, UpAxis::Y)
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let size = (voxels + 2.0 * MARGIN).ceil() as usize + 1;
        let labels = (0..size.pow(3)).map(|voxel| {
            let index = [voxel % size, voxel / size % size, voxel / (size * size)];
            let distance = shape.signed_distance(index.map(|i| i as f64));
            let is_wrong = distance.abs() < 1.0 && rng.random::<f64>() < wrong;
            u8::from((distance < 0.0) != is_wrong)
        });
        let volume = Volume::of_labels([size; 3], [0.0; 3], [1.0; 3], labels.collect())?;
        let side = voxels / PART;
        // For the half grid.
        let cells = 2 * (0.5 * FINE * side).ceil() as usize;
        Ok(Self {
            name,
            up,
            body: volume.body(Inside::Label(1.0))?,
            marched: (volume.body(Inside::Above(0.5))?.surface).without_small_parts(8.0)?,
            grid: Grid::new(cells, side)?.with_origin(centre.map(|x| x - 0.5 * side))?,
            shape,
        })
    }

    fn treated(&self, session: &mut Session) -> Result<Vec<Row<'_>>> {
        let (body, marched) = (&self.body.surface, &self.marched);
        let (t, taubin) = self.smoothed(TAUBIN)?;
        let (l, laplacian) = self.smoothed(LAPLACIAN)?;
        let (none, kept, free) = (None, Some(true), Some(false));
        let from_marched = MeshDistance::new(marched);
        // Key, words, what it starts from, iterations, and for flows whether the volume is kept.
        let all = [
            ("marched", "marching tetrahedra", marched, None, none),
            ("fair", "fair, volume kept", body, None, kept),
            ("free", "fair, free", body, None, free),
            ("marched_fair", "marched, volume kept", marched, None, kept),
            ("marched_free", "marched, free", marched, None, free),
            ("taubin", "Taubin", &taubin, Some(t), none),
            ("laplacian", "Laplacian", &laplacian, Some(l), none),
        ];
        let row = |(key, words, start, iterations, flow): (_, _, &ClosedMesh, _, Option<bool>)| {
            session.phase(format!("{}: {words}", self.name), |stage| {
                let distance = MeshDistance::new(start).sample(self.grid, &|| ())?;
                let mut case = fairing_flow(self.name, distance)?;
                case.measures = vec![Measure::displacement(&case.initial, case.scales.eps)];
                case.stops = vec![Stop::Time(TIME), Stop::Displacement(FARTHEST)];
                let mut u = case.initial.clone();
                let mut surface = start.mesh().clone();
                let mut volume = start.volume();
                if let Some(keeps) = flow {
                    case.held.volume = keeps.then_some(Target::keep(body.volume()));
                    let run = stage.run(case.clone())?;
                    u = run.stored().clone();
                    volume = ZeroSet::of(&u, case.scales.eps)?.volume;
                    surface = surfaces::remeshed_surface(&u, case.scales.eps)?
                        .with_volume(volume, |_| true);
                }
                let elements = case.implicit_elements()?.willmore_energy(&u.field()?)?;
                let vertices = surface.vertices.iter();
                let gone = vertices.map(|&x| from_marched.signed_distance(x).abs());
                let numbers = Numbers::from([
                    ("volume", 100.0 * (volume / body.volume() - 1.0)),
                    ("w_over_8pi", elements / (8.0 * PI)),
                    ("displacement", gone.fold(0.0, f64::max)),
                    ("rms", rms_distance(&surface, &*self.shape)),
                ]);
                Ok(Row {
                    of: self,
                    treatment: (key, words),
                    iterations,
                    numbers,
                    surface,
                })
            })
        };
        all.into_iter().map(row).collect()
    }

    /// The surface after the number of iterations that brings it nearest to the shape.
    fn smoothed(&self, factors: [f64; 2]) -> Result<(usize, ClosedMesh)> {
        let rounds = (1..=ITERATIONS).zip(rounds(self.marched.mesh(), factors));
        let measured = rounds.map(|(k, mesh)| (rms_distance(&mesh, &*self.shape), k, mesh));
        let nearest = measured.min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, count, mesh) = nearest.expect("there are iterations");
        Ok((count, ClosedMesh::new(mesh)?.0))
    }
}

impl Row<'_> {
    fn picture(&self) -> Result<Raster> {
        let (up, frame) = (self.of.up, self.of.marched.bounding_box());
        let change = report::signed(&format!("{:+.2}", self.numbers["volume"]));
        let caption = format!("{}\nvolume {change} %", self.treatment.1);
        mesh_raster(&self.surface, up, frame, caption)
    }
}
