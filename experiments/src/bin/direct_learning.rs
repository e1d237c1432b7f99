//! What a direct step of Willmore flow misses, and how much of it can be learned.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::direct_learning::EXPERIMENT.main()
}
