use std::ops::RangeInclusive;

use chacha20::ChaCha8Rng;

use crate::meshes::{folder, sampled};
use crate::prelude::*;
use crate::smoothing::{LAPLACIAN, fairing_flow, mesh_raster, rms_distance, rounds};
use crate::surfaces::centred_box;
use engine::DISPLACEMENT;
use rand::{RngExt, SeedableRng};
use surfaces::{Fairing, TAUBIN, samples, up_axis};

pub const EXPERIMENT: Experiment = Experiment {
    name: "denoising",
    summary: "Noise taken off meshes by Willmore flow, by Taubin's smoothing and by Laplacian smoothing.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "denoising",
        title: "Noise of meshes",
        description: "Not in the paper: noise taken off meshes by Willmore flow, beside Taubin's and Laplacian smoothing.",
        figures: &[
            (
                "distances",
                "Distance to the clean surface over the number of iterations.",
            ),
            (
                "surfaces",
                "The clean and the noisy mesh, and what becomes of it.",
            ),
        ],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Noise of meshes",
    note: "",
    words: &[
        ("MESH", "`figure`, `lever`, `rocker_arm`, `armadillo`"),
        (
            "SMOOTHER",
            "`noisy`, the mesh with noise; `fair`, by the program; `taubin` and `laplacian`, smoothing with the best \
             number of iterations",
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
    ],
};

const TITLE: &str = "Noise of meshes taken off";
/// Standard deviations along the normals, in percent of the longest side.
const NOISES: [f64; 2] = [0.3, 0.5];
/// The grid as `willmore fair` chooses it: cells per unit length, and the longest side in the box.
const CELLS: usize = 128;
const SIDE: f64 = 0.9;
/// The most iterations of Taubin's and of Laplacian smoothing,
const ITERATIONS: usize = 100;
/// and the usual ones of Taubin's.
const USUAL: RangeInclusive<usize> = 3..=30;

/// Independent normally distributed noise along the normals of clean meshes, taken off by `willmore fair` at its defaults, by Taubin's
/// and by Laplacian smoothing with the number of iterations that comes nearest to the clean mesh: distances, normals and volumes.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// Denoise this clean mesh too (OBJ, OFF, PLY or STL); can be repeated [default: the meshes of scripts/fetch_meshes, where they are here]
    #[arg(long, value_name = "FILE")]
    mesh: Vec<PathBuf>,
}

struct Clean {
    name: String,
    mesh: ClosedMesh,
    distance: MeshDistance,
    up: UpAxis,
}

/// What became of a noisy mesh by one method.
struct Row<'a> {
    clean: &'a Clean,
    noise: f64,
    method: &'static str,
    iterations: Option<usize>,
    /// How near it is to the clean mesh, see [`QUALITY`].
    quality: Numbers,
    seconds: f64,
    result: TriangleMesh,
}

