//! The harness of the experiments: options, errors, stored partial results, and the runs themselves.
//!
//! Every [experiment](experiment::Experiment) is a file of [`programs`], which reads options, calls what is here, and writes figures,
//! tables and summaries with the `report` crate; the executables, the page of results and the tables of metrics are
//! [derived] from the list. Numerics live in the library crates; here are comparisons: with exact solutions, finer runs, other
//! smoothing, and products written by hand.
//!
//! # Conventions
//!
//! - `n` is the number of cells per unit length, `h = 1/n`.
//! - Errors are true `L2` norms, `sqrt(h^D sum u^2)`.
//! - Every failure is one line on standard error and exit code 2; options are checked before any output is touched.
//! - Results are collected in a fixed order: the same input gives the same bytes, wall times aside.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]
#![allow(missing_docs, reason = "of fields whose names say it")]

pub mod circle_figures;
pub mod circles;
pub mod comparison;
pub mod derived;
pub mod equilibria;
pub mod experiment;
pub mod harness;
pub mod inpainting;
pub mod learning;
pub mod mesh_flow;
pub mod meshes;
pub mod metrics;
pub mod networks;
pub mod options;
pub mod others;
pub mod prelude;
pub mod products;
pub mod programs;
pub mod segmentations;
pub mod session;
pub mod shares;
pub mod smoothing;
pub mod step_table;
pub mod storages;
pub mod study;
pub mod surfaces;
pub mod timing;
pub mod training;
pub mod truth;

/// What stops an experiment: options that contradict each other or the experiment, or an error of a library.
pub type Error = Box<dyn std::error::Error + Send + Sync>;

/// What can fail as an experiment does, unless it says otherwise.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Refuses options with this message unless the condition holds.
pub fn require(holds: bool, message: impl Into<Error>) -> Result<()> {
    holds.then_some(()).ok_or_else(|| message.into())
}
