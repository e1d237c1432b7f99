//! `willmore`: Willmore flow from the command line.

mod cli;
mod commands;
mod config;
mod error;
mod faired;
mod input;
mod keep;
mod messages;
mod outcome;
mod own;
mod page;
mod paths;
mod plane;
mod prelude;
mod presentation;
mod run;
mod setup;
mod sizes;
mod space;
mod standard;
mod values;
mod volume;

use std::ffi::OsString;

use clap::error::ErrorKind;

use crate::cli::{Cli, Command};
use crate::commands::{check, flow, info, networks, resume, sample, shell, train};
use crate::prelude::*;
use crate::standard::Standard;

const FAILURE: u8 = 2;

fn main() -> ExitCode {
    operators::memory::keep_freed();
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let ended = match config::parse(&arguments) {
        Ok(cli) => execute(cli),
        Err(Error::Typed(error)) => match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                // A closed pipe (`| head`) is no failure.
                let _ = error.print();
                return ExitCode::SUCCESS;
            }
            ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand | ErrorKind::MissingSubcommand => {
                Err(Error::options("there is no command; see willmore --help"))
            }
            _ => Err(Error::options(format!(
                "{}; see --help",
                config::one_line(&error)
            ))),
        },
        Err(error) => Err(error),
    };
    ended.unwrap_or_else(|error| {
        eprintln!("error: {}", files::with_causes(&error));
        ExitCode::from(FAILURE)
    })
}

fn execute(mut cli: Cli) -> Result<ExitCode, Error> {
    let standard = Standard::open(&mut cli.command, &mut cli.messages)?;
    let messages = cli.messages;
    let code = match cli.command {
        Command::Run(command) => flow::run(command, messages, None),
        Command::Resume(options) => resume::run(&options, messages),
        Command::Networks { show } => networks::run(show.as_ref(), messages),
        Command::Info => info::run(messages),
        Command::Sample(options) => sample::run(options, messages),
        Command::Check(options) => check::run(options, messages),
        Command::Train(options) => train::run(options, messages),
        Command::Completions { shell } => Ok(shell::completions(shell)),
        Command::Man => shell::man(),
    }?;
    standard.write()?;
    Ok(code)
}
