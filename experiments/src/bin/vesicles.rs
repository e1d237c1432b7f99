//! Lipid vesicles: area and volume held.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::vesicles::main()
}
