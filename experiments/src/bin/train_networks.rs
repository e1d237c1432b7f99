//! Trains the networks that ship with the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    experiments::programs::train_networks::main()
}
