//! Closed elastic curves: length and area held.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::elastica::EXPERIMENT.main()
}
