//! The order of convergence of Willmore flow of an ellipse in h and in tau, against its own finest run.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::ellipse_orders::EXPERIMENT.main()
}
