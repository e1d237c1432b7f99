use crate::mesh_flow::{MeshFlow, MeshFlowOptions};
use crate::meshes::ARMADILLO;
use crate::prelude::*;
use crate::surfaces::View;

const ARMADILLO_FLOW: MeshFlow = MeshFlow {
    program: "armadillo",
    mesh: ARMADILLO,
    cells: 128,
    steps: 16,
    tau: StepRule::Doubling(1.0 / 4_194_304.0),
    shown: &[(0, None), (1, None), (8, None), (11, None), (16, None)],
    view: View {
        up: UpAxis::Y,
        azimuth: 205.0,
        elevation: 8.0,
    },
};

/// Willmore flow of the armadillo, n = 128, eps = 2^-6, tautilde = 2^-14, with tau = 2^-22 doubled after every step: pictures and
/// Willmore energies at steps 0, 1, 8, 11 and 16.
#[derive(Parser, Debug)]
#[command(name = ARMADILLO_FLOW.program, version)]
pub struct Options {
    #[command(flatten)]
    flow: MeshFlowOptions,
}

pub fn program(options: &Options) -> Result<()> {
    ARMADILLO_FLOW.run(&options.flow, |_, _| Ok(String::new()))
}
