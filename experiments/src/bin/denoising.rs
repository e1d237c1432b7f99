//! Noise taken off meshes by Willmore flow, by Taubin's smoothing and by Laplacian smoothing.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use engine::{
    Case, DISPLACEMENT, Flow, Measure, Method, Operator, Run, Scales, Scheme, StepRule, Stop,
};
use experiments::meshes::{folder, signed_distance};
use experiments::session::Session;
use experiments::surfaces::centred_box;
use experiments::{Error, harness, options::RunOptions};
use geometry::{Field, Placement, SignedDistance, UpAxis, optimal_profile};
use model::Networks;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use render::{Scene, View};
use report::{Axis, Figure, Format, LineChart, LineStyle, Raster, Series, Table};
use serde_json::json;
use surfaces::{ClosedMesh, Fairing, MeshDistance, TriangleMesh, samples, usual_up_axis};

const TITLE: &str = "Noise of meshes taken off";
/// Standard deviations along the normals, in percent of the longest side.
const NOISES: [f64; 2] = [0.3, 0.5];
/// The grid as `willmore fair` chooses it: cells per unit length, and the longest side in the box.
const CELLS: usize = 128;
const SIDE: f64 = 0.9;
/// Factors of Taubin's smoothing, and of Laplacian smoothing; the most iterations of both.
const TAUBIN: [f64; 2] = [0.5, -0.53];
const LAPLACIAN: [f64; 2] = [0.5, 0.0];
const ITERATIONS: usize = 30;
/// Side of a picture in pixels.
const DRAWN: u32 = 420;

/// Independent normally distributed noise along the normals of clean meshes, taken off by `willmore fair` at its defaults, by Taubin's
/// and by Laplacian smoothing with the number of iterations that comes nearest to the clean mesh: distances, normals and volumes.
#[derive(Parser, Debug)]
#[command(name = "denoising", version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// Denoise this clean mesh too (OBJ, PLY or STL); can be repeated [default: the meshes of scripts/fetch_meshes, where they are here]
    #[arg(long, value_name = "FILE")]
    mesh: Vec<PathBuf>,
}

fn main() -> ExitCode {
    harness::main(program)
}

/// A clean mesh.
struct Clean {
    name: String,
    mesh: ClosedMesh,
    distance: MeshDistance,
    up: UpAxis,
}

/// What became of a noisy mesh by one method.
struct Row {
    /// Of the mesh and its noise, in metrics.
    key: String,
    mesh: String,
    noise: f64,
    method: &'static str,
    iterations: Option<usize>,
    quality: Quality,
    seconds: f64,
}

/// How near a mesh is to the clean one.
#[derive(Clone, Copy)]
struct Quality {
    /// Root of the mean square distance of the vertices to the clean surface, in percent of the longest side.
    rms: f64,
    /// Mean angle between corresponding faces, in degrees.
    normals: f64,
    /// Change of the volume in percent.
    volume: f64,
}

