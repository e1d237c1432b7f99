//! The program `willmore`: what it takes, and what it prints. [`jobs`] does the work.

mod cli;
mod commands;
mod config;
mod console;
mod error;
mod spelling;
mod standard;

use std::ffi::OsString;

use runs::Interrupt;

use crate::cli::{Cli, Command};
use crate::commands::{about, check, resume, run, sample, train};
pub use crate::console::Console;
use crate::error::{Error, Result};
use crate::standard::Standard;

const FAILURE: u8 = 2;

/// Does as the arguments say, the first of which is the name of the program, and returns the exit code.
pub fn main(arguments: &[OsString], mut console: Console) -> u8 {
    let done = match config::parse(arguments).and_then(|cli| execute(cli, &mut console)) {
        Err(Error::Help(help)) => console.write(help.to_string().as_bytes()),
        done => done,
    };
    console.end();
    match done {
        Ok(()) => 0,
        Err(Error::Interrupted) => Interrupt::EXIT_CODE,
        Err(error) => {
            console.fail(&files::with_causes(&error));
            FAILURE
        }
    }
}

fn execute(mut cli: Cli, console: &mut Console) -> Result<()> {
    let standard = Standard::open(&mut cli.command, cli.messages)?;
    console.set(
        cli.messages,
        standard.output().is_some(),
        standard.aliases(),
    );
    match cli.command {
        Command::Run(command) => run::run(command.job(), standard.output(), console),
        Command::Resume(options) => resume::run(&options, console),
        Command::Networks { show } => about::networks(show.as_ref(), console),
        Command::Info => about::info(console),
        Command::Sample(options) => sample::run(options, console),
        Command::Check(check) => check::run(check.options, console),
        Command::Train(train) => train::run(train.options, console),
        Command::Completions { shell } => about::completions(shell, console),
        Command::Man => about::man(console),
    }?;
    standard.write(console)
}
