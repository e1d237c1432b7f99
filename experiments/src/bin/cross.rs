//! The cross under Willmore flow.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::cross::main()
}