impl Row<'_> {
    fn key(&self) -> String {
        let method = self.method.to_lowercase();
        format!("{}.{method}", self.clean.key(self.noise))
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
    let cells = if quick { 64 } else { CELLS };
    let meshes = clean_meshes(options)?;
    let names: Vec<&str> = meshes.iter().map(|clean| clean.name.as_str()).collect();
    let parameters = json!({ "meshes": names, "noise_percent": noises, "cells": cells, "side": SIDE,
        "taubin": TAUBIN, "laplacian": LAPLACIAN, "iterations": ITERATIONS });
    let mut session = Session::open(EXPERIMENT.name, &options.run, parameters)?;
    let (mut rows, mut charts, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
    for clean in &meshes {
        for &noise in noises {
            let (methods, chart) = denoise(&mut session, clean, noise, cells)?;
            charts.push(chart);
            if noise.to_bits() == noises[0].to_bits() {
                let results = [0, 2, 3, 1].map(|k: usize| (methods[k].method, &methods[k].result));
                let shown = [("clean", clean.mesh.mesh())].into_iter().chain(results);
                let (up, frame) = (clean.up, clean.mesh.bounding_box());
                let drawn = shown.map(|(name, mesh)| mesh_raster(mesh, up, frame, name));
                pictures.extend(session.phase::<Vec<_>>("pictures", |_| drawn.collect())?);
            }
            rows.extend(methods);
        }
    }
    let table = Sheet::of(&rows)
        .keyed(|row, name| format!("{}.{name}", row.key()))
        .text("mesh", |row| &row.clean.name)
        .column("noise, %", Shortest, |row| row.noise)
        .text("method", |row| row.method)
        .column("iterations", Shortest, |row| row.iterations)
        .numbers(&QUALITY, |row| &row.quality)
        .column("seconds", Fixed(2), |row| row.seconds);
    session.sheet(table, "denoising")?;
    let title = format!("{TITLE}: distance to the clean surface");
    let figure = Figure::new(title, noises.len()).with_panels(charts);
    session.figure(figure.with_shared_legend(), "distances")?;
    let surfaces = Figure::new(format!("{TITLE}: noise of {} %", noises[0]), 5)
        .with_row_labels(names)
        .with_panels(pictures);
    session.figure(surfaces, "surfaces")?;
    session.finish(TITLE)
}

/// A mesh with noise, and what `fair`, Taubin's and Laplacian smoothing make of it, and the distances over the number of iterations.
fn denoise<'a>(
    session: &mut Session,
    clean: &'a Clean,
    noise: f64,
    cells: usize,
) -> Result<(Vec<Row<'a>>, LineChart)> {
    let noisy = clean.with_noise(noise, session.options.seed);
    let row = |method, iterations, result: TriangleMesh, seconds| Row {
        clean,
        noise,
        method,
        iterations,
        quality: clean.quality(&result),
        seconds,
        result,
    };
    let title = format!("{}, noise {noise} %", clean.name);
    let clock = Instant::now();
    let faired = fair(session, &noisy, cells, &title)?;
    let seconds = clock.elapsed().as_secs_f64();
    let mut rows = vec![
        row("noisy", None, noisy.clone(), 0.0),
        row("fair", None, faired, seconds),
    ];
    let (mut curves, mut taubin) = (Vec::new(), Vec::new());
    for (colour, method, factors) in [(1, "Taubin", TAUBIN), (2, "Laplacian", LAPLACIAN)] {
        let rounds = rounds(&noisy, factors).take(ITERATIONS);
        let all: Vec<Numbers> = rounds.map(|mesh| clean.quality(&mesh)).collect();
        let best = (0..ITERATIONS).min_by(|&a, &b| all[a]["rms"].total_cmp(&all[b]["rms"]));
        let best = best.unwrap_or(0) + 1;
        let clock = Instant::now();
        let mesh = noisy.smoothed(best, factors[0], factors[1]);
        let row = row(method, Some(best), mesh, clock.elapsed().as_secs_f64());
        let normals = least(&all, "normals");
        session.metric(&format!("{}.least_normals", row.key()), normals)?;
        rows.push(row);
        let points = (1..).zip(&all);
        let curve = Series::of(method, points, |(k, one)| [f64::from(k), one["rms"]]);
        curves.push(curve.with_colour(colour));
        if method == "Taubin" {
            taubin = all;
        }
    }
    let [noisy, fair] = [0, 1].map(|k: usize| &rows[k].quality);
    let usual = &taubin[USUAL.start() - 1..*USUAL.end()];
    for (name, taubin) in [("taubin", usual), ("best_taubin", &taubin[..])] {
        let distances = fair["rms"] / least(taubin, "rms");
        let normals = fair["normals"] / least(taubin, "normals");
        let key = clean.key(noise);
        session.metric(&format!("{key}.fair_over_{name}"), distances)?;
        session.metric(&format!("{key}.normals_over_{name}"), normals)?;
    }
    let level = |name, quality: &Numbers| {
        Series::new(name, [1.0, ITERATIONS as f64].map(|x| [x, quality["rms"]]))
    };
    curves.push(level("fair", fair).with_colour(0));
    let noisy = level("noisy", noisy).with_colour(4);
    curves.push(noisy.with_style(LineStyle::Dotted));
    let distance = Axis::log("distance, % of the longest side");
    let chart = LineChart::new(title, Axis::log("iterations"), distance);
    Ok((rows, chart.with_curves(curves)))
}

