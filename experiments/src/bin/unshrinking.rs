//! Segmentations without their steps, and their volumes.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::unshrinking::main()
}
