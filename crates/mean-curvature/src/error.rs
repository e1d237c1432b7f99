#![allow(missing_docs, reason = "messages and names say it")]

use thiserror::Error as ThisError;

use crate::StepFailure;

/// What can go wrong where a step of mean curvature flow is measured, or put on other nodes.
#[derive(Debug, ThisError)]
pub enum Error {
    #[error(
        "calibration: {reason} (eigenvalue near 1: {eigenvalue:.6}); train the network longer, or run without calibration"
    )]
    Calibration {
        reason: &'static str,
        /// The eigenvalue of the step's derivative at the flat interface that should be 1; NaN if there is no such interface.
        eigenvalue: f64,
    },
    #[error(
        "{step} works on the whole grid only: it does not say how to compute on active bricks; store the whole grid"
    )]
    WholeGridOnly { step: String },
    #[error("{step} was put on bricks; ask the step that it was made of for the whole grid")]
    BricksOnly { step: String },
    #[error(
        "{step} has no inverse in the pure phases: its response to an impulse there is not finite, or its mass not positive"
    )]
    NoResponse { step: String },
    #[error(
        "a box of {cells} cells a side is too small for flat interfaces of width {eps} h: take at least {least} cells"
    )]
    BoxTooSmall {
        cells: usize,
        /// `eps / h`.
        eps: f64,
        least: usize,
    },
    #[error("{step} failed: {failure}")]
    Step { step: String, failure: StepFailure },
    #[error(transparent)]
    Linearize(#[from] linearize::Error),
    #[error(transparent)]
    Operators(#[from] operators::Error),
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
}

impl Error {
    /// The calibration of a step that has no flat interface.
    pub fn uncalibrated(reason: &'static str) -> Self {
        Self::Calibration {
            reason,
            eigenvalue: f64::NAN,
        }
    }
}
