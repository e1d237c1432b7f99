//! Noise taken off meshes by Willmore flow, by Taubin's smoothing and by Laplacian smoothing.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::denoising::program)
}
