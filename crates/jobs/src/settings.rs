//! The options of a run, resolved, as a file in its folder.

use toml::{Table, Value};

use crate::job::Job;
use crate::prelude::{Error, Path, Result, StoredRun};

/// The file of all options, resolved, in the folder of a run.
pub const FILE: &str = "config.toml";
/// The entry that names the job.
pub const COMMAND: &str = "command";
/// The entry of the input.
pub const INPUT: &str = "input";
/// Longest file of options, in bytes; all options take some thousand. One of this length takes at most 16 MiB while it is parsed.
pub const LONGEST: usize = 1 << 16;

/// All options of a job as the text of the [file](FILE).
///
/// # Errors
/// Options that TOML cannot hold, such as paths that are no text.
pub fn resolved(job: &Job) -> Result<String> {
    let options = toml::to_string(job).map_err(Error::UnwritableOptions)?;
    Ok(format!("{COMMAND} = {:?}\n{options}", job.name()))
}

/// The job of a stored run, with the options that it was started with.
///
/// # Errors
/// [`Error::Settings`]: a file that is damaged.
pub fn job_of(stored: &StoredRun) -> Result<Job> {
    job(&stored.read_text(FILE)?, &stored.path().join(FILE))
}

/// The job with the options of a text; `path` is that of its file.
///
/// # Errors
/// [`Error::Settings`]
pub fn job(text: &str, path: &Path) -> Result<Job> {
    let bad = |problem: &str| Error::settings(path, problem);
    let mut table = parse(text, path)?;
    let Some(Value::String(command)) = table.remove(COMMAND) else {
        return Err(bad("it does not say which command it is for"));
    };
    let input = match table.remove(INPUT) {
        None => None,
        Some(Value::String(input)) => Some(input.into()),
        Some(_) => return Err(bad("input must be a text")),
    };
    let mut named = Vec::new();
    for (name, value) in &table {
        named.extend(option(name, value).map_err(|problem| bad(&problem))?);
    }
    let named = named.iter().map(|(name, value)| (&**name, value.clone()));
    let job = Job::of_named(&command, named);
    let mut job = job.map_err(|error| match error {
        Error::NoJob(command) => bad(&format!("{command:?} is no command")),
        error => bad(&error.to_string()),
    })?;
    job.input().input = input;
    Ok(job)
}

/// The entries of a file of options.
///
/// # Errors
/// [`Error::Settings`]: a text that is too long, or no TOML.
pub fn parse(text: &str, path: &Path) -> Result<Table> {
    if text.len() > LONGEST {
        let most = format!("a configuration has at most {LONGEST} bytes");
        return Err(Error::settings(path, &most));
    }
    text.parse::<Table>().map_err(|error| {
        let before = error.span().map_or("", |span| &text[..span.start]);
        let line = 1 + before.matches('\n').count();
        Error::settings(path, &format!("line {line}: {}", error.message()))
    })
}

/// An entry as an option by its name, with its value unless it is a flag; nothing for a flag that is not set.
///
/// # Errors
/// What is wrong with a name or a value.
pub fn option(name: &str, value: &Value) -> Result<Option<(String, Option<String>)>, String> {
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-';
    if ["", "help", "version"].contains(&name) || !name.chars().all(is_name) {
        return Err(format!("{name:?} is no option"));
    }
    let text = match value {
        Value::Boolean(false) => return Ok(None),
        Value::Boolean(true) => None,
        Value::String(text) => Some(text.clone()),
        Value::Integer(number) => Some(number.to_string()),
        Value::Float(number) => Some(number.to_string()),
        _ => return Err(format!("{name} must be a number, a text, true or false")),
    };
    Ok(Some((name.to_owned(), text)))
}
