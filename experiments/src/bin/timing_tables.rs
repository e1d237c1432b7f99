//! Time of the methods for the same flow on the same machine.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::timing_tables::program)
}
