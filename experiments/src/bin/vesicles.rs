//! Lipid vesicles: area and volume held.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::vesicles::program)
}
