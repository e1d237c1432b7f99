//! Pictures and quality of the learned 2D operators.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::learned_networks::EXPERIMENT.main()
}
