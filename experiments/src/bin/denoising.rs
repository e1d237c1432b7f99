//! Noise taken off meshes by Willmore flow, by Taubin's smoothing and by Laplacian smoothing.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::denoising::EXPERIMENT.main()
}
