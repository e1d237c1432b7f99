//! The order of convergence of Willmore flow of an ellipse in h and in tau, against its own finest run.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::ellipse_orders::program)
}
