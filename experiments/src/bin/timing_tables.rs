//! Time of the methods for the same flow on the same machine.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::timing_tables::EXPERIMENT.main()
}
