//! Errors of the time steps against the exact flow, and what they cost.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::work_precision::main()
}
