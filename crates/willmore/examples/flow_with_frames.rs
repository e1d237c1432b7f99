//! A flow that is kept in a folder, with a picture of every second step, an animation and a page; it prints what it is told on the way.

use std::path::Path;

use willmore::prelude::*;

/// Prints warnings and notes.
struct Printer;

impl Watcher for Printer {
    fn warning(&self, warning: &Warning) {
        eprintln!("warning: {warning}");
    }

    fn note(&self, note: &Note) {
        eprintln!("{note}");
    }
}

/// The flow of a cross.
///
/// # Errors
/// Those of the job.
pub fn run(folder: &Path) -> Result<Outcome, JobError> {
    let mut options = FlowOptions::of("builtin:cross");
    options.input.cells = Some(32);
    options.run.steps = Some(4);
    options.run.frames = Some(2);
    options.run.output = Some(folder.to_owned());
    run_in_folder(Job::Flow(options), &Printer)
}

/// Runs the example.
///
/// # Errors
/// Those of the job.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::temp_dir().join(format!("cross-{}", std::process::id()));
    let outcome = run(&folder)?;
    println!("{} steps to t = {:.2e}", outcome.steps, outcome.time);
    println!("{}", outcome.folder.display());
    Ok(())
}
