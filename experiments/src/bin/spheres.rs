//! Spheres by the network for surfaces: mean curvature flow, Willmore energies, and standing still.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::spheres::program)
}
