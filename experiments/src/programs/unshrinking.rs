//! Segmentations made smooth by `willmore fair` and by what else there is, and how near the surfaces come to the shapes that were segmented.

use jobs::{FairOptions, Input, Silent};
use surfaces::TAUBIN;

use crate::others::{OtherRun, Others};
use crate::prelude::*;
use crate::segmentations::{BODIES, Segmentation, WRONG};
use crate::smoothing::{LAPLACIAN, mesh_raster, rounds};

pub const EXPERIMENT: Experiment = Experiment {
    name: "unshrinking",
    summary: "Segmentations without their steps, and their volumes, beside other methods.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "unshrinking",
        title: "Segmentations",
        description: "Not in the paper: a benchmark of smooth surfaces of voxels, by `willmore fair`, Taubin's and Laplacian smoothing, \
                 SurfaceNets and constrained smoothing.",
        figures: &[(
            "surfaces",
            "The surface between the voxels, and what becomes of it; the distance to the shape.",
        )],
        options: None,
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Segmentations",
    note: "Lengths are in cube roots of the volume of a voxel. Values of several labels are the worst, those of the distance `rms` and of `normals` the means.",
    words: &[
        (
            "BODY",
            "`ball`, with wrong labels; `figure`; `vessel`, thin beside a sac; `torus`, in voxels three times as long along one axis; `cortex`, a folded \
             sheet of three voxels; `sectors`, three labels that touch",
        ),
        (
            "TREATMENT",
            "`voxels`, the surface between them by marching tetrahedra; `taubin` and `laplacian`, ten rounds of smoothing of it; `surface_nets`, \
             vtkSurfaceNets3D; `constrained`, constrained smoothing of PyMCubes; `taubin_tuned`, `laplacian_tuned`, `surface_nets_tuned` and \
             `constrained_tuned`, these with the parameters that come nearest to the shape; `fair`, the program at its defaults, with shared walls \
             of several labels",
        ),
    ],
    rows: &[
        (
            "unshrinking.BODY.TREATMENT.rms, unshrinking.BODY.TREATMENT.largest",
            "distance of the surface to the shape, root of the mean square and largest",
        ),
        (
            "unshrinking.BODY.TREATMENT.normals",
            "mean angle between the normals and those of the shape at the nearest point, in degrees",
        ),
        (
            "unshrinking.BODY.TREATMENT.area",
            "difference of the area to that of the shape, in percent; that of `voxels` is the staircase's",
        ),
        (
            "unshrinking.BODY.TREATMENT.volume",
            "change of the volume of the voxels in percent",
        ),
        (
            "unshrinking.BODY.TREATMENT.thin",
            "the same of a thin end of the vessel",
        ),
        (
            "unshrinking.BODY.TREATMENT.gaps, unshrinking.BODY.TREATMENT.overlaps",
            "volume inside of all labels together that belongs to none, and to several, in percent",
        ),
        (
            "unshrinking.BODY.over_defaults, unshrinking.BODY.over_tuned",
            "`rms` of `fair` over the least of the others at their defaults, and tuned",
        ),
        (
            "unshrinking.BODY.normals_over_defaults, unshrinking.BODY.normals_over_tuned",
            "the same of `normals`",
        ),
    ],
};

const TITLE: &str = "Segmentations without their steps";
/// Cells per unit length in quick runs, where noise would ask for the finest grid.
const QUICK_CELLS: usize = 32;
/// Rounds of Taubin's and of Laplacian smoothing as trimesh 4 has them by default, and the most that are tried.
const USUAL_ROUNDS: usize = 10;
const MOST_ROUNDS: usize = 60;
/// So many more rounds without a smaller distance end the search for the best number.
const PATIENCE: usize = 5;
/// Of meshes of several labels one after the other.
type Meshes = Vec<TriangleMesh>;

/// Surfaces of segmented shapes by `willmore fair` and by other methods: distances to the shapes, normals, areas, volumes, gaps, seconds.
///
/// SurfaceNets and constrained smoothing are those of VTK and PyMCubes, which `scripts/other_smoothings` runs. It says what it needs.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// The Python that has VTK and PyMCubes [default: without their methods]
    #[arg(long, value_name = "FILE")]
    python: Option<PathBuf>,

    /// Take these bodies alone
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    bodies: Vec<String>,

    /// The radius below which details go by `fair`, in voxels [default: that of the program]
    #[arg(long, value_name = "LENGTH")]
    detail: Option<f64>,
}

/// What a method made of a segmentation.
struct Row<'a> {
    of: &'a Segmentation,
    treatment: String,
    parameters: String,
    numbers: Numbers,
    seconds: Option<f64>,
    meshes: Meshes,
}

