//! Surfaces under Willmore flow: their scales, the shown steps of a run, and the pictures, tables and metrics of those.

use clap::Args;
use engine::{
    Case, Flow, Measure, NeededNetwork, Operator, Record, Samples, Scales, Scheme, StepRule, Stop,
    Trajectory, energy_increases, mean_hvp,
};
use geometry::{Field, Grid, UpAxis};
use render::{Bounds, Framing, Quality, Rgb, Scene, Tube};
use report::{Figure, Format, OutputDir, Raster, Summary, Table};
use surfaces::ClosedMesh;

use crate::networks::{Chosen, NetworkOptions};
use crate::options::RunOptions;
use crate::records::step_rows;
use crate::session::Session;
use crate::{Error, memory};

/// Interface width of surfaces, in cells.
const EPS_OVER_H: f64 = 2.0;
/// Kernel width of the network for surfaces.
const WIDTH: usize = 17;
/// Room around a surface, as a fraction of the picture.
const MARGIN: f64 = 0.02;
/// The usual side of a picture in pixels.
const SIDE: u32 = 640;
/// Colour of a surface where it may move, if it may not everywhere.
const MOVING: Rgb = Rgb(150, 196, 160);

/// The scales of the paper for surfaces at resolution `n`: `eps = 2h`, `tautilde = h^2`.
pub fn scales(n: usize) -> Scales {
    Scales::of_grid(1.0 / n as f64, EPS_OVER_H)
}

/// The network for surfaces, the same at every resolution.
pub fn needed_network() -> NeededNetwork {
    scales(1).needs(3, 1.0).of_width(WIDTH)
}

/// The box of the given side around `(0.5, 0.5, 0.5)` with `n` cells per unit length; the nodes of the unit box are `i/n`.
///
/// # Errors
/// [`Error::Geometry`] unless `n` times the side is a whole number, at least 2.
pub fn centred_box(n: usize, side: f64) -> Result<Grid<3>, Error> {
    Ok(Grid::per_unit(n, side)?.with_origin([0.5 - 0.5 * side; 3])?)
}

/// Willmore flow as in the paper: everywhere, in whole steps.
pub fn willmore_flow(
    shape: &str,
    initial: Field<3>,
    operator: Operator,
    scales: Scales,
    (rule, steps): (StepRule, usize),
) -> Case<3> {
    Case {
        shape: shape.to_owned(),
        initial,
        region: None,
        flow: Flow::Willmore,
        operator,
        scales,
        steps: rule.into(),
        stops: vec![Stop::Steps(steps)],
        measures: Measure::size(scales.eps),
    }
}

/// Options of the programs with surfaces.
#[derive(Args, Clone, Debug)]
pub struct SurfaceOptions {
    /// Common options.
    #[command(flatten)]
    pub run: RunOptions,

    /// Networks.
    #[command(flatten)]
    networks: NetworkOptions,

    /// Cells per unit length; eps = 2/n and tautilde = 1/n^2 follow [default: that of the paper]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,
}

impl SurfaceOptions {
    /// Cells per unit length: those chosen, or the usual ones of a quick run or of the paper.
    pub fn cells(&self, [quick, paper]: [usize; 2]) -> usize {
        let usual = if self.run.quick { quick } else { paper };
        self.cells.unwrap_or(usual)
    }

    /// Where networks come from.
    ///
    /// # Errors
    /// [`Error::Engine`] if one of the user's is not for surfaces.
    pub fn networks(&self) -> Result<Chosen, Error> {
        self.networks.load(&[needed_network()])
    }
}

/// Which schemes.
#[derive(Args, Clone, Copy, Debug)]
pub struct SchemeOptions {
    /// One scheme alone: paper, calibrated or accurate [default: paper and accurate]
    #[arg(long, value_name = "NAME", value_enum)]
    pub scheme: Option<Scheme>,
}

