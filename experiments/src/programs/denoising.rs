//! Noise taken off meshes by `willmore fair` and by what else there is.

use std::ops::RangeInclusive;

use chacha20::ChaCha8Rng;
use jobs::{FairOptions, Input, Silent};
use rand::{RngExt, SeedableRng};
use surfaces::{TAUBIN, up_axis};

use crate::meshes::folder;
use crate::others::Others;
use crate::prelude::*;
use crate::smoothing::{LAPLACIAN, mesh_raster, rms_distance, rounds};

pub const EXPERIMENT: Experiment = Experiment {
    name: "denoising",
    summary: "Noise taken off meshes by Willmore flow, by Taubin's and Laplacian smoothing, by MeshLib and by filtered normals.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "denoising",
        title: "Noise of meshes",
        description: "Not in the paper: noise taken off meshes by Willmore flow, beside Taubin's and Laplacian smoothing, the denoiser of \
                 MeshLib and bilateral filtering of normals.",
        figures: &[
            (
                "comparison",
                "Distances to the clean surface by `willmore fair` over those by other methods.",
            ),
            (
                "distances",
                "Distance to the clean surface over the number of iterations.",
            ),
            (
                "surfaces",
                "The clean and the noisy mesh, and what becomes of it.",
            ),
        ],
        options: None,
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Noise of meshes",
    note: "",
    words: &[
        (
            "MESH",
            "`figure`, `lever`, `rocker_arm`, `armadillo`, on which the constants of `fair` were chosen; `cow`, `spot`, `bunny`, `fertility`, `homer`, \
             `cheburashka`, `bumpy_cube`, `balla`; the machine parts `fandisk`, and, with triangles of equal size, `fixed_top`, `plate_holes`, `round`",
        ),
        (
            "SMOOTHER",
            "`noisy`, the mesh with noise; `fair`, the program with the option --allow-loss; `taubin` and `laplacian`, smoothing with the best \
             number of iterations; `meshlib` and `bilateral`, MeshLib's denoiser and bilateral filtering of normals at their defaults; `meshlib_tuned` and \
             `bilateral_tuned`, with the parameters that come nearest to the clean mesh",
        ),
        (
            "GROUP",
            "`all`, the meshes on which nothing was chosen; `parts`, the machine parts among them; `round`, the others",
        ),
    ],
    rows: &[
        (
            "MESH.noiseN.SMOOTHER.rms",
            "root of the mean square distance of the vertices to the clean surface, in percent of the longest side; \
             noise of N percent",
        ),
        (
            "MESH.noiseN.SMOOTHER.normals",
            "mean angle between the faces and the clean ones in degrees",
        ),
        (
            "MESH.noiseN.SMOOTHER.volume",
            "change of the volume in percent, against the clean mesh",
        ),
        (
            "MESH.noiseN.SMOOTHER.least_normals",
            "the least such angle over all numbers of iterations",
        ),
        (
            "MESH.noiseN.fair_over_taubin, MESH.noiseN.fair_over_best_taubin",
            "the distance `rms` of `fair` over the least one of Taubin's smoothing, with 3 to 30 iterations and with \
             up to 100",
        ),
        (
            "MESH.noiseN.normals_over_taubin, MESH.noiseN.normals_over_best_taubin",
            "the same of the angles `normals`",
        ),
        (
            "denoising.GROUP.over_best_taubin, denoising.GROUP.over_meshlib, denoising.GROUP.over_meshlib_tuned, denoising.GROUP.over_bilateral, \
             denoising.GROUP.over_bilateral_tuned",
            "geometric mean of the distances `rms` of `fair` over those of another method, over meshes and strengths of noise",
        ),
    ],
};

const TITLE: &str = "Noise of meshes taken off";
/// Standard deviations along the normals, in percent of the longest side.
const NOISES: [f64; 2] = [0.3, 0.5];
/// Cells per unit length of quick runs, where the program would take more.
const QUICK_CELLS: usize = 64;
/// The most iterations of Taubin's and of Laplacian smoothing,
const ITERATIONS: usize = 100;
/// and the usual ones of Taubin's.
const USUAL: RangeInclusive<usize> = 3..=30;

