//! Surfaces under Willmore flow: their scales, the shown steps of a run, and the pictures, tables and metrics of those.

use model::NeededNetwork;
pub use render::View;
use render::{Picture, Quality, Rgb, Scene, Tube};

use crate::prelude::*;

/// What is said about every surface.
pub const METRICS: MetricTable = MetricTable {
    title: "Surfaces",
    note: "Without a method the scheme is the paper's with the learned operator; in `inpainting_3d` it is the \
         calibrated scheme with the accurate network.",
    words: &[METHOD],
    rows: &[
        (
            "SURFACE[.METHOD].w.stepK",
            "Willmore energy, measured by the implicit finite-element step in the norm of the mass matrix, as in the \
             paper; absent on more than 2^26 nodes",
        ),
        (
            "SURFACE[.METHOD].w_scheme.stepK",
            "Willmore energy as the scheme itself measures it, by its operator and its calibration",
        ),
        (
            "SURFACE[.METHOD].perimeter.stepK, SURFACE[.METHOD].volume.stepK",
            "area of the surface `P_eps`, volume of `{u > 0}`",
        ),
        (
            "SURFACE[.METHOD].euler_characteristic.stepK",
            "Euler characteristic of the surface: 2 for a sphere, 0 for a torus",
        ),
        (
            "SURFACE[.METHOD].energy_increases, SURFACE[.METHOD].hvp_per_step",
            "substeps in which the energy of the step rose; as for circles, per substep",
        ),
        ("SURFACE[.METHOD].seconds", "wall time of all steps"),
        (
            "SURFACE[.METHOD].peak_mib, SURFACE.peak_mib_with_pictures, disk_and_cube.peak_mib_with_pictures",
            "largest memory of the process in MiB until the steps were made, if they were made in one go, and until \
             the pictures were drawn",
        ),
        (
            "SURFACE[.METHOD].l2_to_fe.stepK",
            "L2 distance to the run by nested implicit finite elements",
        ),
        (
            "SURFACE[.METHOD].clifford_l2, SURFACE[.METHOD].clifford_w, SURFACE[.METHOD].clifford_outer_radius",
            "the Clifford torus nearest to the last step: its L2 distance, its `w` on this grid, the radius of its \
             largest circle",
        ),
    ],
};

const EPS_OVER_H: f64 = 2.0;
const WIDTH: usize = 17;
/// From above and from the side.
pub const VIEW: View = View {
    up: UpAxis::Z,
    azimuth: 30.0,
    elevation: 25.0,
};
const SIDE: u32 = 640;
/// On larger grids the finite-element step takes too much memory (30 GB and more).
const MOST_NODES: usize = 1 << 26;
/// Colour of a surface where it may move, if it may not everywhere.
const MOVING: Rgb = Rgb(150, 196, 160);

/// The scales of the paper for surfaces at resolution `n`: `eps = 2h`, `tautilde = h^2`.
pub fn scales(n: usize) -> Scales {
    Scales::of_grid(1.0 / n as f64, EPS_OVER_H)
}

/// The network for surfaces, the same at every resolution.
pub fn needed_network() -> NeededNetwork {
    NeededNetwork {
        width: Some(WIDTH),
        ..scales(1).needs(3, 1.0)
    }
}

/// The box of the given side around `(0.5, 0.5, 0.5)` with `n` cells per unit length; the nodes of the unit box are `i/n`.
pub fn centred_box(n: usize, side: f64) -> Result<Grid<3>> {
    Ok(Grid::per_unit(n, side)?.with_origin([0.5 - 0.5 * side; 3])?)
}

pub struct Setting {
    pub n: usize,
    pub grid: Grid<3>,
    pub scales: Scales,
    discretizations: Vec<Discretization>,
    networks: Chosen,
}

impl Setting {
    /// For these discretizations, in a box of the given side, with the usual numbers of cells per unit length of a quick run and of the paper.
    pub fn new(
        options: &FigureOptions,
        discretizations: &[Discretization],
        usual: [usize; 2],
        side: f64,
    ) -> Result<Self> {
        let n = options.cells(usual);
        let learned = discretizations.iter().filter(|one| takes_networks(**one));
        let needs: Vec<_> = learned.map(|_| needed_network()).collect();
        Ok(Self {
            discretizations: discretizations.to_vec(),
            networks: options.networks.load(&needs)?,
            grid: centred_box(n, side)?,
            scales: scales(n),
            n,
        })
    }

