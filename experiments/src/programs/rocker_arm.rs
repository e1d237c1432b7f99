use geometry::CliffordTorus;
use render::Tube;

use crate::mesh_flow::MeshFlow;
use crate::meshes::KnownMesh;
use crate::prelude::*;
use crate::surfaces::{Flowed, METRICS, View, energy_by_elements};

pub const EXPERIMENT: Experiment = Experiment {
    name: "rocker_arm",
    summary: "A machine part of genus one under Willmore flow, and the Clifford torus next to it.",
    program: |own| FLOW.run(own),
    quick: Some(&["--procedural"]),
    results: &[
        ResultFolder {
            name: "rocker_arm",
            title: "Rocker arm",
            description: "Willmore flow of a machine part of genus one, and the Clifford torus next to where it ends.",
            figures: FIGURES,
            options: Some(""),
        },
        ResultFolder {
            name: "rocker_arm_n256",
            title: "Rocker arm, four times as fine",
            description: "Not in the paper: the same on four times as fine a grid, by the accurate operator on bricks near the \
                 surface.",
            figures: FIGURES,
            options: Some("--cells 256 --scheme accurate"),
        },
    ],
    metrics: &[&METRICS],
    words: &[("SURFACE", "`rocker_arm`")],
};

const FIGURES: Figures = &[(
    "surfaces",
    "The part, the first and the last step, and the nearest Clifford torus.",
)];

const FLOW: MeshFlow = MeshFlow {
    program: EXPERIMENT.name,
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
