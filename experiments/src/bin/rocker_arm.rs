//! A machine part of genus one under Willmore flow, and the Clifford torus next to it.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::rocker_arm::main()
}
