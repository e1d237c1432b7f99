//! Spheres by the network for surfaces: mean curvature flow, Willmore energies, and standing still.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::spheres::main()
}
