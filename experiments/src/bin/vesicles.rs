//! Lipid vesicles: area and volume held.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::vesicles::EXPERIMENT.main()
}
