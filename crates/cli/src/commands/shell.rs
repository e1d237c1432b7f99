//! `willmore completions` and `willmore man`.

use std::io::Write;

use clap::CommandFactory;
use clap_complete::Shell;

use crate::cli::Cli;
use crate::error::Error;
use crate::run::Ending;

/// Prints completions.
pub fn completions(shell: Shell) -> Ending {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "willmore", &mut text);
    print(&text);
    Ending::Done
}

/// Prints the manual page: that of the program, then those of its commands.
///
/// # Errors
/// [`Error::Io`] if a page cannot be made.
pub fn man() -> Result<Ending, Error> {
    let mut text = Vec::new();
    let mut command = Cli::command();
    command.build();
    let pages = std::iter::once(&command).chain(command.get_subcommands());
    for page in pages {
        clap_mangen::Man::new(page.clone())
            .render(&mut text)
            .map_err(|source| Error::Io {
                action: "make the manual page of",
                path: page.get_name().into(),
                source,
            })?;
    }
    print(&text);
    Ok(Ending::Done)
}

fn print(text: &[u8]) {
    // A closed pipe (`| head`) is no failure.
    let _ = std::io::stdout().write_all(text);
}
