//! What a time step costs, and where the time goes.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::performance::program)
}