/// Meshes on which constants of `willmore fair` were chosen.
const CHOSEN_ON: [&str; 2] = ["rocker-arm.obj", "armadillo.obj"];
/// Meshes on which nothing was chosen, as they are.
const OTHERS: [&str; 9] = [
    "public/common-3d-test-models/cow.obj",
    "public/common-3d-test-models/spot.obj",
    "public/libigl-tutorial-data/bunny.off",
    "public/libigl-tutorial-data/fertility.off",
    "public/common-3d-test-models/homer.obj",
    "public/common-3d-test-models/cheburashka.obj",
    "public/libigl-tutorial-data/bumpy-cube.obj",
    "public/trimesh/ballA.off",
    "public/common-3d-test-models/fandisk.obj",
];
/// Machine parts of few triangles, on which nothing was chosen.
const PARTS: [&str; 3] = [
    "public/trimesh/fixed_top.ply",
    "public/trimesh/plate_holes.STL",
    "public/trimesh/round.stl",
];
/// Other meshes with sharp edges.
const SHARP: [&str; 1] = ["fandisk"];
/// The meshes in the figures.
const SHOWN: [&str; 5] = [
    "figure",
    "rocker-arm",
    "armadillo",
    "fandisk",
    "plate_holes",
];
/// The methods in them.
const SHOWN_METHODS: [&str; 5] = ["noisy", "fair", "taubin", "meshlib", "bilateral_tuned"];

/// Independent normally distributed noise along the normals of clean meshes, taken off by `willmore fair --allow-loss` and by other methods: distances,
/// normals and volumes.
///
/// Taubin's and Laplacian smoothing have the number of iterations that comes nearest to the clean mesh. MeshLib's denoiser and bilateral filtering of normals
/// are run by `scripts/other_smoothings`. It says what it needs.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// Denoise this clean mesh too (OBJ, OFF, PLY or STL); can be repeated [default: those of scripts/fetch_meshes and of its option --public, as far as they are here]
    #[arg(long, value_name = "FILE")]
    mesh: Vec<PathBuf>,

    /// The Python that has MeshLib and PyMeshLab [default: without their methods, and without machine parts of few triangles]
    #[arg(long, value_name = "FILE")]
    python: Option<PathBuf>,
}

/// What kind of mesh it is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Constants of `fair` were chosen on it.
    ChosenOn,
    Round,
    /// With sharp edges.
    Part,
}

struct Clean {
    name: String,
    kind: Kind,
    mesh: ClosedMesh,
    distance: MeshDistance,
    up: UpAxis,
}

/// A clean mesh with noise.
struct Noisy<'a> {
    clean: &'a Clean,
    noise: f64,
    mesh: TriangleMesh,
}

/// What became of a noisy mesh by one method.
struct Row<'a> {
    of: &'a Noisy<'a>,
    method: String,
    parameters: String,
    /// How near it is to the clean mesh, see [`QUALITY`].
    quality: Numbers,
    seconds: Option<f64>,
    result: TriangleMesh,
}

impl Row<'_> {
    fn key(&self) -> String {
        format!("{}.{}", self.of.key(), self.method)
    }
}

/// Root of the mean square distance of the vertices to the clean surface, in percent of the longest side; the mean angle to its normals;
/// the change of the volume.
const QUALITY: [(&str, Format, &str); 3] = [
    ("distance, %", Fixed(4), "rms"),
    ("normals, degrees", Fixed(2), "normals"),
    ("volume, %", Fixed(3), "volume"),
];

