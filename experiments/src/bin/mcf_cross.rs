//! The cross under mean curvature flow.

fn main() -> std::process::ExitCode {
    experiments::comparison::main(&experiments::comparison::MCF_CROSS)
}
