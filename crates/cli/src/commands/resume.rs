use engine::Stop;
use jobs::{RunNotes, settings};
use runs::RunDirectory;
use serde_json::json;

use super::run::tell;
use crate::cli::ResumeOptions;
use crate::console::Console;
use crate::error::Result;

/// Continues a run by the options and the state that it stored; its input is not needed again.
pub fn run(options: &ResumeOptions, console: &Console) -> Result<()> {
    let stored = if options.recover {
        RunDirectory::recover(&options.run)?
    } else {
        RunDirectory::open(&options.run)?
    };
    let mut job = settings::job_of(&stored)?;
    let stored_options = job.run();
    // A run that was over may have written the file of --save itself.
    let notes = RunNotes::of(&stored)?;
    let was_over = stored.is_finished() || notes.was_over;
    stored_options.force.force = options.force.force || was_over;
    if !stored.is_finished() || options.steps.is_some() {
        let outcome = jobs::resume(job, stored, options.steps, console)?;
        return tell(&outcome, console);
    }
    // Nothing else is touched in a finished run: what is there besides may be its owner's.
    stored.tidy()?;
    if !stored_options.no_page {
        jobs::write_page(&stored)?;
    }
    let folder = options.run.to_string_lossy();
    let outcome = json!({ "command": notes.about.command, "finished": true, "run": folder });
    let advice = match engine::ended(&stored)? {
        Some(stop @ Stop::Steps(_)) => {
            format!(": {stop}; willmore resume {folder} --steps N goes on to N steps in all")
        }
        stop => stop.map_or(String::new(), |stop| format!(": {stop}")),
    };
    let text = format!("The run in {folder} is finished already{advice}");
    console.report(&outcome, &text)
}