fn program(options: &Options) -> Result<()> {
    let quick = options.run.quick;
    let noises = if quick { &NOISES[..1] } else { &NOISES };
    let mut meshes = clean_meshes(options)?;
    let parts = parts(options);
    let names = meshes.iter().map(|clean| clean.name.clone());
    let names: Vec<String> = names
        .chain(parts.iter().map(|path| name_of(path)))
        .collect();
    let parameters = json!({ "meshes": names, "noise_percent": noises, "taubin": TAUBIN, "laplacian": LAPLACIAN,
        "iterations": ITERATIONS });
    let mut session = Session::open(EXPERIMENT.name, &options.run, parameters)?;
    let seed = session.options.seed;
    if let Some(python) = &options.python {
        meshes.extend(session.phase("machine parts", |_| remeshed(&parts, python))?);
    }
    let noisy: Vec<Noisy> = meshes
        .iter()
        .flat_map(|clean| {
            noises
                .iter()
                .map(move |&noise| clean.with_noise(noise, seed))
        })
        .collect();
    let others = match &options.python {
        Some(python) => session.phase("other programs", |_| {
            Others::smooth(python, |folder| {
                let write = |noisy: &Noisy| noisy.write(folder);
                noisy.iter().try_for_each(write)
            })
        })?,
        None => Others::default(),
    };
    others.tell(&mut session);
    let (mut rows, mut charts) = (Vec::new(), Vec::new());
    for noisy in &noisy {
        let (methods, chart) = denoise(&mut session, noisy, &others)?;
        if noisy.clean.is_shown() {
            charts.push(chart);
        }
        rows.extend(methods);
    }
    let table = Sheet::of(&rows)
        .keyed(|row, name| format!("{}.{name}", row.key()))
        .text("mesh", |row| &row.of.clean.name)
        .column("noise, %", Shortest, |row| row.of.noise)
        .text("method", |row| &row.method)
        .text("parameters", |row| &row.parameters)
        .numbers(&QUALITY, |row| &row.quality)
        .column("seconds", Fixed(2), |row| row.seconds);
    session.sheet(table, "denoising")?;
    compare(&mut session, &rows)?;
    let title = format!("{TITLE}: distance to the clean surface");
    let figure = Figure::new(title, noises.len()).with_panels(charts);
    session.figure(figure.with_shared_legend(), "distances")?;
    let pictures = session.phase("pictures", |_| surfaces(&rows, noises[0]))?;
    session.figure(pictures, "surfaces")?;
    session.finish(TITLE)
}

/// The clean meshes in the figure, and what the methods make of them with noise.
fn surfaces(rows: &[Row], noise: f64) -> Result<Figure> {
    let with_noise = |row: &&Row| {
        row.of.noise.to_bits() == noise.to_bits()
            && row.of.clean.is_shown()
            && SHOWN_METHODS.contains(&&*row.method)
    };
    let (mut pictures, mut names) = (Vec::new(), Vec::new());
    for row in rows.iter().filter(with_noise) {
        let clean = row.of.clean;
        let frame = clean.mesh.bounding_box();
        if row.method == SHOWN_METHODS[0] {
            names.push(clean.name.as_str());
            pictures.push(mesh_raster(clean.mesh.mesh(), clean.up, frame, "clean")?);
        }
        let caption = format!(
            "{}\ndistance {:.3} %",
            row.method.replace('_', " "),
            row.quality["rms"]
        );
        pictures.push(mesh_raster(&row.result, clean.up, frame, caption)?);
    }
    let columns = pictures.len() / names.len().max(1);
    let title = format!("{TITLE}: noise of {noise} %");
    Ok(Figure::new(title, columns)
        .with_row_labels(names)
        .with_panels(pictures))
}

