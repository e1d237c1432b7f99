//! What a time step costs, and where the time goes.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::performance::main()
}
