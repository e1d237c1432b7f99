//! A machine part of genus one under Willmore flow, and the Clifford torus next to it.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::rocker_arm::EXPERIMENT.main()
}