fn least(all: &[Numbers], name: &str) -> f64 {
    all.iter().map(|one| one[name]).fold(f64::MAX, f64::min)
}

/// The built-in shapes, and the meshes that are chosen or here.
fn clean_meshes(options: &Options) -> Result<Vec<Clean>> {
    let mut meshes = vec![
        Clean::new("figure", samples::figure(96)?, UpAxis::Y),
        Clean::new("lever", samples::lever(96)?, UpAxis::Z),
    ];
    let mut files = options.mesh.clone();
    if files.is_empty() && !options.run.quick {
        let here = ["rocker-arm.obj", "armadillo.obj"].map(|name| folder().join(name));
        files.extend(here.into_iter().filter(|path| path.exists()));
    }
    for path in files {
        let (mesh, _) = ClosedMesh::new(surfaces::read(&path)?)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        // Metrics are named after it.
        let other = |c: char| !(c.is_ascii_alphanumeric() || "-_".contains(c));
        let mut name = name.replace(other, "_");
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            name.insert_str(0, "mesh_");
        }
        meshes.push(Clean::new(&name, mesh, up_axis(&path)?));
    }
    let names: BTreeSet<String> = meshes.iter().map(|clean| clean.key(0.0)).collect();
    let message = "two meshes have the same name, or that of a built-in one: rename a file";
    require(names.len() == meshes.len(), message)?;
    Ok(meshes)
}

impl Clean {
    fn new(name: &str, mesh: ClosedMesh, up: UpAxis) -> Self {
        Self {
            name: name.to_owned(),
            distance: MeshDistance::new(&mesh),
            mesh,
            up,
        }
    }

    fn with_noise(&self, percent: f64, seed: u64) -> TriangleMesh {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut noisy = self.mesh.mesh().clone();
        let deviation = 0.01 * percent * self.mesh.bounding_box().longest_side();
        let normals = noisy.vertex_normals();
        for (x, normal) in noisy.vertices.iter_mut().zip(normals) {
            // The sum of twelve uniform numbers is normally distributed to a percent, with variance 1.
            let sum: f64 = (0..12).map(|_| rng.random::<f64>()).sum();
            *x = std::array::from_fn(|i| x[i] + deviation * (sum - 6.0) * normal[i]);
        }
        noisy.normals = None;
        noisy
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

    fn key(&self, noise: f64) -> String {
        let name = self.name.replace('-', "_").to_lowercase();
        format!("{name}.noise{noise}")
    }
}

/// The noise taken off as `willmore fair` does at its defaults.
fn fair(
    session: &mut Session,
    noisy: &TriangleMesh,
    cells: usize,
    title: &str,
) -> Result<TriangleMesh> {
    let (closed, _) = ClosedMesh::new(noisy.clone())?;
    let fairing = Fairing::new(closed, noisy.noise(), |_| false);
    let grid = centred_box(cells, 1.0)?;
    let placement = Placement::fit(&fairing.start.bounding_box(), &grid, SIDE)?;
    let distance = MeshDistance::new(&fairing.start.placed(&placement));
    let distance = session.phase(format!("{title}: signed distance"), |stage| {
        sampled(&distance, grid, &stage.bar)
    })?;
    let mut case = fairing_flow(title, distance)?;
    let followed = fairing.follow(placement, &case.initial, case.scales.eps)?;
    let measured = (fairing.clone(), followed.clone());
    case.measures = vec![Measure::new(DISPLACEMENT, move |u, _| {
        let gone = measured.0.displacement(&measured.1, u).ok();
        Ok(gone.map(|gone| gone * placement.scale()))
    })];
    case.stops = vec![
        Stop::Time(fairing.time(grid.spacing(), placement.scale())),
        Stop::Displacement(fairing.farthest() * placement.scale()),
    ];
    session.phase(title, |stage| {
        Ok(fairing.faired(&followed, stage.run(case)?.stored())?.mesh)
    })
}
