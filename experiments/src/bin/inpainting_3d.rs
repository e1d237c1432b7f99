//! Inpainting of surfaces: Willmore flow of the values in a region, the rest of the surface held.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::inpainting_3d::program)
}
