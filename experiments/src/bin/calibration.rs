//! The factors by which the hybrid scheme differs from Willmore flow, predicted and measured on discs.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::calibration::program)
}
