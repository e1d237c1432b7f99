//! Willmore flow of surfaces: what the programs in three dimensions share.

use std::time::Instant;

use clap::Args;
use fem::FiniteElementStep;
use geometry::{Field, Grid, UpAxis};
use model::{Network, Ratios};
use operators::ComputeDevice;
use render::{Bounds, Framing, Quality, Rgb, Scene, Tube};
use report::{Column, Figure, Format, Manifest, OutputDir, Progress, Raster, Summary, Table};
use serde::Serialize;
use solver::{FlowParams, NewtonParams, StepRecord};
use surfaces::ClosedMesh;

use crate::circles::Flow;
use crate::evolution::{Division, Evolution, NamedRegion, TimeSteps, Trajectory};
use crate::method::{Method, Scheme};
use crate::options::RunOptions;
use crate::{Error, memory};

/// Interface width of surfaces, in cells.
const EPS_OVER_H: f64 = 2.0;
/// Room around a surface, as a fraction of the picture.
const MARGIN: f64 = 0.02;
/// Kernel width of the network for surfaces.
const WIDTH: usize = 17;
/// The usual side of a picture in pixels.
const SIDE: u32 = 640;
/// Colour of a surface where it may move, if it may not everywhere.
const MOVING: Rgb = Rgb(150, 196, 160);

/// The scales of the paper for surfaces at resolution `n`: `eps = 2h`, `tautilde = h^2`.
pub fn scales(n: usize) -> FlowParams {
    let h = 1.0 / n as f64;
    FlowParams {
        eps: EPS_OVER_H * h,
        mcf_step: h * h,
        newton: NewtonParams::default(),
        calibration: solver::Factors::PAPER,
    }
}

/// The ratios of the network for surfaces.
pub fn ratios() -> Ratios {
    Ratios {
        dimension: 3,
        width: WIDTH,
        eps_over_h: EPS_OVER_H,
        step_over_h2: 1.0,
    }
}

/// Centre of all boxes, on every axis.
const CENTRE: f64 = 0.5;

/// The box of the given side around `(0.5, 0.5, 0.5)` with `n` cells per unit length; the nodes of the unit box are `i/n`.
///
/// # Errors
/// [`Error::Geometry`] unless `n` times the side is a whole number, at least 2.
pub fn centred_box(n: usize, side: f64) -> Result<Grid<3>, Error> {
    Ok(Grid::per_unit(n, side)?.with_origin([CENTRE - 0.5 * side; 3])?)
}

/// Which schemes.
#[derive(Args, Clone, Copy, Debug)]
pub struct SchemeOptions {
    /// One scheme alone: paper, calibrated or accurate [default: paper and accurate]
    #[arg(long, value_name = "NAME", value_enum)]
    pub scheme: Option<Scheme>,
}

impl SchemeOptions {
    /// Those wanted of the hybrid method.
    pub fn schemes(&self) -> Vec<Scheme> {
        match self.scheme {
            Some(scheme) => vec![scheme],
            None => vec![Scheme::Paper, Scheme::Accurate],
        }
    }
}

/// From where a surface is looked at.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The axis that points up.
    pub up: UpAxis,
    /// Degrees about it.
    pub azimuth: f64,
    /// Degrees above the horizon.
    pub elevation: f64,
}

/// How a surface flows; by default as in the paper, everywhere and in whole steps, to the end.
#[derive(Clone, Debug, Default)]
pub struct Setting {
    /// The scheme.
    pub scheme: Scheme,
    /// Where it moves.
    pub region: Option<NamedRegion>,
    /// Whether and how its steps are made in parts.
    pub division: Option<Division>,
    /// When it stands still, see [`Evolution::still`].
    pub still: Option<f64>,
}

/// A surface that flows.
pub struct SurfaceRun<'a> {
    /// Prefix of its metrics and name of its folder.
    pub key: String,
    /// Name in titles and tables.
    pub title: String,
    /// The method.
    pub method: Method,
    /// Cells per unit length.
    pub n: usize,
    /// Sizes of the time steps.
    pub tau: TimeSteps,
    /// Their number.
    pub steps: usize,
    /// How else it flows.
    pub setting: Setting,
    /// Steps to be shown, and with them the Willmore energy that the paper reports. Of a run that ends early, the last one is shown.
    pub shown: Vec<(usize, Option<f64>)>,
    /// The phase field at the beginning.
    pub initial: &'a Field<3>,
    /// What identifies it in stored runs.
    pub identity: String,
    /// Direction of view.
    pub view: View,
}

