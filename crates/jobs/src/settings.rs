//! The options of a run, resolved, as a file in its folder.

use crate::job::Job;
use crate::prelude::*;

/// The file of all options, resolved, in the folder of a run.
pub const FILE: &str = "config.toml";
/// The entry that names the job.
pub const COMMAND: &str = "command";

/// All options of a job as the text of the [file](FILE).
///
/// # Errors
/// Options that TOML cannot hold, such as paths that are no text.
pub fn resolved(job: &Job) -> Result<String> {
    let options = toml::to_string(job).map_err(Error::UnwritableOptions)?;
    Ok(format!("{COMMAND} = {:?}\n{options}", job.name()))
}
