//! `willmore`: Willmore flow from the command line.

use std::ffi::OsString;
use std::process::ExitCode;

use willmore_cli::Console;

fn main() -> ExitCode {
    operators::memory::keep_freed();
    let arguments: Vec<OsString> = std::env::args_os().collect();
    ExitCode::from(willmore_cli::main(&arguments, Console::standard()))
}
