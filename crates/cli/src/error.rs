//! The one error type of the program.

use std::path::PathBuf;

use crate::scales::MissingNetwork;

/// What can stop the program. Every message is one line and says what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Options that contradict each other or the input.
    #[error("{0}")]
    Options(String),
    /// An option of a configuration file.
    #[error("{}: {message}", path.display())]
    Config {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// The system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was attempted.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// No network for the scales of a run.
    #[error(transparent)]
    MissingNetwork(#[from] MissingNetwork),
    /// Time steps became too small.
    #[error(
        "step {step} fails even with tau = {tau:e}, after {halvings} halvings: {source}; the shape is not resolved, use more --cells"
    )]
    TooStiff {
        /// The step.
        step: usize,
        /// Its size in the end.
        tau: f64,
        /// How often it was halved.
        halvings: usize,
        /// What the last attempt said.
        source: Box<solver::Error>,
    },
    /// From files.
    #[error(transparent)]
    Files(#[from] files::Error),
    /// From finite elements.
    #[error(transparent)]
    Fem(#[from] fem::Error),
    /// From fields and their files.
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
    /// From images.
    #[error(transparent)]
    Images(#[from] images::Error),
    /// From derivatives.
    #[error(transparent)]
    Linearize(#[from] linearize::Error),
    /// From networks.
    #[error(transparent)]
    Model(#[from] model::Error),
    /// From devices.
    #[error(transparent)]
    Operators(#[from] operators::Error),
    /// From the page of a run.
    #[error(transparent)]
    Pages(#[from] pages::Error),
    /// From plots.
    #[error(transparent)]
    Report(#[from] report::Error),
    /// From pictures.
    #[error(transparent)]
    Render(#[from] render::Error),
    /// From the run directory.
    #[error(transparent)]
    Runs(#[from] runs::Error),
    /// From flows.
    #[error(transparent)]
    Solver(#[from] solver::Error),
    /// From meshes.
    #[error(transparent)]
    Surfaces(#[from] surfaces::Error),
}

impl Error {
    /// Bad options.
    pub fn options(message: impl Into<String>) -> Self {
        Self::Options(message.into())
    }

    /// The message with its causes, on one line.
    pub fn line(&self) -> String {
        let mut line = self.to_string();
        let mut cause = std::error::Error::source(self);
        while let Some(error) = cause {
            let text = error.to_string();
            // Most messages already contain their cause's.
            if !line.contains(&text) {
                line = format!("{line}: {text}");
            }
            cause = error.source();
        }
        line.split_whitespace().collect::<Vec<_>>().join(" ")
    }
}
