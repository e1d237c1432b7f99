//! Closed elastic curves: length and area held.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::elastica::main()
}