    pub fn operator(&self, discretization: Discretization) -> Result<Operator<3>> {
        let networks = self.networks.of(discretization.formulation);
        let (needed, grid, scales) = (needed_network(), &self.grid, &self.scales);
        let mut operator = Operator::new(discretization, &networks, &needed, grid, scales)?;
        if discretization == ACCURATE {
            operator.storage = Storage::Auto;
        }
        Ok(operator)
    }

    /// The parameters of a program for its manifest: the common ones with the networks of all operators, and others.
    pub fn parameters(&self, mut others: Value) -> Result<Value> {
        let mut networks = BTreeMap::new();
        for &discretization in &self.discretizations {
            if let Some(named) = self.operator(discretization)?.network() {
                networks.insert(discretization.key(), named.network.fingerprint());
            }
        }
        others["n"] = self.n.into();
        others["box_side"] = self.grid.side().into();
        others["eps"] = self.scales.eps.into();
        others["mcf_step"] = self.scales.mcf_step.into();
        others["networks"] = json!(networks);
        Ok(others)
    }
}

#[derive(Args, Clone, Copy, Debug)]
pub struct FormulationOptions {
    /// One scheme alone: paper, calibrated or accurate [default: paper and accurate]
    #[arg(long = "scheme", value_name = "NAME", value_enum)]
    pub formulation: Option<Formulation>,
}

impl FormulationOptions {
    /// The learned operator in these formulations.
    pub fn learned(&self) -> Vec<Discretization> {
        match self.formulation {
            None => vec![PAPERS, ACCURATE],
            Some(formulation) => vec![Discretization::new(Method::Hybrid, formulation)],
        }
    }
}

/// What is shown of a surface that flows.
#[derive(Clone)]
pub struct Surface {
    pub key: &'static str,
    pub title: String,
    /// Steps to be shown, and the Willmore energies that the paper reports for them. Of a run that ends early the last one is shown.
    pub shown: Vec<(usize, Option<f64>)>,
    pub view: View,
}

/// The measures of a shown step in tables. `w` is the Willmore energy with the implicit finite-element step and the mass-matrix norm, up to
/// [`MOST_NODES`]; `w_scheme` what the flow minimizes; the Euler characteristic is that of the isosurface `u = 0`.
const MEASURES: [(&str, Format, &str); 5] = [
    ("w", Fixed(2), "w"),
    ("w of the scheme", Fixed(2), "w_scheme"),
    ("area", Fixed(4), "perimeter"),
    ("volume", Fixed(5), "volume"),
    ("Euler characteristic", Fixed(0), "euler_characteristic"),
];

pub struct Snapshot {
    pub step: usize,
    pub measures: Numbers,
    /// The Willmore energy that the paper reports.
    pub paper: Option<f64>,
    pub caption: String,
    pub tubes: Vec<Tube>,
}

pub struct Flowed {
    pub surface: Surface,
    pub trajectory: Trajectory<3>,
    pub snapshots: Vec<Snapshot>,
    /// Largest resident memory of the process during the steps, in MiB, where the system tells, and unless some of them were stored.
    peak_mib: Option<f64>,
}

impl Surface {
    /// Lets the surface flow, or continues or looks up its run, and measures the steps to be shown.
    pub fn flow(self, case: Case<3>, session: &mut Session) -> Result<Flowed> {
        let n = case.grid().spacing().recip().round();
        let run = format!("{}, {}, n = {n}", self.title, case.operator.label());
        let folder = format!("{}-{}", self.key, case.operator.key());
        let mut samples = Samples::every(usize::MAX);
        samples.also = self.shown.iter().map(|(step, _)| *step).collect();
        memory::release_kept();
        memory::forget_peak();
        let trajectory = session.trajectory(&run, case, &folder, &samples)?;
        let peak_mib = memory::peak_mib().filter(|_| trajectory.is_new);
        let mut flowed = Flowed {
            surface: self,
            trajectory,
            snapshots: Vec::new(),
            peak_mib,
        };
        memory::release_kept();
        let last = flowed.trajectory.steps();
        let steps = samples.also.into_iter().filter(|step| *step < last);
        let steps = steps.chain([last]);
        let measures = format!("{}: measures", flowed.surface.title);
        flowed.snapshots = session.phase(measures, |stage| {
            steps.map(|step| flowed.snapshot(step, stage)).collect()
        })?;
        Ok(flowed)
    }
}

/// The Willmore energy of a phase field with the implicit finite-element step and the mass-matrix norm, up to `2^26` nodes.
pub fn energy_by_elements(
    case: &Case<3>,
    u: impl FnOnce() -> Result<Field<3>>,
) -> Result<Option<f64>> {
    if case.grid().len() > MOST_NODES {
        return Ok(None);
    }
    Ok(Some(case.implicit_elements()?.willmore_energy(&u()?)?))
}

