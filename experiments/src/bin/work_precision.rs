//! Errors of the time steps against the exact flow, and what they cost.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::work_precision::EXPERIMENT.main()
}