fn program(options: &Options) -> Result<(), Error> {
    let device = options.run.open_device()?;
    let (noises, cells) = if options.run.quick {
        (&NOISES[..1], 64)
    } else {
        (&NOISES[..], CELLS)
    };
    let meshes = clean_meshes(options)?;
    let names: Vec<&str> = meshes.iter().map(|clean| clean.name.as_str()).collect();
    let parameters = json!({ "meshes": names, "noise_percent": noises, "cells": cells, "side": SIDE,
        "taubin": TAUBIN, "laplacian": LAPLACIAN, "iterations": ITERATIONS });
    let mut session = Session::open("denoising", &options.run, device, parameters)?;
    let (mut rows, mut charts, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
    for clean in &meshes {
        for &noise in noises {
            let noisy = clean.with_noise(noise, options.run.seed);
            let key = clean.key(noise);
            let of_case = |method, iterations, quality, seconds| Row {
                key: key.clone(),
                mesh: clean.name.clone(),
                noise,
                method,
                iterations,
                quality,
                seconds,
            };
            rows.push(of_case("noisy", None, clean.quality(&noisy), 0.0));
            let clock = Instant::now();
            let title = format!("{}, noise {noise} %", clean.name);
            let faired = fair(&mut session, &noisy, cells, &title)?;
            let quality = clean.quality(&faired);
            rows.push(of_case(
                "fair",
                None,
                quality,
                clock.elapsed().as_secs_f64(),
            ));
            let mut curves = Vec::new();
            let mut shown = vec![
                ("clean", clean.mesh.mesh().clone()),
                ("noisy", noisy.clone()),
            ];
            for (method, factors) in [("Taubin", TAUBIN), ("Laplacian", LAPLACIAN)] {
                let clock = Instant::now();
                let smoothed = |count| noisy.smoothed(count, factors[0], factors[1]);
                let all: Vec<Quality> = (1..=ITERATIONS)
                    .map(|count| clean.quality(&smoothed(count)))
                    .collect();
                let seconds = clock.elapsed().as_secs_f64() / ITERATIONS as f64;
                let best = (2..ITERATIONS).min_by(|&a, &b| all[a].rms.total_cmp(&all[b].rms));
                let best = best.unwrap_or(2);
                let least = all[2..].iter().map(|q| q.normals).fold(f64::MAX, f64::min);
                rows.push(of_case(method, Some(best + 1), all[best], seconds));
                let metric = format!("{key}.{}.least_normals", method.to_lowercase());
                session.summary.insert(&metric, least)?;
                shown.push((method, smoothed(best + 1)));
                let points = all.iter().enumerate();
                let points: Vec<_> = points
                    .map(|(k, quality)| [(k + 1) as f64, quality.rms])
                    .collect();
                curves.push(Series::new(method, points).with_colour(curves.len() + 1));
            }
            shown.push(("fair", faired));
            let ends = [1.0, ITERATIONS as f64].map(|x| [x, quality.rms]);
            curves.push(Series::new("fair", ends).with_colour(0));
            let level = [1.0, ITERATIONS as f64].map(|x| [x, clean.quality(&noisy).rms]);
            curves.push(
                Series::new("noisy", level)
                    .with_colour(4)
                    .with_style(LineStyle::Dotted),
            );
            let axes = (
                Axis::linear("iterations"),
                Axis::log("distance, % of the longest side"),
            );
            charts.push(LineChart::new(title, axes.0, axes.1).with_curves(curves));
            if noise.to_bits() == noises[0].to_bits() {
                let draw = || {
                    shown
                        .iter()
                        .map(|(name, mesh)| clean.picture(name, mesh))
                        .collect::<Result<Vec<_>, _>>()
                };
                pictures.extend(session.phase("pictures", draw)?);
            }
        }
    }
    summarize(&mut session, &rows)?;
    let figure = Figure::new(
        format!("{TITLE}: distance to the clean surface"),
        noises.len(),
    );
    session.figure(figure.with_panels(charts).with_shared_legend(), "distances")?;
    let figure = Figure::new(format!("{TITLE}: noise of {} %", noises[0]), 5)
        .with_row_labels(names)
        .with_panels(pictures);
    session.figure(figure, "surfaces")?;
    session.finish(TITLE)
}

/// The built-in shapes, and the meshes that are chosen or here.
fn clean_meshes(options: &Options) -> Result<Vec<Clean>, Error> {
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
        meshes.push(Clean::new(
            &name.replace('.', "_"),
            mesh,
            usual_up_axis(&path)?,
        ));
    }
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

    /// The mesh with noise in percent of the longest side.
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

    fn quality(&self, mesh: &TriangleMesh) -> Quality {
        let squares = mesh
            .vertices
            .iter()
            .map(|&x| self.distance.signed_distance(x).powi(2));
        let rms = (squares.sum::<f64>() / mesh.vertices.len() as f64).sqrt();
        let clean = self.mesh.mesh();
        let angles = mesh.faces.iter().map(|&face| {
            let [a, b] = [mesh, clean].map(|mesh| mesh.face_normal(face));
            let cosine: f64 = (0..3).map(|i| a[i] * b[i]).sum();
            cosine.clamp(-1.0, 1.0).acos().to_degrees()
        });
        Quality {
            rms: 100.0 * rms / self.mesh.bounding_box().longest_side(),
            normals: angles.sum::<f64>() / mesh.faces.len() as f64,
            volume: 100.0 * (mesh.volume() / self.mesh.volume() - 1.0),
        }
    }

    fn key(&self, noise: f64) -> String {
        let name = self.name.replace('-', "_").to_lowercase();
        format!("{name}.noise{noise}")
    }

    /// A picture of a mesh, in the frame of the clean one.
    fn picture(&self, caption: &str, mesh: &TriangleMesh) -> Result<Raster, Error> {
        let scene = Scene::of_mesh(mesh.clone()).view(View {
            up: self.up,
            azimuth: -60.0,
            elevation: 25.0,
        });
        let picture = scene.within(self.mesh.bounding_box()).render([DRAWN; 2])?;
        let size = [picture.width() as usize, picture.height() as usize];
        Ok(Raster::new(size, picture.pixels()).with_caption(caption))
    }
}

