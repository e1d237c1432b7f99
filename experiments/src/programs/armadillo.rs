use crate::mesh_flow::MeshFlow;
use crate::meshes;
use crate::prelude::*;
use crate::surfaces::{METRICS, View};

pub const EXPERIMENT: Experiment = Experiment {
    name: "armadillo",
    summary: "A scanned figure under Willmore flow with time steps that double.",
    program: |own| FLOW.run(own),
    quick: Some(&["--procedural"]),
    results: &[
        ResultFolder {
            name: "armadillo",
            title: "Armadillo",
            description: "Willmore flow of a scanned figure, with time steps that double.",
            figures: &[(
                "surfaces",
                "From the scanned figure to a nearly round sphere.",
            )],
            options: Some(""),
        },
        ResultFolder {
            name: "armadillo_n256",
            title: "Armadillo, twice as fine",
            description: "Not in the paper: the same flow on twice as fine a grid, by the accurate operator on bricks near the \
                 surface, each step in substeps.",
            figures: &[(
                "surfaces",
                "From the scanned figure to a nearly round sphere.",
            )],
            options: Some("--cells 256 --scheme accurate"),
        },
        ResultFolder {
            name: "armadillo_n512",
            title: "Armadillo, four times as fine",
            description: "Not in the paper: the beginning of the flow on four times as fine a grid, by the accurate operator \
                 on bricks near the surface.",
            figures: &[("surfaces", "The scanned figure, and how it becomes smooth.")],
            options: Some("--cells 512 --scheme accurate --steps 10"),
        },
    ],
    metrics: &[&METRICS],
    words: &[("SURFACE", "`armadillo`")],
};

const FLOW: MeshFlow = MeshFlow {
    program: EXPERIMENT.name,
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