/// How notes of figures say that `w` was measured on this grid: [by elements](energy_by_elements), or by the scheme where there are too many nodes.
pub fn measured(grid: &Grid<3>) -> &'static str {
    if grid.len() > MOST_NODES {
        "as the scheme measures it"
    } else {
        "with the implicit finite-element step"
    }
}

impl Flowed {
    /// Measures the phase field after a step, and writes its isosurface.
    fn snapshot(&self, step: usize, stage: &Stage<'_>) -> Result<Snapshot> {
        let (case, u) = (&self.trajectory.case, self.trajectory.field(step)?);
        let u = Stored::from(u);
        // The isosurface is closed by construction; whoever uses the file relies on it.
        let (mesh, _) = ClosedMesh::new(surfaces::phase_field_surface(&u, case.scales.eps)?)?;
        let file = format!("{}.ply", self.file(step));
        surfaces::write(stage.output.subfolder("meshes")?.path(&file)?, mesh.mesh())?;
        let record = self.trajectory.record(step);
        let first = self.trajectory.records.first();
        let at_start = || first.and_then(Record::energy_at_rest);
        let w_scheme = record.map_or_else(at_start, Record::willmore_energy);
        let measured = record.map_or(&self.trajectory.start, |record| &record.measures);
        let w = energy_by_elements(case, || Ok(u.field()?))?;
        memory::release_kept();
        let mut measures = Numbers::from([
            ("perimeter", measured["perimeter"]),
            ("volume", measured["volume"]),
            ("euler_characteristic", mesh.euler_characteristic() as f64),
        ]);
        measures.extend(w.map(|w| ("w", w)));
        measures.extend(w_scheme.map(|w| ("w_scheme", w)));
        let mut reported = self.surface.shown.iter().filter(|_| !stage.options.quick);
        let reported = reported.find(|(shown, _)| *shown == step);
        Ok(Snapshot {
            step,
            measures,
            paper: reported.and_then(|(_, w)| *w),
            caption: match w.or(w_scheme) {
                Some(w) => format!("step {step}: w = {w:.2}"),
                None => format!("step {step}"),
            },
            tubes: Vec::new(),
        })
    }

    fn file(&self, step: usize) -> String {
        let operator = self.trajectory.case.operator.key();
        format!("{}_{operator}_step{step:03}", self.surface.key)
    }

    pub fn label(&self) -> String {
        self.trajectory.case.operator.label()
    }

    /// Prefix of its metrics: the surface, and the method unless it is the learned operator in the paper's formulation.
    pub fn key(&self) -> String {
        let operator = &self.trajectory.case.operator;
        if operator.discretization == PAPERS {
            self.surface.key.to_owned()
        } else {
            format!("{}.{}", self.surface.key, operator.key())
        }
    }

    /// Pictures of the shown steps with this side in pixels (less in a quick run), all in one framing, each also as a file of its own.
    pub fn pictures(&self, stage: &Stage<'_>, side: u32) -> Result<Vec<Raster>> {
        memory::release_kept();
        let usual = (side, Quality::Standard);
        let (side, quality) = stage.options.either((120, Quality::Draft), usual);
        // Scenes are made twice rather than kept: one takes several times the memory of its phase field.
        let mut points = Vec::new();
        for snapshot in &self.snapshots {
            points.extend(snapshot.tubes.iter().flat_map(|tube| tube.points.clone()));
            let bounds = self.scene(snapshot)?.bounds();
            points.extend((bounds.iter()).flat_map(|bounds| [bounds.lower, bounds.upper]));
        }
        let bounds = BoundingBox::around(points);
        let folder = stage.output.subfolder("pictures")?;
        let picture = |snapshot: &Snapshot| {
            let mut scene = self.scene(snapshot)?.quality(quality);
            if let Some(bounds) = bounds {
                scene = scene.within(bounds);
            }
            let picture = scene.render([side; 2])?;
            picture.write_png(folder.path(&format!("{}.png", self.file(snapshot.step)))?)?;
            Ok(raster(&picture, &snapshot.caption))
        };
        self.snapshots.iter().map(picture).collect()
    }

    fn scene(&self, snapshot: &Snapshot) -> Result<Scene> {
        let case = &self.trajectory.case;
        let u = Stored::from(self.trajectory.field(snapshot.step)?);
        let mut scene = Scene::new(&u, case.scales.eps)?;
        if let Some(region) = &case.region {
            let mask = region.iter().map(f64::from).collect();
            scene = scene.highlight_mask(&Field::from_values(*case.grid(), mask)?, MOVING)?;
        }
        Ok(scene.view(self.surface.view).tubes(snapshot.tubes.clone()))
    }
}

