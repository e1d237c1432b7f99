#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

use thiserror::Error as ThisError;

/// What can stop a case.
#[derive(Debug, ThisError)]
pub enum Error {
    #[error(
        "a reduced volume of {target} is not possible: a ball has 1, any other shape less, this one {present:.4} at the beginning"
    )]
    ReducedVolume { target: f64, present: f64 },
    #[error(
        "no shape in the box with the volume {volume:.5e} has less surface than {perimeter:.5e}, so that nothing could move (in the plane, length and \
         area): hold one of the two sizes, or more surface for this volume (a smaller reduced volume)"
    )]
    LeastPerimeter { perimeter: f64, volume: f64 },
    #[error(
        "{case}: the step before failed after the flow had moved: go on from the last checkpoint"
    )]
    Torn { case: String },
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