/// A shown step.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Snapshot {
    /// Its number.
    pub step: usize,
    /// Its time.
    pub time: f64,
    /// The Willmore energy `w` of the phase field, with the implicit finite-element step and the mass-matrix norm.
    pub w: f64,
    /// The same as the scheme measures it, with its own operator and calibration: what the flow minimizes.
    pub w_scheme: f64,
    /// What the paper reports.
    pub paper: Option<f64>,
    /// Perimeter `P_eps`, the area of the surface.
    pub perimeter: f64,
    /// Volume inside.
    pub volume: f64,
    /// Euler characteristic of the isosurface `u = 0`.
    pub euler_characteristic: i64,
    /// Its connected components.
    pub components: usize,
}

/// A surface that has flowed.
pub struct Finished<'a> {
    /// What was asked for.
    pub run: SurfaceRun<'a>,
    /// All steps.
    pub trajectory: Trajectory<3>,
    /// The shown ones.
    pub snapshots: Vec<Snapshot>,
    /// Largest resident memory of the process until the last step was done, in MiB, where the system tells.
    pub peak_mib: Option<f64>,
}

/// What running surfaces needs.
pub struct Workshop<'a> {
    /// Common options.
    pub options: &'a RunOptions,
    /// Where tensors live.
    pub device: &'a ComputeDevice,
    /// The learned operator.
    pub network: &'a Network,
    /// Where results go.
    pub output: &'a OutputDir,
    /// Progress bars.
    pub progress: &'a Progress,
    /// Side of a picture in pixels, except in quick runs.
    pub side: u32,
}

#[derive(Serialize)]
struct StepRow<'a> {
    surface: &'a str,
    method: Method,
    scheme: Scheme,
    step: usize,
    time: f64,
    tau: f64,
    energy_before: f64,
    energy: f64,
    willmore_energy: f64,
    perimeter: f64,
    volume: f64,
    exit: solver::Exit,
    newton: usize,
    hvp: f64,
    negative_curvature: usize,
    seconds: f64,
}

impl<'a> Workshop<'a> {
    /// Pictures have the usual size.
    pub fn new(
        options: &'a RunOptions,
        device: &'a ComputeDevice,
        network: &'a Network,
        output: &'a OutputDir,
        progress: &'a Progress,
    ) -> Self {
        Self {
            options,
            device,
            network,
            output,
            progress,
            side: SIDE,
        }
    }
}

