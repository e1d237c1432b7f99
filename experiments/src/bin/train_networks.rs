//! Trains the networks that ship with the library.

fn main() -> std::process::ExitCode {
    experiments::harness::main(experiments::programs::train_networks::program)
}
