//! A machine part of genus one under Willmore flow, and the Clifford torus next to it.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::rocker_arm::program)
}
