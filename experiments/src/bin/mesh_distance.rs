//! The signed distance of any mesh on any grid.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::mesh_distance::EXPERIMENT.main()
}
