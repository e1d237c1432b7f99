//! Noise taken off meshes by Willmore flow, by Taubin's smoothing and by Laplacian smoothing.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::denoising::main()
}
