//! Options from files.
//!
//! A file has a line `name = value` for every option, named as on the command line; `input` is the input. What it says is put
//! before what was typed and parsed in the same way, so that both accept the same and refuse the same.
//!
//! Memory: a file has at most 64 KiB, and takes at most 16 MiB while it is parsed.

#[cfg(test)]
#[path = "../tests/configurations.rs"]
mod fuzzing;

use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use clap::{ArgMatches, CommandFactory, FromArgMatches};
use toml::{Table, Value};

use jobs::settings::{COMMAND, INPUT, LONGEST, option, parse as parse_table};

use crate::cli::Cli;
use crate::error::{Error, Result, refuse};
use crate::spelling::spelled;

/// Of other options the last one counts; a second one of these might be meant to add to the first.
const ALONE: [&str; 3] = ["--keep", "--mask", "--label"];

/// The program's options, with a help that spells them as they are typed. Negative numbers are values, to be refused for what they are.
pub fn program() -> clap::Command {
    Cli::command().mut_subcommands(|command| {
        let command = command
            .allow_negative_numbers(true)
            .mut_args(with_spelled_help);
        match command.get_after_help().map(ToString::to_string) {
            Some(text) => command.after_help(spelled(&text)),
            None => command,
        }
    })
}

/// The help of an argument of the library, which has names of options in backticks.
fn with_spelled_help(mut argument: clap::Arg) -> clap::Arg {
    if let Some(text) = argument.get_help().map(ToString::to_string) {
        argument = argument.help(spelled(&text));
    }
    if let Some(text) = argument.get_long_help().map(ToString::to_string) {
        argument = argument.long_help(spelled(&text));
    }
    argument
}

/// What was typed, together with the configuration file it names.
pub fn parse(arguments: &[OsString]) -> Result<Cli> {
    for name in ALONE {
        let is_given = |argument: &&OsString| {
            let argument = argument.to_string_lossy();
            argument.split('=').next() == Some(name)
        };
        if arguments.iter().filter(is_given).count() > 1 {
            refuse!("{name} is given twice, and only the last one would count: give one");
        }
    }
    let matches = program().try_get_matches_from(arguments)?;
    if let Some((command, typed)) = matches.subcommand()
        && let Ok(Some(file)) = typed.try_get_one::<PathBuf>("config")
    {
        let mut text = String::new();
        // One more than accepted, of what may never end.
        let opened = File::open(file).map(|opened| opened.take(LONGEST as u64 + 1));
        let read = opened.and_then(|mut opened| opened.read_to_string(&mut text));
        read.map_err(files::Error::of("read", file))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        return parse_both(arguments, command, typed, text, file);
    }
    Ok(Cli::from_arg_matches(&matches)?)
}

/// The options of a file, and what was typed, which overrides them.
fn parse_both(
    arguments: &[OsString],
    command: &str,
    typed: &ArgMatches,
    text: &str,
    path: &Path,
) -> Result<Cli> {
    let mut table = parse_table(text, path)?;
    if typed.try_contains_id("input").unwrap_or(false) {
        table.remove(INPUT);
    }
    with_table(arguments, command, &table, path)
}

/// Puts the entries of a file behind the command.
fn with_table(arguments: &[OsString], command: &str, table: &Table, path: &Path) -> Result<Cli> {
    let place = arguments.iter().position(|argument| argument == command);
    let place = place.map_or(arguments.len(), |place| place + 1);
    let mut all = arguments.to_vec();
    all.splice(place..place, as_typed(table, command, path)?);
    let parsed = program()
        .try_get_matches_from(all)
        .and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.map_err(|error| bad(path, jobs::one_line(&error)))
}

fn bad(path: &Path, message: impl AsRef<str>) -> Error {
    let message = files::shortened(message.as_ref(), 400);
    Error::Options(format!("{}: {message}", path.display()))
}

/// The entries of a file as they would be typed.
fn as_typed(table: &Table, command: &str, path: &Path) -> Result<Vec<OsString>> {
    let mut arguments = Vec::new();
    for (name, value) in table {
        let typed = match (&**name, value) {
            (COMMAND, Value::String(of)) if of == command => continue,
            (COMMAND, of) => Err(format!("it is for the command {of}, not for {command}")),
            ("config", _) => Err("a configuration cannot name another one".to_owned()),
            (INPUT, Value::String(text)) if text.starts_with('-') => Err(format!(
                "the input {text:?} looks like an option: put ./ before it"
            )),
            (INPUT, Value::String(text)) => Ok(text.clone()),
            _ => match option(name, value) {
                Ok(None) => continue,
                Ok(Some((name, None))) => Ok(format!("--{name}")),
                Ok(Some((name, Some(value)))) => Ok(format!("--{name}={value}")),
                Err(problem) => Err(problem),
            },
        };
        arguments.push(typed.map_err(|message| bad(path, message))?.into());
    }
    Ok(arguments)
}
