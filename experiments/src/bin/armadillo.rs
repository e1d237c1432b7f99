//! A scanned figure under Willmore flow with time steps that double.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::armadillo::program)
}
