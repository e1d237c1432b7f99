//! What `willmore fair` makes of public test meshes as they come.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::public_meshes::EXPERIMENT.main()
}
