//! Options from files, and resolved options as files.
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

use jobs::settings::COMMAND;

use crate::cli::Cli;
use crate::error::{Error, Result, refuse};
use crate::spelling::spelled;

/// Longest configuration file, in bytes; all options take some thousand.
const LONGEST: usize = 1 << 16;

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
        return parse_both(arguments, command, typed, &text, file);
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
    let mut table = read(text, path)?;
    if typed.try_contains_id("input").unwrap_or(false) {
        table.remove("input");
    }
    with_table(arguments, command, &table, path)
}

/// The options that a run was started with.
pub fn parse_resolved(text: &str, path: &Path) -> Result<Cli> {
    let table = read(text, path)?;
    let Some(Value::String(command)) = table.get(COMMAND) else {
        return Err(bad(path, "it does not say which command it is for"));
    };
    if program().find_subcommand(command).is_none() {
        return Err(bad(path, format!("{command:?} is no command")));
    }
    with_table(&["willmore".into(), command.into()], command, &table, path)
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

fn read(text: &str, path: &Path) -> Result<Table> {
    if text.len() > LONGEST {
        let most = format!("a configuration has at most {LONGEST} bytes");
        return Err(bad(path, most));
    }
    text.parse::<Table>().map_err(|error| {
        let before = error.span().map_or("", |span| &text[..span.start]);
        let line = 1 + before.matches('\n').count();
        bad(path, format!("line {line}: {}", error.message()))
    })
}

/// The entries of a file as they would be typed.
fn as_typed(table: &Table, command: &str, path: &Path) -> Result<Vec<OsString>> {
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let mut arguments = Vec::new();
    for (name, value) in table {
        let typed = match (&**name, value) {
            (COMMAND, Value::String(of)) if of == command => continue,
            (COMMAND, of) => Err(format!("it is for the command {of}, not for {command}")),
            ("config", _) => Err("a configuration cannot name another one".to_owned()),
            ("" | "help" | "version", _) => Err(format!("{name:?} is no option")),
            _ if !name.chars().all(is_name) => Err(format!("{name:?} is no option")),
            (_, Value::Boolean(false)) => continue,
            (_, Value::Boolean(true)) => Ok(format!("--{name}")),
            ("input", Value::String(text)) if text.starts_with('-') => Err(format!(
                "the input {text:?} looks like an option: put ./ before it"
            )),
            ("input", Value::String(text)) => Ok(text.clone()),
            (_, Value::String(text)) => Ok(format!("--{name}={text}")),
            (_, Value::Integer(number)) => Ok(format!("--{name}={number}")),
            (_, Value::Float(number)) => Ok(format!("--{name}={number}")),
            _ => Err(format!("{name} must be a number, a text, true or false")),
        };
        arguments.push(typed.map_err(|message| bad(path, message))?.into());
    }
    Ok(arguments)
}
