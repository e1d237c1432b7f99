//! `willmore resume`.

use super::flow;
use crate::cli::{Command, ResumeOptions};
use crate::prelude::*;

/// Continues a run by the options and the state that it stored; its input is not needed again.
pub fn run(options: &ResumeOptions, say: SayOptions) -> Result<ExitCode, Error> {
    let stored = if options.recover {
        RunDirectory::recover(&options.run)?
    } else {
        RunDirectory::open(&options.run)?
    };
    let path = options.run.join(config::FILE);
    let mut command = config::parse_resolved(&stored.read_text(config::FILE)?, &path)?.command;
    let Some((_, keep)) = command.of_run() else {
        let path = path.display();
        return Err(Error::options(format!(
            "{path} names no command that makes runs"
        )));
    };
    keep.force = options.force;
    if stored.is_finished() && options.steps.is_none() {
        // Nothing else is touched in a finished run: what is there besides may be its owner's.
        stored.tidy()?;
        if !keep.no_page {
            page::write(&stored)?;
        }
        let folder = options.run.to_string_lossy();
        let command = &engine::notes(&stored)["about"]["command"];
        let outcome = json!({ "command": command, "finished": true, "run": folder });
        let text = format!(
            "The run in {folder} is finished already; willmore resume {folder} --steps N goes on to N steps in all"
        );
        say.report(&outcome, &text);
        return Ok(ExitCode::SUCCESS);
    }
    let steps = options.steps;
    match command {
        Command::Flow(options) => flow::run(options, say, Some((stored, steps))),
        Command::Fair(options) => flow::run(options, say, Some((stored, steps))),
        Command::Inpaint(options) => flow::run(options, say, Some((stored, steps))),
        Command::Mcf(options) => flow::run(options, say, Some((stored, steps))),
        _ => unreachable!("no other command makes runs"),
    }
}
