//! `willmore resume`.

use runs::{RunDirectory, StoredRun};
use serde_json::json;

use super::{flow, mcf};
use crate::cli::{Command, ResumeOptions};
use crate::config;
use crate::error::Error;
use crate::page;
use crate::run::{self, Ending};

/// Continues a run by the options and the state that it stored; its input is not needed again.
///
/// # Errors
/// [`Error::Runs`] if there is no run, or if it is damaged; what the run raises.
pub fn run(options: &ResumeOptions) -> Result<Ending, Error> {
    let stored = if options.recover {
        RunDirectory::recover(&options.run)?
    } else {
        RunDirectory::open(&options.run)?
    };
    let path = options.run.join("config.toml");
    let mut command = config::parse_resolved(&stored.config()?, &path)?.command;
    if stored.is_finished() {
        remove_what_a_kill_left(&stored)?;
        if !no_page(&command) {
            page::write(&stored)?;
        }
        let folder = options.run.to_string_lossy();
        let outcome = json!({ "command": stored.identity().kind, "finished": true, "run": folder });
        let text = format!("The run in {folder} is finished already");
        run::report(options.say, &outcome, &text);
        return Ok(Ending::Done);
    }
    match &mut command {
        Command::Flow(flow) => flow.common.say = options.say,
        Command::Fair(fair) => fair.flow.common.say = options.say,
        Command::Inpaint(inpaint) => inpaint.flow.common.say = options.say,
        Command::Mcf(mcf) => mcf.common.say = options.say,
        _ => {}
    }
    match command {
        Command::Flow(options) => flow::run(options, Some(stored)),
        Command::Fair(options) => flow::run(options, Some(stored)),
        Command::Inpaint(options) => flow::run(options, Some(stored)),
        Command::Mcf(options) => mcf::run(options, Some(stored)),
        _ => Err(Error::options(format!(
            "{} names no command that makes runs",
            path.display()
        ))),
    }
}

/// Whether the run was to have no page.
fn no_page(command: &Command) -> bool {
    match command {
        Command::Flow(flow) => flow.keep.no_page,
        Command::Fair(fair) => fair.flow.keep.no_page,
        Command::Inpaint(inpaint) => inpaint.flow.keep.no_page,
        Command::Mcf(mcf) => mcf.keep.no_page,
        _ => true,
    }
}

/// What a run that was killed right after its last commit did not come to, and half a page. Nothing else is touched in a
/// finished run: what is there besides may be its owner's.
fn remove_what_a_kill_left(stored: &StoredRun) -> Result<(), Error> {
    let folder = stored.path().join("checkpoints");
    for path in stored.leftovers().filter(|path| path.starts_with(&folder)) {
        std::fs::remove_file(path).map_err(|source| Error::Io {
            action: "remove",
            path: path.to_owned(),
            source,
        })?;
    }
    files::remove_stale(stored.path())?;
    Ok(())
}