const COLUMNS: [(&str, Format, &str); 8] = [
    ("distance", Fixed(4), "rms"),
    ("largest", Fixed(3), "largest"),
    ("normals, degrees", Fixed(2), "normals"),
    ("area, %", Fixed(2), "area"),
    ("volume, %", Fixed(4), "volume"),
    ("thin end, %", Fixed(3), "thin"),
    ("gaps, %", Fixed(3), "gaps"),
    ("overlaps, %", Fixed(3), "overlaps"),
];

/// The methods in the figure.
const SHOWN: [&str; 5] = ["voxels", "taubin", "surface_nets", "constrained", "fair"];

fn program(options: &Options) -> Result<()> {
    let full = usize::from(!options.run.quick);
    let is_wanted =
        |name: &str| options.bodies.is_empty() || options.bodies.iter().any(|b| b == name);
    let bodies: Vec<_> = BODIES
        .into_iter()
        .filter(|(name, _)| is_wanted(name))
        .collect();
    require(!bodies.is_empty(), "--bodies: there are no such bodies")?;
    let names: Vec<_> = bodies
        .iter()
        .map(|(name, sizes)| (*name, sizes[full]))
        .collect();
    let parameters = json!({ "bodies": names, "wrong": WRONG, "taubin": TAUBIN, "laplacian": LAPLACIAN, "rounds": [USUAL_ROUNDS, MOST_ROUNDS], "detail": options.detail });
    let mut session = Session::open(EXPERIMENT.name, &options.run, parameters)?;
    let seed = session.options.seed;
    let bodies = session.phase("shapes", |_| {
        let bodies = names
            .iter()
            .map(|&(name, voxels)| Segmentation::new(name, voxels, seed));
        bodies.collect::<Result<Vec<_>>>()
    })?;
    let others = match &options.python {
        Some(python) => session.phase("other programs", |_| {
            Others::smooth(python, |folder| {
                let write = |body: &Segmentation| {
                    let file = folder.join(format!("{}.nii", body.name));
                    Ok(volumes::write(file, &body.volume)?)
                };
                bodies.iter().try_for_each(write)
            })
        })?,
        None => Others::default(),
    };
    others.tell(&mut session);
    let mut rows = Vec::new();
    for body in &bodies {
        let treated = treated(&mut session, body, &others, options)?;
        compare(&mut session, &treated)?;
        rows.extend(treated);
    }
    let table = Sheet::of(&rows)
        .keyed(|row, name| format!("unshrinking.{}.{}.{name}", row.of.name, row.treatment))
        .text("body", |row| row.of.name)
        .text("surface", |row| &row.treatment)
        .text("parameters", |row| &row.parameters)
        .numbers(&COLUMNS, |row| &row.numbers)
        .column("seconds", Fixed(2), |row| row.seconds);
    session.sheet(table, "unshrinking")?;
    let pictures = session.phase("pictures", |_| {
        let shown = rows.iter().filter(|row| SHOWN.contains(&&*row.treatment));
        shown.map(Row::picture).collect::<Result<Vec<_>, _>>()
    })?;
    let columns = pictures.len() / bodies.len();
    let labels: Vec<&str> = bodies.iter().map(|body| body.name).collect();
    let figure = Figure::new(TITLE, columns).with_row_labels(labels);
    session.figure(figure.with_panels(pictures), "surfaces")?;
    session.finish(TITLE)
}

