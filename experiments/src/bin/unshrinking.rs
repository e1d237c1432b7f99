//! Segmentations without their steps, and their volumes, beside other methods.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::unshrinking::EXPERIMENT.main()
}
