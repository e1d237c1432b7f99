//! Steps of Willmore flow without a minimization, against the exact flow and other steps.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::direct_step::EXPERIMENT.main()
}
