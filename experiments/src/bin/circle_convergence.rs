//! Convergence test on circles: mean curvature flow and Willmore flow against the exact solutions.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::circle_convergence::EXPERIMENT.main()
}
