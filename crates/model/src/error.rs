#![allow(missing_docs, reason = "messages and names say it")]

use std::path::PathBuf;

use thiserror::Error as ThisError;

use crate::Ratios;

/// What can go wrong with networks and their training.
#[derive(Debug, ThisError)]
pub enum Error {
    #[error("the network does not fit this run: trained for {network}, the run has {run}")]
    Mismatch { network: Ratios, run: Ratios },
    #[error(
        "no network of the {recipe} recipe for {wanted}; there are {available}. Choose one of these, or train one: \
         willmore train --dimension {} --width {} --eps-over-h {} --step-over-h2 {} --save FILE.safetensors, and give it by --network",
        wanted.dimension, wanted.width, wanted.eps_over_h, wanted.step_over_h2
    )]
    MissingNetwork {
        recipe: &'static str,
        wanted: Ratios,
        available: String,
    },
    #[error("no run of these methods uses a network that is given: leave it out")]
    NetworkNotNeeded,
    #[error(
        "the kernel is {width} cells wide, but the grid has only {cells}; use a larger box or a finer grid"
    )]
    KernelTooWide { width: usize, cells: usize },
    #[error(
        "the sizes of the kernel's values add up to {sum:.1}, and may to {most:.1}, since the activation is tabulated up to there: divide the \
         kernel by {sum:.1} and multiply the first weights of the activation by it, or train the network again"
    )]
    KernelTooLarge { sum: f64, most: f64 },
    #[error(
        "the kernel of this network differs by {error:.0e} of its largest value from a product of functions of one variable, which active \
         bricks need; take a network of the accurate recipe, or store the whole grid"
    )]
    NotSeparable {
        /// The largest difference, relative to the largest value.
        error: f64,
    },
    #[error(
        "the operator keeps no constant value near {phase}, which active bricks need; train the network longer, or store the whole grid"
    )]
    NoRest { phase: f64 },
    #[error("impossible ratios ({ratios}): {reason}")]
    Ratios {
        ratios: Ratios,
        reason: &'static str,
    },
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        what: &'static str,
        expected: String,
        found: String,
    },
    #[error("{what}: entry {index} is not finite")]
    NonFinite { what: &'static str, index: usize },
    #[error("{path} is not a usable network: {reason}")]
    Weights { path: PathBuf, reason: String },
    #[error("training: {0}")]
    Training(String),
    #[error(
        "training diverged in iteration {iteration}: {what} is not finite; lower the learning rate or change the seed"
    )]
    Diverged {
        iteration: usize,
        what: &'static str,
    },
    #[error("training interrupted after iteration {iteration}; run again to resume")]
    Interrupted { iteration: usize },
    #[error(transparent)]
    File(#[from] files::Error),
    #[error(transparent)]
    MeanCurvature(#[from] mean_curvature::Error),
    #[error(transparent)]
    Operators(#[from] operators::Error),
}

impl Error {
    /// Refuses another number, of entries or of dimensions, than the expected one.
    pub(crate) fn check_count(
        what: &'static str,
        expected: usize,
        found: usize,
    ) -> Result<(), Self> {
        if found == expected {
            return Ok(());
        }
        Err(Self::Shape {
            what,
            expected: expected.to_string(),
            found: found.to_string(),
        })
    }

    /// Refuses numbers that are not finite.
    pub(crate) fn check_finite(what: &'static str, values: &[f64]) -> Result<(), Self> {
        match values.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(Self::NonFinite { what, index }),
            None => Ok(()),
        }
    }
}
