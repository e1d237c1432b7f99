//! Inpainting of surfaces: Willmore flow of the values in a region, the rest of the surface held.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::inpainting_3d::EXPERIMENT.main()
}
