//! A scanned figure under Willmore flow with time steps that double.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::armadillo::EXPERIMENT.main()
}