/// What all methods make of a noisy mesh, and the distances over the number of iterations.
fn denoise<'a>(
    session: &mut Session,
    of: &'a Noisy<'a>,
    others: &Others,
) -> Result<(Vec<Row<'a>>, LineChart)> {
    let clean = of.clean;
    let row = |method: &str, parameters: String, result: TriangleMesh, seconds| Row {
        of,
        method: method.to_owned(),
        parameters,
        quality: clean.quality(&result),
        seconds,
        result,
    };
    let title = format!("{}, noise {} %", clean.name, of.noise);
    let clock = Instant::now();
    let quick = session.options.quick;
    let faired = session.phase(format!("{title}: fair"), |_| faired(of, quick))?;
    let seconds = clock.elapsed().as_secs_f64();
    let mut rows = vec![
        row("noisy", String::new(), of.mesh.clone(), None),
        row("fair", String::new(), faired, Some(seconds)),
    ];
    let (mut curves, mut taubin) = (Vec::new(), Vec::new());
    for (colour, method, factors) in [(1, "taubin", TAUBIN), (2, "laplacian", LAPLACIAN)] {
        let rounds = rounds(&of.mesh, factors).take(ITERATIONS);
        let all: Vec<Numbers> = session.phase(format!("{title}: {method}"), |_| {
            Ok::<_, crate::Error>(rounds.map(|mesh| clean.quality(&mesh)).collect())
        })?;
        let best = (0..ITERATIONS).min_by(|&a, &b| all[a]["rms"].total_cmp(&all[b]["rms"]));
        let best = best.unwrap_or(0) + 1;
        let clock = Instant::now();
        let mesh = of.mesh.smoothed(best, factors[0], factors[1]);
        let seconds = clock.elapsed().as_secs_f64();
        let row = row(method, format!("{best} iterations"), mesh, Some(seconds));
        session.metric(
            &format!("{}.least_normals", row.key()),
            least(&all, "normals"),
        )?;
        rows.push(row);
        let points = (1..).zip(&all);
        let curve = Series::of(method, points, |(k, one)| [f64::from(k), one["rms"]]);
        curves.push(curve.with_colour(colour));
        if method == "taubin" {
            taubin = all;
        }
    }
    let [noisy, fair] = [0, 1].map(|k: usize| &rows[k].quality);
    let usual = &taubin[USUAL.start() - 1..*USUAL.end()];
    for (name, taubin) in [("taubin", usual), ("best_taubin", &taubin[..])] {
        let distances = fair["rms"] / least(taubin, "rms");
        let normals = fair["normals"] / least(taubin, "normals");
        let key = of.key();
        session.metric(&format!("{key}.fair_over_{name}"), distances)?;
        session.metric(&format!("{key}.normals_over_{name}"), normals)?;
    }
    let level = |name, quality: &Numbers| {
        Series::new(name, [1.0, ITERATIONS as f64].map(|x| [x, quality["rms"]]))
    };
    curves.push(level("fair", fair).with_colour(0));
    let noisy = level("noisy", noisy).with_colour(4);
    curves.push(noisy.with_style(LineStyle::Dotted));
    rows.extend(of_others(of, others, &row)?);
    let distance = Axis::log("distance, % of the longest side");
    let chart = LineChart::new(title, Axis::log("iterations"), distance);
    Ok((rows, chart.with_curves(curves)))
}

/// What other programs make of a noisy mesh, at their defaults and with the parameters that come nearest to the clean mesh.
fn of_others<'a>(
    of: &Noisy,
    others: &Others,
    row: &impl Fn(&str, String, TriangleMesh, Option<f64>) -> Row<'a>,
) -> Result<Vec<Row<'a>>> {
    let mut rows = Vec::new();
    for method in ["meshlib", "bilateral"] {
        let mut tuned: Option<Row> = None;
        let runs = others.runs.iter();
        for run in runs.filter(|run| run.of == of.key() && run.method == method) {
            let mesh = others.meshes(run)?.pop().unwrap_or_default();
            let parameters = run.parameters.clone();
            let made = row(
                &format!("{method}_tuned"),
                parameters,
                mesh,
                Some(run.seconds),
            );
            if run.parameters.is_empty() {
                let defaults = row(method, String::new(), made.result.clone(), made.seconds);
                rows.push(defaults);
            }
            let is_nearer = |best: &Row| made.quality["rms"] < best.quality["rms"];
            if tuned.as_ref().is_none_or(is_nearer) {
                tuned = Some(made);
            }
        }
        rows.extend(tuned);
    }
    Ok(rows)
}

