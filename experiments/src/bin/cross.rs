//! The cross under Willmore flow.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::cross::EXPERIMENT.main()
}
