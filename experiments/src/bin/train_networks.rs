//! Trains the networks that ship with the library.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::train_networks::EXPERIMENT.main()
}
