//! A cube and a thick disk under Willmore flow.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::disk_and_cube::EXPERIMENT.main()
}
