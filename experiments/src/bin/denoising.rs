//! Noise taken off meshes by Willmore flow, by Taubin's and Laplacian smoothing, by MeshLib and by filtered normals.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::denoising::EXPERIMENT.main()
}
