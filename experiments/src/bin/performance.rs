//! What a time step costs, and where the time goes.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::performance::EXPERIMENT.main()
}
