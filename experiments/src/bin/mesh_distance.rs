//! The signed distance of any mesh on any grid.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::mesh_distance::main()
}