impl Workshop<'_> {
    /// Runs, continues or looks up a surface, and measures the steps to be shown.
    ///
    /// # Errors
    /// What the flow and the measurement raise.
    pub fn run<'a>(
        &self,
        manifest: &mut Manifest,
        run: SurfaceRun<'a>,
    ) -> Result<Finished<'a>, Error> {
        let params = scales(run.n);
        let evolution = Evolution {
            shape: run.identity.clone(),
            flow: Flow::Willmore,
            method: run.method,
            scheme: run.setting.scheme,
            n: run.n,
            side: run.initial.grid().side(),
            centre: CENTRE,
            params,
            tau: run.tau,
            division: run.setting.division.clone(),
            still: run.setting.still,
            region: run.setting.region.clone(),
            sample_every: run.steps.max(1),
            also_sample: run.shown.iter().map(|(step, _)| *step).collect(),
            steps: run.steps,
            pause_after: None,
        };
        let title = format!("{}, {}, n = {}", run.title, run.label(), run.n);
        let bar = self.progress.bar(title.clone(), run.steps as u64);
        let store = self.output.subfolder("fields")?.subfolder(&run.key)?;
        let initial = run.initial;
        let trajectory = manifest.phase(title, || {
            evolution.run(
                &|_, _| Ok(initial.clone()),
                Some(self.network),
                self.device,
                &store,
                &bar,
            )
        })?;
        bar.finish();
        let peak_mib = memory::peak_mib();
        memory::release_freed();
        let measure = FiniteElementStep::implicit(initial.grid(), params.eps, params.mcf_step)?;
        let meshes = self.output.subfolder("meshes")?;
        let last = trajectory.steps();
        let mut shown: Vec<_> = (run.shown.iter().copied())
            .filter(|(step, _)| *step <= last)
            .collect();
        if shown.last().is_none_or(|(step, _)| *step < last) {
            shown.push((last, None));
        }
        let snapshots = manifest.phase(format!("{}: measures", run.title), || {
            (shown.into_iter())
                .map(|(step, paper)| {
                    let u = trajectory.field(step)?;
                    // The isosurface is closed by construction; whoever uses the file relies on it.
                    let surface = surfaces::phase_field_surface(&u, params.eps)?;
                    let (surface, _) = ClosedMesh::new(surface)?;
                    let name = format!("{}.ply", run.name(step));
                    surfaces::write(meshes.path(&name)?, surface.mesh())?;
                    let measures = trajectory.measures_after(step)?;
                    let record = trajectory.record(step);
                    let at_rest = trajectory.records.first();
                    memory::release_freed();
                    Ok(Snapshot {
                        step,
                        time: record.map_or(0.0, |r| r.time),
                        w: measure.willmore_energy(&u)?,
                        w_scheme: match (record, at_rest) {
                            (Some(record), _) => record.willmore_energy,
                            // Standing still costs 2 tau w.
                            (None, Some(first)) => first.energy_before / (2.0 * first.tau),
                            (None, None) => f64::NAN,
                        },
                        paper: paper.filter(|_| !self.options.quick),
                        perimeter: measures.perimeter,
                        volume: measures.volume,
                        euler_characteristic: surface.euler_characteristic(),
                        components: surface.components(),
                    })
                })
                .collect::<Result<Vec<_>, Error>>()
        })?;
        Ok(Finished {
            run,
            trajectory,
            snapshots,
            peak_mib,
        })
    }

    /// The side of a picture in pixels, and its quality.
    pub fn picture_size(&self) -> (u32, Quality) {
        if self.options.quick {
            (120, Quality::Draft)
        } else {
            (self.side, Quality::Standard)
        }
    }

    /// One row per run: pictures of the shown steps.
    ///
    /// `decorate` adds tubes to a picture: run, step.
    ///
    /// # Errors
    /// What rendering and writing raise.
    pub fn figure(
        &self,
        title: &str,
        finished: &[Finished<'_>],
        caption: &dyn Fn(usize, &Snapshot) -> String,
        decorate: &dyn Fn(usize, usize) -> Vec<Tube>,
    ) -> Result<Figure, Error> {
        let columns = finished.iter().map(|f| f.snapshots.len()).max();
        let labels = finished
            .iter()
            .map(|f| format!("{}\n{}", f.run.title, f.run.label().replace(", ", "\n")));
        let mut figure =
            Figure::new(self.options.title(title), columns.unwrap_or(1)).with_row_labels(labels);
        for (k, one) in finished.iter().enumerate() {
            let caption = |snapshot: &Snapshot| caption(k, snapshot);
            for panel in self.panels(one, &caption, &|step| decorate(k, step))? {
                figure = figure.with_panel(panel);
            }
        }
        Ok(figure)
    }

    /// Pictures of the shown steps of a run, all in one framing, each also as a file of its own with the mesh.
    ///
    /// `decorate` adds tubes to the picture of a step.
    ///
    /// # Errors
    /// What rendering and writing raise.
    pub fn panels(
        &self,
        finished: &Finished<'_>,
        caption: &dyn Fn(&Snapshot) -> String,
        decorate: &dyn Fn(usize) -> Vec<Tube>,
    ) -> Result<Vec<Raster>, Error> {
        let Finished {
            run,
            trajectory,
            snapshots,
            ..
        } = finished;
        let (size, quality) = self.picture_size();
        let pictures = self.output.subfolder("pictures")?;
        memory::release_freed();
        let eps = trajectory.evolution.params.eps;
        let moving = run.moving()?;
        let scene = |snapshot: &Snapshot| -> Result<Scene<'static>, Error> {
            let mut scene = Scene::new(&trajectory.field(snapshot.step)?, eps)?;
            if let Some(moving) = &moving {
                scene = scene.highlight_mask(moving, MOVING)?;
            }
            Ok(scene
                .up(run.view.up)
                .azimuth(run.view.azimuth)
                .elevation(run.view.elevation)
                .margin(MARGIN)
                .quality(quality)
                .tubes(decorate(snapshot.step)))
        };
        // Made twice rather than kept: a scene takes several times the memory of its phase field.
        let mut bounds: Option<Bounds> = None;
        for snapshot in snapshots {
            let tubes = decorate(snapshot.step);
            let points = tubes.into_iter().flat_map(|tube| tube.points);
            for one in [scene(snapshot)?.bounds(), Bounds::around(points)] {
                bounds = match (bounds, one) {
                    (Some(all), Some(one)) => Some(all.union(&one)),
                    (all, one) => all.or(one),
                };
            }
        }
        (snapshots.iter())
            .map(|snapshot| {
                let mut scene = scene(snapshot)?;
                if let Some(bounds) = bounds {
                    scene = scene.framing(Framing::Within(bounds));
                }
                let name = run.name(snapshot.step);
                let picture = scene.render(size)?;
                picture.write_png(pictures.path(&format!("{name}.png"))?)?;
                let size = [picture.width() as usize, picture.height() as usize];
                Ok(Raster::new(size, picture.pixels()).with_caption(caption(snapshot)))
            })
            .collect()
    }
}

