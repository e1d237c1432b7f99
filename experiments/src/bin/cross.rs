//! The cross under Willmore flow.

fn main() -> std::process::ExitCode {
    experiments::comparison::main(&experiments::comparison::CROSS)
}
