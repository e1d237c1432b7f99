//! A machine part of genus one under Willmore flow, and the Clifford torus next to it.

fn main() -> std::process::ExitCode {
    experiments::mesh_flow::main(&experiments::mesh_flow::ROCKER_ARM_FLOW)
}
