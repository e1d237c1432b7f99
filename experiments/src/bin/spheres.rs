//! Spheres by the network for surfaces: mean curvature flow, Willmore energies, and standing still.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::spheres::EXPERIMENT.main()
}
