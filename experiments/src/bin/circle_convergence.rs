//! Convergence test on circles: mean curvature flow and Willmore flow against the exact solutions.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::circle_convergence::main()
}