impl SurfaceRun<'_> {
    /// Name of the files of a step.
    fn name(&self, step: usize) -> String {
        let method = self.method.key_in(self.setting.scheme);
        format!("{}_{method}_step{step:03}", self.key)
    }

    /// Name of method and scheme.
    pub fn label(&self) -> String {
        self.method.label_in(self.setting.scheme)
    }

    /// 1 at the nodes that may move, 0 at the others; nothing if all may.
    fn moving(&self) -> Result<Option<Field<3>>, Error> {
        let Some(region) = &self.setting.region else {
            return Ok(None);
        };
        let mask = region.nodes.iter().map(|&moves| f64::from(moves));
        Ok(Some(Field::from_values(
            *self.initial.grid(),
            mask.collect(),
        )?))
    }
}

impl Finished<'_> {
    /// Prefix of its metrics: the surface, and the method unless it is the learned operator in the paper's scheme.
    pub fn key(&self) -> String {
        let SurfaceRun { key, method, .. } = &self.run;
        match (method, self.run.setting.scheme) {
            (Method::Hybrid, Scheme::Paper) => key.clone(),
            (_, scheme) => format!("{key}.{}", method.key_in(scheme)),
        }
    }

    /// Adds the metrics of this run.
    ///
    /// # Errors
    /// [`Error::Report`] for a value that is not finite.
    pub fn summarize(&self, summary: &mut Summary) -> Result<(), Error> {
        let key = self.key();
        self.summarize_shapes(&key, summary)?;
        let records = &self.trajectory.records;
        let count = records.len().max(1) as f64;
        let hvp: f64 = records.iter().map(StepRecord::hvp).sum();
        let rises = records.iter().filter(|r| r.energy > r.energy_before);
        summary.insert(&format!("{key}.hvp_per_step"), hvp / count)?;
        summary.insert_count(&format!("{key}.energy_increases"), rises.count())?;
        summary.insert(&format!("{key}.seconds"), self.trajectory.seconds)?;
        Ok(())
    }

    /// Adds the metrics of the shown shapes, and the memory that they took.
    ///
    /// # Errors
    /// [`Error::Report`] for a value that is not finite.
    pub fn summarize_shapes(&self, key: &str, summary: &mut Summary) -> Result<(), Error> {
        for s in &self.snapshots {
            summary.insert(&format!("{key}.w.step{}", s.step), s.w)?;
            summary.insert(&format!("{key}.w_scheme.step{}", s.step), s.w_scheme)?;
            summary.insert(&format!("{key}.perimeter.step{}", s.step), s.perimeter)?;
            summary.insert(&format!("{key}.volume.step{}", s.step), s.volume)?;
            let euler = s.euler_characteristic as f64;
            summary.insert(&format!("{key}.euler_characteristic.step{}", s.step), euler)?;
        }
        if let Some(peak) = self.peak_mib {
            summary.insert(&format!("{key}.peak_mib"), peak)?;
        }
        Ok(())
    }
}

/// Shown steps of all runs, beside the paper's energies.
///
/// # Errors
/// [`Error::Report`] for a value that is not finite.
pub fn table(finished: &[Finished<'_>]) -> Result<Table, Error> {
    let mut table = Table::new([
        Column::text("surface"),
        Column::text("method"),
        Column::number("step", Format::Shortest),
        Column::number("w", Format::Fixed(2)),
        Column::number("w, paper", Format::Fixed(2)),
        Column::number("w of the scheme", Format::Fixed(2)),
        Column::number("area", Format::Fixed(4)),
        Column::number("volume", Format::Fixed(5)),
        Column::number("Euler characteristic", Format::Fixed(0)),
    ]);
    for f in finished {
        for s in &f.snapshots {
            table.push([
                f.run.title.as_str().into(),
                f.run.label().into(),
                s.step.into(),
                s.w.into(),
                s.paper.into(),
                s.w_scheme.into(),
                s.perimeter.into(),
                s.volume.into(),
                (s.euler_characteristic as f64).into(),
            ])?;
        }
    }
    Ok(table)
}

/// Writes the records of all steps.
///
/// # Errors
/// [`Error::Report`].
pub fn write_steps(finished: &[Finished<'_>], output: &OutputDir) -> Result<(), Error> {
    let rows: Vec<StepRow<'_>> = finished
        .iter()
        .flat_map(|f| {
            f.trajectory.records.iter().map(|r| StepRow {
                surface: &f.run.key,
                method: f.run.method,
                scheme: f.run.setting.scheme,
                step: r.step,
                time: r.time,
                tau: r.tau,
                energy_before: r.energy_before,
                energy: r.energy,
                willmore_energy: r.willmore_energy,
                perimeter: r.perimeter,
                volume: r.volume,
                exit: r.newton.exit,
                newton: r.newton.newton,
                hvp: r.hvp(),
                negative_curvature: r.newton.negative_curvature,
                seconds: r.seconds,
            })
        })
        .collect();
    output.write("steps.csv", report::data::to_csv(&rows)?)?;
    Ok(())
}

/// Wall time since `clock`, in seconds.
pub fn since(clock: Instant) -> f64 {
    clock.elapsed().as_secs_f64()
}