/// What all methods make of a body.
fn treated<'a>(
    session: &mut Session,
    body: &'a Segmentation,
    others: &Others,
    options: &Options,
) -> Result<Vec<Row<'a>>> {
    let row = |treatment: &str, parameters: &str, seconds: Option<f64>, meshes: Meshes| {
        Ok::<_, crate::Error>(Row {
            of: body,
            treatment: treatment.to_owned(),
            parameters: parameters.to_owned(),
            numbers: body.measured(&meshes)?,
            seconds,
            meshes,
        })
    };
    let clock = Instant::now();
    let labels = 1..=body.shapes.len();
    let marched = labels
        .map(|label| Ok(body.marched(label)?.into_mesh()))
        .collect::<Result<Meshes>>()?;
    let mut rows = vec![row(
        "voxels",
        "",
        Some(clock.elapsed().as_secs_f64()),
        marched.clone(),
    )?];
    session.phase(format!("{}: smoothing of the surface", body.name), |_| {
        for (name, factors) in [("taubin", TAUBIN), ("laplacian", LAPLACIAN)] {
            let clock = Instant::now();
            let smoothed = |count: usize| {
                marched
                    .iter()
                    .map(|mesh| mesh.smoothed(count, factors[0], factors[1]))
                    .collect()
            };
            let usual: Meshes = smoothed(USUAL_ROUNDS);
            let seconds = clock.elapsed().as_secs_f64();
            rows.push(row(
                name,
                &format!("{USUAL_ROUNDS} rounds"),
                Some(seconds),
                usual,
            )?);
            let mut meshes: Vec<_> = marched.iter().map(|mesh| rounds(mesh, factors)).collect();
            let mut best: Option<(f64, usize, Meshes)> = None;
            for count in 1..=MOST_ROUNDS {
                let next: Meshes = meshes.iter_mut().filter_map(Iterator::next).collect();
                let distance = body.distance(&next);
                if best.as_ref().is_none_or(|(least, _, _)| distance < *least) {
                    best = Some((distance, count, next));
                } else if best
                    .as_ref()
                    .is_some_and(|(_, at, _)| count > at + PATIENCE)
                {
                    break;
                }
            }
            if let Some((_, count, nearest)) = best {
                let name = format!("{name}_tuned");
                rows.push(row(&name, &format!("{count} rounds"), None, nearest)?);
            }
        }
        Ok::<_, crate::Error>(())
    })?;
    session.phase(format!("{}: meshes of other programs", body.name), |_| {
        for name in ["surface_nets", "constrained"] {
            let mut best: Option<(f64, &OtherRun, Meshes)> = None;
            let runs = others.runs.iter();
            for run in runs.filter(|run| run.of == body.name && run.method == name) {
                let meshes = others.meshes(run)?;
                if run.parameters.is_empty() {
                    rows.push(row(name, "defaults", Some(run.seconds), meshes.clone())?);
                }
                let distance = body.distance(&meshes);
                if best.as_ref().is_none_or(|(least, _, _)| distance < *least) {
                    best = Some((distance, run, meshes));
                }
            }
            if let Some((_, run, nearest)) = best {
                let parameters = if run.parameters.is_empty() {
                    "defaults"
                } else {
                    &run.parameters
                };
                rows.push(row(
                    &format!("{name}_tuned"),
                    parameters,
                    Some(run.seconds),
                    nearest,
                )?);
            }
        }
        Ok::<_, crate::Error>(())
    })?;
    let parameters = &options
        .detail
        .map_or("defaults".to_owned(), |detail| format!("detail {detail}"));
    let (meshes, seconds) =
        session.phase(format!("{}: fair", body.name), |_| faired(body, options))?;
    rows.push(row("fair", parameters, Some(seconds), meshes)?);
    Ok(rows)
}

/// What the program makes of it at its defaults.
fn faired(body: &Segmentation, options: &Options) -> Result<(Meshes, f64)> {
    let clock = Instant::now();
    let (detail, quick) = (options.detail, options.run.quick);
    let mut options = FairOptions::of(Input::volume(body.name, body.volume.clone()));
    options.detail = detail;
    options.input.cells = quick.then_some(QUICK_CELLS);
    let meshes = if body.shapes.len() > 1 {
        let made = jobs::shared_labels(options, &Silent)?;
        let surface = |label: usize| made.walls.of_label(label as u32);
        (1..=body.shapes.len()).map(surface).collect()
    } else {
        let made = jobs::fair(options, &Silent)?;
        let shape = made.shape.as_ref().and_then(jobs::Shape::mesh);
        shape.cloned().into_iter().collect()
    };
    Ok((meshes, clock.elapsed().as_secs_f64()))
}

/// The distance and the normals of the program over the best of the others.
fn compare(session: &mut Session, rows: &[Row<'_>]) -> Result<()> {
    let Some((fair, others)) = rows.split_last() else {
        return Ok(());
    };
    for (metric, prefix) in [("rms", ""), ("normals", "normals_")] {
        for (name, is_tuned) in [("defaults", false), ("tuned", true)] {
            let meant = others
                .iter()
                .filter(|row| row.treatment.ends_with("_tuned") == is_tuned);
            let least = meant
                .map(|row| row.numbers[metric])
                .fold(f64::INFINITY, f64::min);
            let key = format!("unshrinking.{}.{prefix}over_{name}", fair.of.name);
            session.metric(&key, fair.numbers[metric] / least)?;
        }
    }
    Ok(())
}

impl Row<'_> {
    fn picture(&self) -> Result<Raster> {
        let mut all = TriangleMesh::default();
        for mesh in &self.meshes {
            let first = all.vertices.len() as u32;
            all.vertices.extend(&mesh.vertices);
            all.faces
                .extend(mesh.faces.iter().map(|face| face.map(|v| v + first)));
        }
        let frame = all.bounding_box().ok_or("there is no surface")?;
        let name = self.treatment.replace('_', " ");
        let caption = format!("{name}\ndistance {:.3}", self.numbers["rms"]);
        mesh_raster(&all, self.of.up, frame, caption)
    }
}
