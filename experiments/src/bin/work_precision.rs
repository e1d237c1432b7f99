//! Errors of the time steps against the exact flow, and what they cost.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::work_precision::program)
}
