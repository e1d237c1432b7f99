//! `willmore`: Willmore flow from the command line.

mod case;
mod cli;
mod commands;
mod config;
mod error;
mod faired;
mod input;
mod keep;
mod outcome;
mod own;
mod page;
mod paths;
mod plane;
mod prelude;
mod presentation;
mod run;
mod space;
mod standard;
mod values;
mod volume;
mod words;

use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

use crate::cli::{Cli, Command, write_out};
use crate::commands::{about, check, flow, resume, sample, train};
use crate::prelude::*;
use crate::standard::Standard;

const FAILURE: u8 = 2;

fn main() -> ExitCode {
    operators::memory::keep_freed();
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let done = match config::parse(&arguments).and_then(execute) {
        Err(Error::Help(help)) => write_out(help.to_string().as_bytes()),
        done => done,
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(Error::Interrupted | Error::Model(model::Error::Interrupted { .. })) => {
            ExitCode::from(Interrupt::EXIT_CODE)
        }
        Err(error) => {
            // A closed pipe hides the message, and not the failure.
            let _ = writeln!(std::io::stderr(), "error: {}", files::with_causes(&error));
            ExitCode::from(FAILURE)
        }
    }
}

fn execute(mut cli: Cli) -> Result<()> {
    let standard = Standard::open(&mut cli.command, &mut cli.messages)?;
    let messages = cli.messages;
    match cli.command {
        Command::Run(command) => flow::run(command, messages, None),
        Command::Resume(options) => resume::run(&options, messages),
        Command::Networks { show } => about::networks(show.as_ref(), messages),
        Command::Info => about::info(messages),
        Command::Sample(options) => sample::run(options, messages),
        Command::Check(options) => check::run(options, messages),
        Command::Train(options) => train::run(options, messages),
        Command::Completions { shell } => about::completions(shell),
        Command::Man => about::man(),
    }?;
    standard.write()
}
