use std::path::PathBuf;

use thiserror::Error as ThisError;

use crate::Stop;

/// What can stop a case.
#[derive(Debug, ThisError)]
pub enum Error {
    /// A parameter out of range.
    #[error("{name} = {value:e} is out of range: {expected}")]
    Parameter {
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        expected: &'static str,
    },
    /// A reduced volume that no shape has.
    #[error(
        "a reduced volume of {target} is not possible: a ball has 1, any other shape less, this one {present:.4} at the beginning"
    )]
    ReducedVolume {
        /// What was asked for.
        target: f64,
        /// That of the initial shape.
        present: f64,
    },
    /// A time step that failed, with the case that it belongs to.
    #[error("{case}: {source}")]
    Step {
        /// Flow, shape and operator.
        case: String,
        /// Why.
        source: Box<solver::Error>,
    },
    /// Smaller time steps failed, too.
    #[error(
        "{case}: step {step}: no step was possible, not even of size {tau:.1e}, halved {halvings} times: {source}"
    )]
    TooStiff {
        /// Flow, shape and operator.
        case: String,
        /// Number of the time step, from 1.
        step: usize,
        /// Size of the last attempt.
        tau: f64,
        /// How often it had been halved.
        halvings: u32,
        /// Why the last attempt failed.
        source: Box<solver::Error>,
    },
    /// A flow for which the memory is too small.
    #[error(
        "the flow needs about {needed:.1} GB of memory with {cells} cells a side, and {available:.1} GB are free: take at most {fitting}, \
         or store bricks instead of the whole grid"
    )]
    Memory {
        /// Cells along a side of the grid.
        cells: usize,
        /// The memory that the flow needs, in GB.
        needed: f64,
        /// The memory that is free, in GB.
        available: f64,
        /// With so many cells along a side it fits.
        fitting: usize,
    },
    /// Two runs whose nodes cannot be compared.
    #[error(
        "a run with {cells} cells per side cannot be compared with a reference with {reference}: the latter must be a multiple, in the \
         same box"
    )]
    Incomparable {
        /// Cells of the run.
        cells: usize,
        /// Cells of the reference.
        reference: usize,
    },
    /// A time step that a trajectory does not have.
    #[error("there is no step {step} in a run of {steps} steps")]
    NoSuchStep {
        /// The step.
        step: usize,
        /// What there is.
        steps: usize,
    },
    /// A stored run that is not of this case.
    #[error(
        "{} holds a run of another case ({difference}); start a new run in another folder", path.display()
    )]
    OtherCase {
        /// The folder.
        path: PathBuf,
        /// In what they differ.
        difference: String,
    },
    /// A stored run that cannot go on.
    #[error("the run in {} cannot go on: {stop}", path.display())]
    Over {
        /// The folder.
        path: PathBuf,
        /// Why.
        stop: Stop,
    },
    /// A stored run whose checkpoint cannot be understood.
    #[error("{} cannot be resumed: {reason}; start a new run", path.display())]
    Unreadable {
        /// The folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// From an observer of another crate.
    #[error(transparent)]
    Observer(Box<dyn std::error::Error + Send + Sync>),
    /// From run directories.
    #[error(transparent)]
    Runs(#[from] runs::Error),
    /// From the finite elements.
    #[error(transparent)]
    Fem(#[from] fem::Error),
    /// From networks.
    #[error(transparent)]
    Model(#[from] model::Error),
    /// From the solver, before the first step.
    #[error(transparent)]
    Solver(#[from] solver::Error),
    /// From the device.
    #[error(transparent)]
    Operators(#[from] operators::Error),
    /// From grids and fields.
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
}

impl Error {
    /// Wraps what an observer of another crate raised.
    pub fn observer(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Observer(error.into())
    }
}
