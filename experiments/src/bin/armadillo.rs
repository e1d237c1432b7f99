//! A scanned figure under Willmore flow with time steps that double.

fn main() -> std::process::ExitCode {
    experiments::mesh_flow::main(&experiments::mesh_flow::ARMADILLO_FLOW)
}
