//! Pictures and quality of the learned 2D operators.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::learned_networks::program)
}
