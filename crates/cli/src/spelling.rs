//! Names of options in messages.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use clap::CommandFactory;

use crate::cli::Cli;

/// A message of the library, which has names of options in backticks, with the options as they are typed: `side_length` is --side-length.
pub fn spelled(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    let mut rest = message;
    while let Some((before, quoted, after)) = first_quoted(rest) {
        text += before;
        let option = quoted.replace('_', "-");
        if options().contains(&option) {
            text += "--";
            text += &option;
        } else {
            text += &rest[before.len()..rest.len() - after.len()];
        }
        rest = after;
    }
    text + rest
}

/// The first part of a text that is in backticks, between what is before and after it.
fn first_quoted(text: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = text.split_once('`')?;
    let (quoted, after) = rest.split_once('`')?;
    Some((before, quoted, after))
}

/// All options of the program.
fn options() -> &'static BTreeSet<String> {
    static OPTIONS: OnceLock<BTreeSet<String>> = OnceLock::new();
    OPTIONS.get_or_init(|| {
        let program = Cli::command();
        let commands = program.get_subcommands();
        let all = commands.flat_map(clap::Command::get_arguments);
        all.filter_map(|argument| argument.get_long())
            .map(str::to_owned)
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_spelled_as_they_are_typed() {
        let of_library = "`side_length` 3 is too much: `willmore resume` goes on with more `steps`";
        let of_program = "--side-length 3 is too much: `willmore resume` goes on with more --steps";
        assert_eq!(spelled(of_library), of_program);
        for unchanged in ["", "a `", "`", "`no_option`", "`a` `b"] {
            assert_eq!(spelled(unchanged), unchanged);
        }
    }

    #[test]
    fn the_help_has_options_as_they_are_typed() {
        let program = crate::config::program();
        let all = program
            .get_subcommands()
            .flat_map(clap::Command::get_arguments);
        let texts = all.flat_map(|argument| [argument.get_help(), argument.get_long_help()]);
        let texts: Vec<String> = texts.flatten().map(ToString::to_string).collect();
        assert!(texts.iter().any(|text| text.contains("unit as --box-side")));
        for text in texts {
            assert_eq!(spelled(&text), text);
        }
    }
}
