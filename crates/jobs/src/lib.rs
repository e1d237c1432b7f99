//! Jobs on meshes, segmentations, images and fields: Willmore flow, fairing, inpainting and mean curvature flow from a file to a folder with the
//! results.
//!
//! ```
//! use jobs::{FlowOptions, Silent};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut options = FlowOptions::of("builtin:cross");
//! options.input.cells = Some(24);
//! options.run.steps = Some(2);
//! let results = jobs::flow(options, &Silent)?;
//! let summary = results.summary();
//! assert!(summary.energy < summary.first_energy);
//! let shape = results.shape().expect("two steps leave a shape");
//! assert!(shape.encode("svg")?.starts_with(b"<svg"));
//! # Ok(())
//! # }
//! ```
//!
//! The functions [`flow`], [`fair`], [`inpaint`], [`mcf`], [`surfaces_of_labels`] and [`shared_labels`] make their results in memory. [`run_in_folder`] keeps a run
//! in a folder, with pictures and a page, and [`resume`] continues it. [`open`] turns an input into a phase field on a suitable grid.
//! [`check`] tests derivatives on an input. [`train`] trains networks for other widths of the interface and other sizes of
//! the inner step, relative to the spacing of the grid.
//!
//! Nothing is printed. A job tells a [`Watcher`] its [warnings](Warning), its [notes](Note) and its progress. Warnings and notes are typed
//! values that contain the numbers. The watcher can also interrupt the job. Messages write the names of options in backticks, such as `cells`. A
//! program can replace such a name by its own spelling, such as `--cells`.

mod case;
mod check;
mod error;
mod events;
mod fair;
mod faired;
mod file;
mod functions;
mod inpaint;
mod input;
mod job;
mod keep;
mod made;
mod named;
mod notes;
mod options;
mod outcome;
mod own;
mod page;
mod parts;
pub mod paths;
mod plane;
mod prelude;
mod presentation;
mod refusal;
mod run;
mod sample;
mod session;
pub mod settings;
mod shared;
mod space;
mod steps;
mod train;
pub mod values;
mod volume;
mod words;

pub use case::check_eps_over_h;
pub use check::{Check, Checked, Finding, check};
pub use error::{Error, Result};
pub use events::{GridDistance, Loss, Note, PARTS, Progress, Silent, ThinParts, Warning, Watcher};
pub use faired::MeshReport;
pub use file::Input;
pub use functions::{LabelSurface, fair, flow, inpaint, mcf, repair, surfaces_of_labels};
pub use input::{Opened, open, usual_format};
pub use job::Job;
pub use made::{Curve, Made, MeshFile, Results, Shape, Surface};
pub use named::{one_line, options_of};
pub use notes::{About, NetworkNote, RunNotes};
pub use options::{
    CheckOptions, CommonOptions, FairOptions, FieldKind, FlowOptions, ForceOption, InpaintOptions,
    InputOptions, Inside, McfOptions, OperatorOptions, RunOptions, SampleOptions, Stepper,
    TrainOptions, WillmoreOptions,
};
pub use outcome::{DirectReport, GridSummary, Outcome, Summary, TimeAccuracy, progress};
pub use page::write as write_page;
pub use parts::{PartFate, PartReport};
pub use presentation::Topology;
pub use refusal::Refusal;
pub use sample::sample;
pub use session::{begin, resume, run_and_save, run_in_folder, run_in_memory};
pub use shared::{LabelReport, SharedLabels, SharedReport, shared_labels, shared_labels_to_file};
pub use steps::{StepState, Steps};
pub use train::{TrainedNetwork, train, train_and_save};
pub use volume::{labels, named};
