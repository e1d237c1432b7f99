//! The factors by which the hybrid scheme differs from Willmore flow, predicted and measured on discs.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::calibration::main()
}