/// Distances by `fair` over those by other methods, for the meshes on which nothing was chosen.
fn compare(session: &mut Session, rows: &[Row]) -> Result<()> {
    let methods = [
        "taubin",
        "meshlib",
        "meshlib_tuned",
        "bilateral",
        "bilateral_tuned",
    ];
    let mut charts = Vec::new();
    for method in methods {
        let pairs = |kind: Kind| -> Vec<[f64; 2]> {
            let of_kind = rows.iter().filter(|row| row.of.clean.kind == kind);
            let fair = of_kind.clone().filter(|row| row.method == "fair");
            let other = of_kind.filter(|row| row.method == method);
            let rms = |row: &Row| row.quality["rms"];
            other
                .zip(fair)
                .map(|(other, fair)| [rms(other), rms(fair)])
                .collect()
        };
        let [chosen, round, parts] = [Kind::ChosenOn, Kind::Round, Kind::Part].map(pairs);
        if chosen.is_empty() {
            continue;
        }
        let all = [&round[..], &parts[..]].concat();
        let name = if method == "taubin" {
            "best_taubin"
        } else {
            method
        };
        for (group, pairs) in [("all", &all), ("parts", &parts), ("round", &round)] {
            if !pairs.is_empty() {
                let logs = pairs.iter().map(|[other, fair]| (fair / other).ln());
                let mean = (logs.sum::<f64>() / pairs.len() as f64).exp();
                session.metric(&format!("denoising.{group}.over_{name}"), mean)?;
            }
        }
        let points = [chosen.clone(), all].concat();
        let ends = points.as_flattened().iter().copied();
        let (low, high) = (
            ends.clone().fold(f64::MAX, f64::min),
            ends.fold(0.0, f64::max),
        );
        let name = name.replace('_', " ");
        let x = Axis::log(format!("distance by {name}, %"));
        let y = Axis::log("distance by fair, %");
        let symbols = [
            ("constants chosen on it", Marker::Circle, chosen),
            ("round", Marker::Square, round),
            ("machine part", Marker::Triangle, parts),
        ];
        let curves = (0..).zip(symbols).map(|(colour, (label, marker, points))| {
            Series::new(label, points)
                .with_symbols(marker)
                .with_colour(colour)
        });
        let equal = Series::new("as near", [[low; 2], [high; 2]]).with_colour(4);
        let equal = equal.with_style(LineStyle::Dotted);
        charts.push(LineChart::new(name, x, y).with_curves(curves.chain([equal])));
    }
    let title = format!("{TITLE}: distance to the clean surface");
    let figure = Figure::new(title, charts.len().min(3)).with_panels(charts);
    session.figure(figure.with_shared_legend(), "comparison")
}

fn least(all: &[Numbers], name: &str) -> f64 {
    all.iter().map(|one| one[name]).fold(f64::MAX, f64::min)
}

/// The built-in shapes, and the meshes that are chosen or here.
fn clean_meshes(options: &Options) -> Result<Vec<Clean>> {
    let built_in = |name: &str, mesh, up| Clean::new(name.to_owned(), Kind::ChosenOn, mesh, up);
    let mut meshes = vec![
        built_in("figure", surfaces::samples::figure(96)?, UpAxis::Y),
        built_in("lever", surfaces::samples::lever(96)?, UpAxis::Z),
    ];
    let mut files = options.mesh.clone();
    if files.is_empty() && !options.run.quick {
        let here = CHOSEN_ON
            .iter()
            .chain(&OTHERS)
            .map(|name| folder().join(name));
        files.extend(here.filter(|path| path.exists()));
    }
    for path in files {
        let name = name_of(&path);
        let kind = match path.file_name().and_then(|name| name.to_str()) {
            Some(file) if CHOSEN_ON.contains(&file) => Kind::ChosenOn,
            _ if SHARP.contains(&&*name) => Kind::Part,
            _ => Kind::Round,
        };
        let (mesh, _) = ClosedMesh::new(surfaces::read(&path)?)?;
        meshes.push(Clean::new(name, kind, mesh, up_axis(&path)?));
    }
    let names: BTreeSet<String> = meshes.iter().map(Clean::key).collect();
    let message = "two meshes have the same name, or that of a built-in one: rename a file";
    require(names.len() == meshes.len(), message)?;
    Ok(meshes)
}

/// The machine parts of few triangles that are here, if something can remesh them.
fn parts(options: &Options) -> Vec<PathBuf> {
    let is_wanted = options.python.is_some() && options.mesh.is_empty() && !options.run.quick;
    let wanted = PARTS.iter().filter(|_| is_wanted);
    let here = wanted.map(|name| folder().join(name));
    here.filter(|path| path.exists()).collect()
}

