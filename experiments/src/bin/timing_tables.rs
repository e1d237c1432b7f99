//! Time of the methods for the same flow on the same machine.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::timing_tables::main()
}
