//! Inpainting in 2D: Willmore flow of the values in a region, the rest of the image held.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::inpainting_2d::EXPERIMENT.main()
}
