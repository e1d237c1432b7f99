//! Closed elastic curves: length and area held.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::elastica::program)
}
