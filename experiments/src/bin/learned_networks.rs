//! Pictures and quality of the learned 2D operators.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::learned_networks::main()
}
