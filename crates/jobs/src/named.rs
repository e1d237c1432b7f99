//! Options by their names, for programs in other languages.

use clap::{Args, Command};

use crate::paths::of_text;
use crate::prelude::*;

/// The options with these names and values, as the program takes them: a name is that of a field, and an option without a value is a flag.
///
/// ```
/// use jobs::FlowOptions;
///
/// # fn main() -> Result<(), jobs::Error> {
/// let named = [("cells", Some("24".to_owned())), ("no_page", None)];
/// let options: FlowOptions = jobs::options_of(named)?;
/// assert_eq!(options.input.cells, Some(24));
/// let error = jobs::options_of::<FlowOptions>([("steps", Some("few".to_owned()))]);
/// assert!(error.unwrap_err().to_string().contains("`steps`"));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Named`]: names that are no options, values that they cannot have, and options that exclude each other.
pub fn options_of<'a, O: Args>(
    named: impl IntoIterator<Item = (&'a str, Option<String>)>,
) -> Result<O> {
    let typed = named.into_iter().map(|(name, value)| {
        let option = name.replace('_', "-");
        of_text(&match value {
            Some(value) => format!("--{option}={value}"),
            None => format!("--{option}"),
        })
    });
    let program = O::augment_args(Command::new("options").no_binary_name(true));
    let program = program.allow_negative_numbers(true).disable_help_flag(true);
    let matches = program.try_get_matches_from(typed);
    let options = matches.and_then(|matches| O::from_arg_matches(&matches));
    options.map_err(|error| Error::Named(as_fields(&one_line(&error))))
}

/// The message of clap on one line, without the advice to ask for help.
pub fn one_line(error: &clap::Error) -> String {
    let text = error.to_string();
    let paragraphs = text.split("\n\n").filter(|p| {
        !(p.starts_with("Usage") || p.starts_with("For more information") || p.trim().is_empty())
    });
    let words: Vec<&str> = paragraphs.flat_map(str::split_whitespace).collect();
    let line = words.join(" ");
    let line = line.strip_prefix("error: ").unwrap_or(&line);
    line.replace(
        "invalid digit found in string",
        "it must be a whole number, not negative",
    )
    .replace(" tip: ", "; ")
}

/// A message in which options stand as fields: `'--side-length <LENGTH>'` is `side_length`, in backticks.
fn as_fields(message: &str) -> String {
    let mut parts = message.split("'--");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (option, rest) = part.split_once('\'').unwrap_or((part, ""));
        let name = option.split([' ', '=']).next().unwrap_or_default();
        for piece in ["`", &name.replace('-', "_"), "`", rest] {
            text += piece;
        }
    }
    text
}
