//! The cross under mean curvature flow.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::mcf_cross::main()
}
