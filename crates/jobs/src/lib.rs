//! Jobs on meshes, segmentations, images and fields: Willmore flow, fairing, inpainting and mean curvature flow from a file to a folder with the
//! results.
//!
//! ```
//! use jobs::{Command, FlowOptions, InputOptions, RunOptions, Silent};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! let run = RunOptions {
//!     input: InputOptions { input: Some("builtin:cross".to_owned()), cells: Some(24), ..InputOptions::default() },
//!     steps: Some(2),
//!     output: Some(folder.path().join("cross")),
//!     ..RunOptions::default()
//! };
//! let outcome = jobs::start(Command::Flow(FlowOptions { run, ..FlowOptions::default() }), &Silent)?;
//! let summary = outcome.summary.expect("nothing interrupted it");
//! assert!(summary.energy < summary.first_energy);
//! # Ok(())
//! # }
//! ```
//!
//! Nothing is printed. A [`Watcher`] hears [warnings](Warning) and [notes](Note) as values with their numbers, follows the progress, and can interrupt.
//! Messages name options in backticks, as `cells`: a program can show them as it spells them.

mod case;
mod command;
mod error;
mod events;
mod fair;
mod faired;
mod inpaint;
mod input;
mod job;
mod keep;
mod options;
mod outcome;
mod own;
mod page;
pub mod paths;
mod plane;
mod prelude;
mod presentation;
mod run;
mod sample;
pub mod settings;
mod space;
pub mod values;
mod volume;
mod words;

pub use case::check_eps_over_h;
pub use command::Command;
pub use error::{Error, Result};
pub use events::{GridDistance, Loss, Note, Progress, Silent, ThinParts, Warning, Watcher};
pub use faired::MeshReport;
pub use input::{Opened, open, usual_format};
pub use job::{resume, start};
pub use options::{
    CommonOptions, FairOptions, FieldKind, FlowOptions, ForceOption, InpaintOptions, InputOptions,
    Inside, McfOptions, OperatorOptions, RunOptions, SampleOptions,
};
pub use outcome::{GridSummary, Outcome, Summary, TimeAccuracy, progress};
pub use page::write as write_page;
pub use presentation::Topology;
pub use sample::sample;
pub use volume::{labels, named};
