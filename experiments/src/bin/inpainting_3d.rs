//! Inpainting of surfaces: Willmore flow of the values in a region, the rest of the surface held.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::inpainting_3d::main()
}
