//! The factors by which the hybrid scheme differs from Willmore flow, predicted and measured on discs.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::calibration::EXPERIMENT.main()
}
