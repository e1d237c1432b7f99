//! Segmentations without their steps, and their volumes.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::unshrinking::program)
}
