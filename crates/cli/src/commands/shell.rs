//! `willmore completions` and `willmore man`.

use std::io::Write;

use clap::CommandFactory;
use clap_complete::Shell;

use crate::cli::Cli;
use crate::prelude::*;

pub fn completions(shell: Shell) {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "willmore", &mut text);
    print(&text);
}

/// Prints the manual page: that of the program, then those of its commands.
pub fn man() -> Result<()> {
    let mut text = Vec::new();
    let mut command = Cli::command();
    command.build();
    let pages = std::iter::once(&command).chain(command.get_subcommands());
    for page in pages {
        clap_mangen::Man::new(page.clone())
            .render(&mut text)
            .map_err(files::Error::of("make the manual page of", page.get_name()))?;
    }
    print(&text);
    Ok(())
}

fn print(text: &[u8]) {
    // A closed pipe (`| head`) is no failure.
    let _ = std::io::stdout().write_all(text);
}
