//! The rectangle under Willmore flow.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::rectangle::main()
}
