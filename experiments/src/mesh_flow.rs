//! A mesh of the paper under Willmore flow by several schemes.

use geometry::CliffordTorus;
use render::Tube;

use crate::meshes::{self, KnownMesh, MeshOptions};
use crate::prelude::*;
use crate::surfaces::{Flowed, SchemeOptions, Setting, Surface, View, energy_by_elements};

/// A program: a mesh, and how it flows there.
pub struct MeshFlow {
    /// Name of the program, its folder and its metrics.
    program: &'static str,
    about: &'static str,
    mesh: KnownMesh,
    cells: usize,
    steps: usize,
    tau: StepRule,
    /// Steps to be shown, with the energies that the paper reports.
    shown: &'static [(usize, Option<f64>)],
    view: View,
    /// Looks at the flows and says what else the note should say, see [`Setting::run`].
    remarks: fn(&mut Session, &mut [Flowed]) -> Result<String>,
}

pub const ARMADILLO_FLOW: MeshFlow = MeshFlow {
    program: "armadillo",
    about: "Willmore flow of the armadillo, n = 128, eps = 2^-6, tautilde = 2^-14, with tau = 2^-22 doubled after every step: pictures \
            and Willmore energies at steps 0, 1, 8, 11 and 16",
    mesh: meshes::ARMADILLO,
    cells: 128,
    steps: 16,
    tau: StepRule::Doubling(1.0 / 4_194_304.0),
    shown: &[(0, None), (1, None), (8, None), (11, None), (16, None)],
    view: View {
        up: UpAxis::Y,
        azimuth: 205.0,
        elevation: 8.0,
    },
    remarks: |_, _| Ok(String::new()),
};

pub const ROCKER_ARM_FLOW: MeshFlow = MeshFlow {
    program: "rocker_arm",
    about: "Willmore flow of the rocker arm, n = 64, eps = 2^-5, tau = tautilde = 2^-12: pictures and Willmore energies at steps 0, 1 \
            and 20, and the Clifford torus whose phase field is nearest to the last one in L2",
    mesh: KnownMesh {
        file: "rocker-arm.obj",
        title: "rocker arm",
        side_length: 1.0,
        box_side: 1.25,
        procedural: surfaces::samples::lever,
        procedural_title: "built-in lever",
    },
    cells: 64,
    steps: 20,
    tau: StepRule::Constant(1.0 / 4096.0),
    shown: &[(0, Some(276.12)), (1, Some(42.08)), (20, Some(41.46))],
    view: View {
        up: UpAxis::Z,
        azimuth: 20.0,
        elevation: 20.0,
    },
    remarks: clifford_tori,
};

/// What the paper reports for the torus: its distance and its energy.
const PAPERS_L2: f64 = 3.978e-2;
const PAPERS_CLIFFORD: f64 = 41.11;
/// Circles drawn on the torus, and points of each.
const CIRCLES: (usize, usize) = (12, 96);

#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    figure: FigureOptions,

    #[command(flatten)]
    mesh: MeshOptions,

    #[command(flatten)]
    schemes: SchemeOptions,

    /// Number of time steps [default: that of the paper]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,

    /// The axis that points up in the pictures: x, y or z [default: that of the paper's mesh; of another one the usual one of its format, y
    /// in OBJ files, z in PLY and STL files]
    #[arg(long, value_name = "AXIS")]
    up: Option<UpAxis>,
}

pub fn main(flow: &MeshFlow) -> ExitCode {
    harness::named(flow.program, flow.about, |options| flow.run(options))
}

