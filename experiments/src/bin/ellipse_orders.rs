//! The order of convergence of Willmore flow of an ellipse in h and in tau, against its own finest run.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::ellipse_orders::main()
}