fn remeshed(parts: &[PathBuf], python: &Path) -> Result<Vec<Clean>> {
    if parts.is_empty() {
        return Ok(Vec::new());
    }
    let made = Others::remesh(python, |folder| {
        let write = |path: &PathBuf| {
            let (mesh, _) = ClosedMesh::new(surfaces::read(path)?)?;
            Ok(surfaces::write(
                folder.join(format!("{}.ply", name_of(path))),
                mesh.mesh(),
            )?)
        };
        parts.iter().try_for_each(write)
    })?;
    let clean = |run| {
        let (mesh, _) = ClosedMesh::new(made.meshes(run)?.pop().unwrap_or_default())?;
        Ok(Clean::new(run.of.clone(), Kind::Part, mesh, UpAxis::Z))
    };
    made.runs.iter().map(clean).collect()
}

/// The name of a file, as metrics can have it.
fn name_of(path: &Path) -> String {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let other = |c: char| !(c.is_ascii_alphanumeric() || "-_".contains(c));
    let mut name = name.replace(other, "_");
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert_str(0, "mesh_");
    }
    name
}

impl Clean {
    fn new(name: String, kind: Kind, mesh: ClosedMesh, up: UpAxis) -> Self {
        Self {
            name,
            kind,
            distance: MeshDistance::new(&mesh),
            mesh,
            up,
        }
    }

    fn with_noise(&self, noise: f64, seed: u64) -> Noisy<'_> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut mesh = self.mesh.mesh().clone();
        let deviation = 0.01 * noise * self.mesh.bounding_box().longest_side();
        let normals = mesh.vertex_normals();
        for (x, normal) in mesh.vertices.iter_mut().zip(normals) {
            // The sum of twelve uniform numbers is normally distributed to a percent, with variance 1.
            let sum: f64 = (0..12).map(|_| rng.random::<f64>()).sum();
            *x = std::array::from_fn(|i| x[i] + deviation * (sum - 6.0) * normal[i]);
        }
        mesh.normals = None;
        Noisy {
            clean: self,
            noise,
            mesh,
        }
    }

    fn quality(&self, mesh: &TriangleMesh) -> Numbers {
        let rms = rms_distance(mesh, &self.distance);
        let clean = self.mesh.mesh();
        let angles = mesh.faces.iter().map(|&face| {
            let [a, b] = [mesh, clean].map(|mesh| mesh.face_normal(face));
            let cosine: f64 = (0..3).map(|i| a[i] * b[i]).sum();
            cosine.clamp(-1.0, 1.0).acos().to_degrees()
        });
        let volume = mesh.volume() / self.mesh.volume() - 1.0;
        Numbers::from([
            ("rms", 100.0 * rms / self.mesh.bounding_box().longest_side()),
            ("normals", angles.sum::<f64>() / mesh.faces.len() as f64),
            ("volume", 100.0 * volume),
        ])
    }

    fn key(&self) -> String {
        self.name.replace('-', "_").to_lowercase()
    }

    fn is_shown(&self) -> bool {
        SHOWN.contains(&&*self.name)
    }
}

impl Noisy<'_> {
    fn key(&self) -> String {
        format!("{}.noise{}", self.clean.key(), self.noise)
    }

    fn write(&self, folder: &Path) -> Result<()> {
        Ok(surfaces::write(
            folder.join(format!("{}.ply", self.key())),
            &self.mesh,
        )?)
    }
}

/// The noise taken off as `willmore fair --allow-loss` does.
fn faired(noisy: &Noisy, quick: bool) -> Result<TriangleMesh> {
    let mut options = FairOptions::of(Input::mesh(&noisy.clean.name, &noisy.mesh)?);
    options.input.cells = quick.then_some(QUICK_CELLS);
    // Thin places that noise has closed are lost, and that is a part of the distance.
    options.allow_loss = true;
    let made = jobs::fair(options, &Silent)?;
    let shape = made.shape.as_ref().and_then(jobs::Shape::mesh);
    shape.cloned().ok_or_else(|| "fair left no mesh".into())
}
