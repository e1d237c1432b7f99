#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

use thiserror::Error as ThisError;

/// What can stop a case.
#[derive(Debug, ThisError)]
pub enum Error {
    #[error("{case}: step {step}: the controller gave up at a step of size {tau:.1e}")]
    Refused { case: String, step: usize, tau: f64 },
    #[error(
        "the scheme {scheme} does not estimate the errors of its steps, so that their sizes cannot be controlled by them: give the sizes, or another \
         controller"
    )]
    NoEstimates { scheme: String },
    /// A time step that failed, with the case that it belongs to.
    #[error("{case}: {source}")]
    Step {
        case: String,
        source: Box<solver::Error>,
    },
    #[error(
        "{case}: step {step}: no step was possible, not even of size {tau:.1e}, halved {halvings} times: {source}"
    )]
    TooStiff {
        case: String,
        step: usize,
        tau: f64,
        halvings: u32,
        source: Box<solver::Error>,
    },
    /// Cells are those along a side, memory is in GB.
    #[error(
        "the flow needs about {needed:.1} GB of memory on a box of {cells} cells a side, and {available:.1} GB are free: take at most \
         {fitting} cells a side of the box{alternative}"
    )]
    Memory {
        cells: usize,
        needed: f64,
        available: f64,
        fitting: usize,
        alternative: &'static str,
    },
    #[error("the measure {name} is {value} at t = {time}")]
    NonFinite { name: String, value: f64, time: f64 },
    #[error(
        "a run with {cells} cells per side cannot be compared with a reference with {reference}: the latter must be a multiple, in the \
         same box"
    )]
    Incomparable { cells: usize, reference: usize },
    /// The step was not wanted any more before it was made; the run stays where it was.
    #[error("{case}: the step was cancelled")]
    Cancelled { case: String },
    /// A stored run of another case, one that is over, or one that cannot be read.
    #[error("the run in {} cannot go on: {reason}", path.display())]
    Stored { path: PathBuf, reason: String },
    /// From an observer of another crate.
    #[error(transparent)]
    Observer(Box<dyn std::error::Error + Send + Sync>),
    #[error(transparent)]
    Runs(#[from] runs::Error),
    #[error(transparent)]
    Fem(#[from] fem::Error),
    #[error(transparent)]
    MeanCurvature(#[from] mean_curvature::Error),
    #[error(transparent)]
    Model(#[from] model::Error),
    /// From the solver, before the first step.
    #[error(transparent)]
    Solver(#[from] solver::Error),
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
}
