//! A cube and a thick disk under Willmore flow.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::disk_and_cube::program)
}
