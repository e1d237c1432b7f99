//! The signed distance of any mesh on any grid.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::mesh_distance::program)
}
