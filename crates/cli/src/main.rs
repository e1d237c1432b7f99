//! `willmore`: Willmore flow from the command line.

mod cli;
mod commands;
mod config;
mod error;
mod input;
mod motion;
mod outlet;
mod page;
mod run;
mod scales;
mod shape;
mod signs;
mod tau;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::ErrorKind;
use runs::Interrupt;

use crate::cli::{Cli, Command};
use crate::commands::{check, flow, info, mcf, networks, resume, sample, shell, train};
use crate::config::ParseError;
use crate::error::Error;
use crate::run::Ending;

/// Bad input, or failure.
const FAILURE: u8 = 2;

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let ended = match config::parse(&arguments) {
        Ok(cli) => execute(cli),
        Err(ParseError::Other(error)) => Err(error),
        Err(ParseError::Clap(error)) => match error.kind() {
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
    };
    match ended {
        Ok(Ending::Done) => ExitCode::SUCCESS,
        Ok(Ending::Interrupted) => ExitCode::from(Interrupt::EXIT_CODE),
        Err(error) => {
            eprintln!("error: {}", error.line());
            ExitCode::from(FAILURE)
        }
    }
}

fn execute(cli: Cli) -> Result<Ending, Error> {
    match cli.command {
        Command::Flow(options) => flow::run(options, None),
        Command::Fair(options) => flow::run(options, None),
        Command::Inpaint(options) => flow::run(options, None),
        Command::Mcf(options) => mcf::run(options, None),
        Command::Resume(options) => resume::run(&options),
        Command::Networks(options) => networks::run(&options),
        Command::Info(options) => info::run(&options),
        Command::Sample(options) => sample::run(&options),
        Command::Check(options) => check::run(options),
        Command::Train(options) => train::run(&options),
        Command::Completions { shell } => Ok(shell::completions(shell)),
        Command::Man => shell::man(),
    }
}
