//! Inpainting in 2D: Willmore flow of the values in a region, the rest of the image held.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::inpainting_2d::program)
}
