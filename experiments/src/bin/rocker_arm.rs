//! A machine part of genus one under Willmore flow, and the Clifford torus next to it.

use std::process::ExitCode;

use clap::Parser;
use experiments::clifford::CliffordFit;
use experiments::evolution::TimeSteps;
use experiments::mesh_flow::{Extras, MeshFlow, MeshFlowOptions};
use experiments::meshes::KnownMesh;
use experiments::surfaces::{Finished, View};
use experiments::{Error, harness};
use fem::FiniteElementStep;
use geometry::UpAxis;
use render::Tube;
use report::Manifest;

const ROCKER_ARM: KnownMesh = KnownMesh {
    file: "rocker-arm.obj",
    title: "rocker arm",
    side_length: 1.0,
    box_side: 1.25,
    procedural: surfaces::samples::lever,
    procedural_title: "built-in lever",
};
const ROCKER_ARM_FLOW: MeshFlow = MeshFlow {
    program: "rocker_arm",
    mesh: &ROCKER_ARM,
    cells: 64,
    steps: 20,
    tau: TimeSteps::Constant(1.0 / 4096.0),
    tau_in_words: "τ = 2⁻¹²",
    shown: &[(0, Some(276.12)), (1, Some(42.08)), (20, Some(41.46))],
    view: View {
        up: UpAxis::Z,
        azimuth: 20.0,
        elevation: 20.0,
    },
};
/// What the paper reports for the torus: its distance and its energy.
const PAPERS_L2: f64 = 3.978e-2;
const PAPERS_CLIFFORD: f64 = 41.11;
/// Circles drawn on the torus, and points of each.
const CIRCLES: (usize, usize) = (12, 96);

/// Willmore flow of the rocker arm, n = 64, eps = 2^-5, tau = tautilde = 2^-12: pictures and Willmore energies at steps 0, 1 and 20,
/// and the Clifford torus whose phase field is nearest to the last one in L2.
///
/// Steps are kept in the folder `fields` of the output; an interrupted run continues.
#[derive(Parser, Debug)]
#[command(name = ROCKER_ARM_FLOW.program, version)]
struct Options {
    #[command(flatten)]
    flow: MeshFlowOptions,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| ROCKER_ARM_FLOW.run(&options.flow, clifford))
}

/// The Clifford torus nearest to a surface.
struct Torus {
    fit: CliffordFit,
    /// Its energy, measured as that of the surface.
    w: f64,
    /// The step that it belongs to.
    step: usize,
    circles: Vec<Vec<[f64; 3]>>,
    radius: f64,
}

impl Torus {
    fn next_to(one: &Finished<'_>) -> Result<Self, Error> {
        let params = one.trajectory.evolution.params;
        let step = one.run.steps;
        let last = one.trajectory.field(step)?;
        let fit = CliffordFit::to(&last, params.eps)?;
        let measure = FiniteElementStep::implicit(last.grid(), params.eps, params.mcf_step)?;
        Ok(Self {
            w: measure.willmore_energy(&fit.phase_field(&last, params.eps)?)?,
            circles: fit.minor_circles(CIRCLES.0, CIRCLES.1)?,
            fit,
            step,
            radius: 0.1 * params.eps,
        })
    }
}

fn clifford<'a>(
    finished: &'a [Finished<'a>],
    manifest: &mut Manifest,
) -> Result<Extras<'a>, Error> {
    let tori = manifest.phase("Clifford tori", || {
        finished
            .iter()
            .map(Torus::next_to)
            .collect::<Result<Vec<_>, Error>>()
    })?;
    let mut extras = Extras {
        note: " Circles: of the nearest Clifford torus; one has 4π² = 39.48 in the limit."
            .to_owned(),
        ..Extras::default()
    };
    let (mut fits, mut lines_of_report) = (Vec::new(), Vec::new());
    for (one, torus) in finished.iter().zip(&tori) {
        let key = one.key();
        for (name, value) in [
            ("clifford_l2", torus.fit.l2),
            ("clifford_w", torus.w),
            ("clifford_outer_radius", torus.fit.outer_radius),
        ] {
            extras.metrics.push((format!("{key}.{name}"), value));
        }
        lines_of_report.push(format!(
            "\nNearest Clifford torus, {}: L2 distance {:.4} (paper {PAPERS_L2:.4}), outer radius {:.3}, w = {:.2} (paper \
             {PAPERS_CLIFFORD})",
            one.run.label(),
            torus.fit.l2,
            torus.fit.outer_radius,
            torus.w
        ));
        fits.push((one.key(), &torus.fit));
    }
    extras.report = lines_of_report.concat();
    let by_name: std::collections::BTreeMap<_, _> = fits.into_iter().collect();
    (extras.files).push(("clifford.json", report::data::to_json(&by_name)?));
    let lines: Vec<(usize, String)> = (tori.iter())
        .map(|torus| {
            let line = format!(
                "\nL² distance to the torus {:.4}\n(which has w = {:.2})",
                torus.fit.l2, torus.w
            );
            (torus.step, line)
        })
        .collect();
    extras.caption = Box::new(move |run, shown| {
        let (step, line) = &lines[run];
        if *step == shown.step {
            line.clone()
        } else {
            String::new()
        }
    });
    extras.tubes = Box::new(move |run, step| {
        let torus = &tori[run];
        let drawn = torus.circles.iter().filter(|_| step == torus.step);
        drawn
            .map(|circle| Tube::new(circle.clone(), torus.radius).closed())
            .collect()
    });
    Ok(extras)
}
