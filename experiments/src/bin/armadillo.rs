//! A scanned figure under Willmore flow with time steps that double.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::armadillo::main()
}