impl SchemeOptions {
    /// Those wanted of the learned operator.
    pub fn schemes(&self) -> Vec<Scheme> {
        let wanted = self.scheme.map(|scheme| vec![scheme]);
        wanted.unwrap_or_else(|| vec![Scheme::Paper, Scheme::Accurate])
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

/// A surface that is to flow.
pub struct Surface {
    /// Prefix of its metrics and files.
    pub key: &'static str,
    /// Name in titles and tables.
    pub title: String,
    /// How it flows.
    pub case: Case<3>,
    /// Steps to be shown, and the Willmore energies that the paper reports for them. Of a run that ends early the last one is shown.
    pub shown: Vec<(usize, Option<f64>)>,
    /// Direction of view.
    pub view: View,
}

/// A shown step.
pub struct Snapshot {
    /// Its number.
    pub step: usize,
    /// Its time.
    pub time: f64,
    /// The Willmore energy `w` of the phase field, with the implicit finite-element step and the mass-matrix norm.
    pub w: f64,
    /// The same as the scheme measures it, with its own operator and calibration: what the flow minimizes.
    w_scheme: f64,
    /// What the paper reports.
    paper: Option<f64>,
    /// Perimeter `P_eps`, the area of the surface.
    perimeter: f64,
    /// Volume inside.
    volume: f64,
    /// Euler characteristic of the isosurface `u = 0`.
    euler_characteristic: f64,
    /// What stands below the picture.
    pub caption: String,
    /// Curves drawn into the picture.
    pub tubes: Vec<Tube>,
}

/// A surface that has flowed.
pub struct Flowed {
    /// Prefix of its metrics and files, whatever the method.
    pub surface: &'static str,
    /// Name in titles and tables.
    pub title: String,
    view: View,
    /// All steps.
    pub trajectory: Trajectory<3>,
    /// The shown ones.
    pub snapshots: Vec<Snapshot>,
    /// Further metrics.
    pub metrics: Vec<(String, f64)>,
    /// Largest resident memory of the process until the last step was done, in MiB, where the system tells.
    peak_mib: Option<f64>,
}

impl Surface {
    /// Lets the surface flow, or continues or looks up its run, and measures the steps to be shown.
    ///
    /// # Errors
    /// What the flow and the measurement raise.
    pub fn flow(self, session: &mut Session<'_>) -> Result<Flowed, Error> {
        let Self { key, title, .. } = self;
        let n = self.case.grid().spacing().recip().round();
        let run = format!("{title}, {}, n = {n}", self.case.operator.label());
        let folder = format!("{key}-{}", self.case.operator.key());
        let mut samples = Samples::every(usize::MAX);
        samples.also = self.shown.iter().map(|(step, _)| *step).collect();
        let trajectory = session.trajectory(&run, self.case, &folder, &samples)?;
        let mut flowed = Flowed {
            surface: key,
            title,
            view: self.view,
            trajectory,
            snapshots: Vec::new(),
            metrics: Vec::new(),
            peak_mib: memory::peak_mib(),
        };
        memory::release_freed();
        let papers = |step: usize| {
            let found = self.shown.iter().find(|(shown, _)| *shown == step);
            found.and_then(|(_, w)| w.filter(|_| !session.options.quick))
        };
        let last = flowed.trajectory.steps();
        let mut steps: Vec<usize> = samples.also.into_iter().filter(|k| *k < last).collect();
        steps.push(last);
        let measures = format!("{}: measures", flowed.title);
        flowed.snapshots = session.manifest.phase(measures, || {
            let snapshot = |step| flowed.snapshot(step, papers(step), &session.output);
            steps
                .into_iter()
                .map(snapshot)
                .collect::<Result<_, Error>>()
        })?;
        Ok(flowed)
    }
}

impl Flowed {
    /// Measures the phase field after a step, and writes its isosurface.
    fn snapshot(
        &self,
        step: usize,
        paper: Option<f64>,
        output: &OutputDir,
    ) -> Result<Snapshot, Error> {
        let (case, u) = (&self.trajectory.case, self.trajectory.field(step)?);
        // The isosurface is closed by construction; whoever uses the file relies on it.
        let (mesh, _) = ClosedMesh::new(surfaces::phase_field_surface(&u, case.scales.eps)?)?;
        let file = format!("{}.ply", self.file(step));
        surfaces::write(output.subfolder("meshes")?.path(&file)?, mesh.mesh())?;
        let record = self.trajectory.record(step);
        let at_rest = |first: &Record| first.minimization.map(|made| made.energy_at_rest());
        let at_start = || self.trajectory.records.first().and_then(at_rest);
        let measures = self.trajectory.measures(step)?;
        let w = case.implicit_elements()?.willmore_energy(&u)?;
        memory::release_freed();
        Ok(Snapshot {
            step,
            time: record.map_or(0.0, |r| r.time),
            w,
            w_scheme: (record.map_or_else(at_start, Record::willmore_energy)).unwrap_or(f64::NAN),
            paper,
            perimeter: measures["perimeter"],
            volume: measures["volume"],
            euler_characteristic: mesh.euler_characteristic() as f64,
            caption: format!("step {step}: w = {w:.2}"),
            tubes: Vec::new(),
        })
    }

    /// Name of the files of a step.
    fn file(&self, step: usize) -> String {
        let operator = self.trajectory.case.operator.key();
        format!("{}_{operator}_step{step:03}", self.surface)
    }

    /// Name of method and scheme.
    pub fn label(&self) -> String {
        self.trajectory.case.operator.label()
    }

    /// Prefix of its metrics: the surface, and the method unless it is the learned operator in the paper's scheme.
    pub fn key(&self) -> String {
        let operator = &self.trajectory.case.operator;
        if operator.method.is_learned() && operator.scheme == Scheme::Paper {
            self.surface.to_owned()
        } else {
            format!("{}.{}", self.surface, operator.key())
        }
    }

    /// Adds the metrics of the run.
    ///
    /// # Errors
    /// [`Error::Report`] for a value that is not finite.
    pub fn summarize(&self, summary: &mut Summary) -> Result<(), Error> {
        let (key, records) = (self.key(), &self.trajectory.records);
        self.summarize_shapes(&key, summary)?;
        summary.insert(&format!("{key}.hvp_per_step"), mean_hvp(records))?;
        summary.insert_count(
            &format!("{key}.energy_increases"),
            energy_increases(records),
        )?;
        summary.insert(&format!("{key}.seconds"), self.trajectory.seconds())?;
        for (name, value) in &self.metrics {
            summary.insert(&format!("{key}.{name}"), *value)?;
        }
        Ok(())
    }

    /// Adds the metrics of the shown shapes, and the memory that they took.
    ///
    /// # Errors
    /// [`Error::Report`] for a value that is not finite.
    pub fn summarize_shapes(&self, key: &str, summary: &mut Summary) -> Result<(), Error> {
        for s in &self.snapshots {
            for (name, value) in [
                ("w", s.w),
                ("w_scheme", s.w_scheme),
                ("perimeter", s.perimeter),
                ("volume", s.volume),
                ("euler_characteristic", s.euler_characteristic),
            ] {
                summary.insert(&format!("{key}.{name}.step{}", s.step), value)?;
            }
        }
        if let Some(peak) = self.peak_mib {
            summary.insert(&format!("{key}.peak_mib"), peak)?;
        }
        Ok(())
    }

    /// Pictures of the shown steps with this side in pixels (less in a quick run), all in one framing, each also as a file of its own.
    ///
    /// # Errors
    /// What rendering and writing raise.
    pub fn pictures(
        &self,
        output: &OutputDir,
        quick: bool,
        side: u32,
    ) -> Result<Vec<Raster>, Error> {
        memory::release_freed();
        let (side, quality) = if quick {
            (120, Quality::Draft)
        } else {
            (side, Quality::Standard)
        };
        // Scenes are made twice rather than kept: one takes several times the memory of its phase field.
        let mut bounds: Option<Bounds> = None;
        for snapshot in &self.snapshots {
            let tubes = snapshot.tubes.iter().flat_map(|tube| tube.points.clone());
            for one in [self.scene(snapshot)?.bounds(), Bounds::around(tubes)] {
                bounds = match (bounds, one) {
                    (Some(all), Some(one)) => Some(all.union(&one)),
                    (all, one) => all.or(one),
                };
            }
        }
        let folder = output.subfolder("pictures")?;
        let picture = |snapshot: &Snapshot| {
            let mut scene = self.scene(snapshot)?.quality(quality);
            if let Some(bounds) = bounds {
                scene = scene.framing(Framing::Within(bounds));
            }
            let picture = scene.render(side)?;
            picture.write_png(folder.path(&format!("{}.png", self.file(snapshot.step)))?)?;
            let size = [picture.width() as usize, picture.height() as usize];
            Ok(Raster::new(size, picture.pixels()).with_caption(&snapshot.caption))
        };
        self.snapshots.iter().map(picture).collect()
    }

    fn scene(&self, snapshot: &Snapshot) -> Result<Scene<'static>, Error> {
        let case = &self.trajectory.case;
        let mut scene = Scene::new(&self.trajectory.field(snapshot.step)?, case.scales.eps)?;
        if let Some(region) = &case.region {
            let mask = region.iter().map(|&moves| f64::from(moves)).collect();
            scene = scene.highlight_mask(&Field::from_values(*case.grid(), mask)?, MOVING)?;
        }
        Ok(scene
            .up(self.view.up)
            .azimuth(self.view.azimuth)
            .elevation(self.view.elevation)
            .margin(MARGIN)
            .tubes(snapshot.tubes.clone()))
    }
}

/// Writes a figure with a row of pictures for each run, the table of the shown steps and the records of all steps, and returns the table
/// as text.
///
/// # Errors
/// What rendering and writing raise.
pub fn write(
    session: &mut Session<'_>,
    title: &str,
    note: String,
    all: &[Flowed],
) -> Result<String, Error> {
    let (output, quick) = (&session.output, session.options.quick);
    let pictures = session.manifest.phase("pictures", || {
        (all.iter().map(|one| one.pictures(output, quick, SIDE))).collect::<Result<Vec<_>, _>>()
    })?;
    let columns = pictures.iter().map(Vec::len).max();
    let row = |one: &Flowed| format!("{}\n{}", one.title, one.label().replace(", ", "\n"));
    Figure::new(session.options.title(title), columns.unwrap_or(1))
        .with_row_labels(all.iter().map(row))
        .with_panels(pictures.into_iter().flatten())
        .with_note(note)
        .write(output, "surfaces")?;
    let runs = all.iter().map(|one| (one.surface, &one.trajectory));
    output.write_csv("steps.csv", step_rows(runs))?;
    let table = table(all)?;
    table.write(output, "energies")?;
    Ok(table.to_markdown())
}

/// The metrics of all runs.
///
/// # Errors
/// [`Error::Report`] for a value that is not finite.
pub fn summary(all: &[Flowed]) -> Result<Summary, Error> {
    let mut summary = Summary::new();
    all.iter().try_for_each(|one| one.summarize(&mut summary))?;
    Ok(summary)
}

/// Shown steps of all runs, beside the paper's energies.
///
/// # Errors
/// [`Error::Report`] for a value that is not finite.
pub fn table(all: &[Flowed]) -> Result<Table, Error> {
    let rows: Vec<(&Flowed, &Snapshot)> = (all.iter())
        .flat_map(|one| one.snapshots.iter().map(move |shown| (one, shown)))
        .collect();
    Ok(Table::of(&rows)
        .text("surface", |(one, _)| one.title.as_str())
        .text("method", |(one, _)| one.label())
        .number("step", Format::Shortest, |(_, s)| s.step)
        .number("w", Format::Fixed(2), |(_, s)| s.w)
        .number("w, paper", Format::Fixed(2), |(_, s)| s.paper)
        .number("w of the scheme", Format::Fixed(2), |(_, s)| s.w_scheme)
        .number("area", Format::Fixed(4), |(_, s)| s.perimeter)
        .number("volume", Format::Fixed(5), |(_, s)| s.volume)
        .number("Euler characteristic", Format::Fixed(0), |(_, s)| {
            s.euler_characteristic
        })
        .finish()?)
}
