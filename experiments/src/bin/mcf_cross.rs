//! The cross under mean curvature flow.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::mcf_cross::EXPERIMENT.main()
}
