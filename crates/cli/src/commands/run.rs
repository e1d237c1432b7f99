//! The commands that make runs.

use std::path::Path;

use jobs::Outcome;

use super::labels;
use crate::console::{Console, advice};
use crate::error::{Error, Result};

/// Makes a run, or one for each label of a volume. Its result goes to a file that stands for standard output, if there is one: the run does
/// not name it.
pub fn run(mut job: jobs::Job, output: Option<&Path>, console: &Console) -> Result<()> {
    if let jobs::Job::Fair(options) = &job
        && options.shared
    {
        return shared(options.clone(), console);
    }
    let input = job.input().clone();
    let of_label = |label| {
        let mut one = job.clone();
        labels::choose(one.input(), label);
        let options = one.run();
        for path in options.output.iter_mut().chain(&mut options.save) {
            labels::named(path, label);
        }
        run(one, None, console)
    };
    if labels::with_each(&input, console, of_label)? {
        return Ok(());
    }
    let outcome = match output {
        Some(file) => jobs::run_and_save(job, file, console)?,
        None => jobs::run_in_folder(job, console)?,
    };
    tell(&outcome, console)
}

/// Smooths all labels of a volume together, into a file.
fn shared(options: jobs::FairOptions, console: &Console) -> Result<()> {
    let made = jobs::shared_labels_to_file(options, console)?;
    let mut outcome = made.report.to_json();
    outcome["command"] = "fair".into();
    console.report(&outcome, &made.report.sentences().join("\n"))
}

/// Prints what came out of a run.
pub fn tell(outcome: &Outcome, console: &Console) -> Result<()> {
    let reason = match &outcome.ended {
        None | Some(engine::Stop::Steps(_)) => String::new(),
        Some(stop) => format!(": {stop}"),
    };
    let progress = jobs::progress(outcome.steps, outcome.time);
    let mut text = vec![format!("{progress} in {:.1} s{reason}", outcome.seconds)];
    if let Some(summary) = &outcome.summary {
        text.extend(summary.sentences());
    }
    let shown = outcome.folder.display();
    text.push(match (&outcome.summary, &outcome.page) {
        (None, _) => advice(&outcome.folder, outcome.save.as_deref()),
        (Some(_), None) => format!("results are in {shown}"),
        (Some(_), Some(page)) => {
            format!("results are in {shown}, to look at: {}", page.display())
        }
    });
    console.report(&outcome.to_json(), &text.join("\n"))?;
    match outcome.summary {
        Some(_) => Ok(()),
        None => Err(Error::Interrupted),
    }
}
