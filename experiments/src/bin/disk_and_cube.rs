//! A cube and a thick disk under Willmore flow.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::disk_and_cube::main()
}