/// The noise taken off as `willmore fair` does at its defaults.
fn fair(
    session: &mut Session<'_>,
    noisy: &TriangleMesh,
    cells: usize,
    title: &str,
) -> Result<TriangleMesh, Error> {
    let (closed, _) = ClosedMesh::new(noisy.clone())?;
    let fairing = Fairing::new(closed, noisy.noise(), |_| false);
    let grid = centred_box(cells, 1.0)?;
    let scales = Scales::of_grid(grid.spacing(), 2.0);
    let placement = Placement::fit(&fairing.start().bounding_box(), &grid, SIDE, 0.0)?;
    let bar = session.progress.bar(title.to_owned(), cells as u64);
    let mut distance = signed_distance(&fairing.start().placed(&placement), grid, &bar)?;
    surfaces::mend_signs(&mut distance);
    let initial: Field<3> = distance.map(|s| optimal_profile(s, scales.eps));
    let followed = fairing.follow(placement, &initial, scales.eps)?;
    let needed = scales.needs(3, grid.spacing());
    let variant = (Method::Hybrid, Scheme::Accurate);
    let operator = Operator::new(variant, &Networks::default(), &needed, &grid, &scales)?;
    let measured = (fairing.clone(), followed.clone());
    let displacement = Measure::new(DISPLACEMENT, move |u, _| {
        let gone = measured.0.displacement(&measured.1, u).ok();
        Ok(gone.map(|gone| gone * placement.scale()))
    });
    let case = Case {
        shape: title.to_owned(),
        initial,
        region: None,
        flow: Flow::Willmore,
        operator,
        scales,
        steps: StepRule::Doubling(Fairing::first_step(grid.spacing())).into(),
        stops: vec![
            Stop::Time(fairing.time(grid.spacing(), placement.scale())),
            Stop::Displacement(fairing.farthest() * placement.scale()),
        ],
        measures: vec![displacement],
    };
    let device = session.device.clone();
    let faired = session.phase(title, || {
        let mut run = Run::new(case, &device)?;
        while run.step()?.is_some() {}
        Ok(fairing.faired(&followed, run.field())?)
    })?;
    bar.finish();
    Ok(faired)
}

fn summarize(session: &mut Session<'_>, rows: &[Row]) -> Result<(), Error> {
    let table = Table::of(rows)
        .text("mesh", |row| row.mesh.as_str())
        .number("noise, %", Format::Shortest, |row| row.noise)
        .text("method", |row| row.method)
        .number("iterations", Format::Shortest, |row| row.iterations)
        .number("distance, %", Format::Fixed(4), |row| row.quality.rms)
        .number("normals, degrees", Format::Fixed(2), |row| {
            row.quality.normals
        })
        .number("volume, %", Format::Fixed(3), |row| row.quality.volume)
        .number("seconds", Format::Fixed(2), |row| row.seconds);
    session.table(table, "denoising")?;
    for row in rows {
        let key = format!("{}.{}", row.key, row.method.to_lowercase());
        let Quality {
            rms,
            normals,
            volume,
        } = row.quality;
        for (metric, value) in [("rms", rms), ("normals", normals), ("volume", volume)] {
            session.summary.insert(&format!("{key}.{metric}"), value)?;
        }
    }
    for cases in rows.chunk_by(|a, b| a.key == b.key) {
        let rms = |method: &str| {
            let row = cases.iter().find(|row| row.method == method);
            row.map_or(f64::NAN, |row| row.quality.rms)
        };
        let key = format!("{}.fair_over_taubin", cases[0].key);
        session.summary.insert(&key, rms("fair") / rms("Taubin"))?;
    }
    Ok(())
}
