//! `willmore`: Willmore flow from the command line.

use std::ffi::OsString;
use std::process::ExitCode;

use operators::memory::{self, OrRefuse};
use willmore_cli::Console;

#[global_allocator]
static MEMORY: OrRefuse = OrRefuse;

fn main() -> ExitCode {
    memory::keep_freed();
    let arguments: Vec<OsString> = std::env::args_os().collect();
    ExitCode::from(willmore_cli::main(&arguments, Console::standard()))
}
