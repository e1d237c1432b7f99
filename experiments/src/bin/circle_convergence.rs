//! Convergence test on circles: mean curvature flow and Willmore flow against the exact solutions.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::circle_convergence::program)
}
