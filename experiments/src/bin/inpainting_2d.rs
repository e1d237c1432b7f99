//! Inpainting in 2D: Willmore flow of the values in a region, the rest of the image held.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::inpainting_2d::main()
}