impl MeshFlow {
    fn run(&self, options: &Options) -> Result<()> {
        let run = &options.figure.run;
        let side = options.mesh.box_side(&self.mesh);
        let variants = options.schemes.learned();
        let setting = Setting::new(&options.figure, &variants, [32, self.cells], side)?;
        let (time_steps, more) = self.time_steps(setting.n);
        let steps = (options.steps).unwrap_or(if run.quick { 2 } else { self.steps + more });
        require(steps > 0, "--steps must be at least 1")?;
        let mesh = options.mesh.load(&self.mesh, &setting.grid)?;
        let usual = options.mesh.mesh.as_ref().map(surfaces::usual_up_axis);
        let up = (options.up.or(usual.transpose()?)).unwrap_or(self.view.up);
        let others = json!({ "mesh": mesh.about, "tau": time_steps.rule, "steps": steps });
        let parameters = setting.parameters(others)?;
        let mut session = Session::open(self.program, run, parameters)?;
        let initial = session.phase("signed distance", |stage| {
            mesh.phase_field(setting.grid, setting.scales.eps, &stage.bar)
        })?;
        let energy = |&(step, w): &(usize, Option<f64>)| {
            let step = if step > 1 { step + more } else { step };
            (step, w.filter(|_| mesh.is_papers))
        };
        let surface = Surface {
            key: self.program,
            title: mesh.title.clone(),
            shown: self.shown.iter().map(energy).collect(),
            view: View { up, ..self.view },
        };
        let title = format!("Willmore flow: {}", surface.title);
        let (surfaces, time) = ([(surface, initial)], (time_steps, steps));
        setting.run(session, &title, &surfaces, time, self.remarks)
    }

    /// The steps on `n` cells per unit length, and how many more than the paper's they are. On finer grids a first step that is
    /// shorter by the fourth power of their ratio moves the interface as many cells as the paper's does: doubling steps begin with it, and so many
    /// more lead to the same time; constant steps are made in substeps that begin with it. Where limbs vanish, a later step is too
    /// long for one minimization there, and is made in substeps, too.
    fn time_steps(&self, n: usize) -> (TimeSteps, usize) {
        let halvings = 4.0 * (n as f64 / self.cells as f64).log2();
        let halvings = halvings.round().max(0.0) as usize;
        if halvings == 0 {
            return (self.tau.into(), 0);
        }
        let first = self.tau.size(1) / 2.0_f64.powi(halvings as i32);
        let (rule, more) = match self.tau {
            StepRule::Doubling(_) => (StepRule::Doubling(first), halvings),
            rule => (rule, 0),
        };
        let steps = TimeSteps {
            first_substep: Some(first),
            ..rule.into()
        };
        (steps, more)
    }
}

/// Finds the Clifford torus nearest to the last shape of each run, and draws it there.
fn clifford_tori(session: &mut Session, all: &mut [Flowed]) -> Result<String> {
    let mut tori = BTreeMap::new();
    for one in all {
        let case = &one.trajectory.case;
        let last = one.trajectory.field(one.trajectory.steps())?;
        let title = format!("Clifford torus, {}", one.label());
        let torus = session.phase(title, |_| {
            Ok(CliffordTorus::nearest(&last, case.scales.eps)?)
        })?;
        let as_field = || Ok(torus.phase_field(last.grid(), case.scales.eps)?);
        let w = energy_by_elements(case, as_field)?;
        let (l2, outer_radius) = (torus.l2, torus.outer_radius);
        let papers = match one.snapshots.last().and_then(|last| last.paper) {
            Some(_) => format!(" (paper: distance {PAPERS_L2:.4}, w = {PAPERS_CLIFFORD})"),
            None => String::new(),
        };
        session.remark(format!(
            "Nearest Clifford torus, {}: L2 distance {l2:.4}, outer radius {outer_radius:.3}{}{papers}",
            one.label(),
            w.map_or(String::new(), |w| format!(", w = {w:.2}"))
        ));
        let circles = torus.minor_circles(CIRCLES.0, CIRCLES.1)?.into_iter();
        let tube = |circle: Vec<[f64; 3]>| Tube {
            closed: true,
            ..Tube::new(circle, 0.1 * case.scales.eps)
        };
        if let Some(shown) = one.snapshots.last_mut() {
            let w = w.map_or(String::new(), |w| format!("\n(which has w = {w:.2})"));
            let torus = format!("L² distance to the torus {l2:.4}{w}");
            shown.caption = format!("{}\n{torus}", shown.caption);
            shown.tubes = circles.map(tube).collect();
        }
        let metrics = [
            ("clifford_l2", l2.into()),
            ("clifford_w", w.into()),
            ("clifford_outer_radius", outer_radius.into()),
        ];
        session.metrics(&one.key(), metrics)?;
        tori.insert(one.key(), torus);
    }
    session.output.write_json("clifford.json", &tori)?;
    Ok(" Circles: of the nearest Clifford torus; one has 4π² = 39.48 in the limit.".to_owned())
}