/// A picture as a panel of a figure.
pub fn raster(picture: &Picture, caption: impl Into<String>) -> Raster {
    let size = picture.size().map(|side| side as usize);
    Raster::new(caption, size, picture.pixels())
}

/// Sizes of time steps that are powers of two, for figures.
fn in_words(steps: StepRule) -> String {
    match steps {
        StepRule::Constant(tau) => format!("τ = {}", study::power_of_two(tau)),
        StepRule::Doubling(first) => {
            let first = study::power_of_two(first);
            format!("first step τ = {first}, doubled after every step")
        }
        other => format!("τ = {other}"),
    }
}

impl Setting {
    /// Lets all surfaces flow by all discretizations in so many time steps, and ends the program: writes a figure with a row of pictures for each
    /// run, the table of the shown steps, the records of all steps and the metrics. `remarks` looks at the flows, may add to captions, pictures
    /// and metrics, and says what else the note of the figure should say.
    pub fn run(
        &self,
        mut session: Session,
        title: &str,
        surfaces: &[(Surface, Stored<3>)],
        steps: TimeSteps,
        count: usize,
        remarks: impl FnOnce(&mut Session, &mut [Flowed]) -> Result<String>,
    ) -> Result<()> {
        let mut all = Vec::new();
        for (surface, initial) in surfaces {
            for &discretization in &self.discretizations {
                let mut surface = surface.clone();
                if discretization != PAPERS {
                    // The paper reports energies of its own formulation.
                    surface.shown.iter_mut().for_each(|(_, w)| *w = None);
                }
                let (shape, initial) = (&surface.title, initial.clone());
                let operator = self.operator(discretization)?;
                let case = Case::willmore(shape, initial, operator, self.scales, steps, count);
                all.push(surface.flow(case, &mut session)?);
            }
        }
        write_snapshots(&mut session, &all, "energies", Flowed::key)?;
        let remarks = remarks(&mut session, &mut all)?;
        let pictures = session.phase("pictures", |stage| {
            let pictures = all.iter().map(|one| one.pictures(stage, SIDE));
            pictures.collect::<Result<Vec<_>, _>>()
        })?;
        let columns = pictures.iter().map(Vec::len).max();
        let label = |one: &Flowed| {
            let operator = one.label().replace(", ", "\n");
            format!("{}\n{operator}", one.surface.title)
        };
        let figure = Figure::new(title, columns.unwrap_or(1))
            .with_row_labels(all.iter().map(label))
            .with_panels(pictures.into_iter().flatten())
            .with_note(format!(
                "n = {}, ε = 2/n, inner step 1/n², {}. w: Willmore energy {}; a sphere has 8π = 25.13.{remarks}",
                self.n, in_words(steps.rule), measured(&self.grid)
            ));
        session.figure(figure, "surfaces")?;
        let runs = all.iter().map(|one| (one.surface.key, &one.trajectory));
        step_table::write(&session, "surface", runs)?;
        for one in &all {
            let records = &one.trajectory.records;
            let metrics = [
                ("hvp_per_step", mean_hvp(records).into()),
                ("energy_increases", energy_increases(records).into()),
                ("seconds", one.trajectory.seconds().into()),
            ];
            session.metrics(&one.key(), metrics)?;
        }
        let peak = format!("{}.peak_mib_with_pictures", session.program);
        session.metric(&peak, memory::peak_mib())?;
        session.finish(title)
    }
}

/// Writes the shown steps of all runs, beside the paper's energies. Metrics begin with `key`.
pub fn write_snapshots(
    session: &mut Session,
    all: &[Flowed],
    stem: &str,
    key: impl Fn(&Flowed) -> String,
) -> Result<()> {
    let rows: Vec<(&Flowed, &Snapshot)> = (all.iter())
        .flat_map(|one| one.snapshots.iter().map(move |shown| (one, shown)))
        .collect();
    let sheet = Sheet::of(&rows)
        .keyed(|(one, shown), name| format!("{}.{name}.step{}", key(one), shown.step))
        .text("surface", |(one, _)| one.surface.title.as_str())
        .text("method", |(one, _)| one.label())
        .column("step", Shortest, |(_, shown)| shown.step)
        .numbers(&MEASURES[..1], |(_, shown)| &shown.measures)
        .column("w, paper", Fixed(2), |(_, shown)| shown.paper)
        .columns(&MEASURES[1..], |(_, shown)| &shown.measures);
    session.sheet(sheet, stem)?;
    (all.iter()).try_for_each(|one| session.metric(&format!("{}.peak_mib", key(one)), one.peak_mib))
}
