use thiserror::Error as ThisError;

/// What can stop an experiment. Errors of the libraries pass through.
#[derive(Debug, ThisError)]
pub enum Error {
    /// Options that contradict each other or the experiment.
    #[error("{0}")]
    Options(String),
    #[error(transparent)]
    Files(#[from] files::Error),
    #[error(transparent)]
    Engine(#[from] engine::Error),
    #[error(transparent)]
    Runs(#[from] runs::Error),
    #[error(transparent)]
    Fem(#[from] fem::Error),
    #[error(transparent)]
    Model(#[from] model::Error),
    #[error(transparent)]
    Operators(#[from] operators::Error),
    #[error(transparent)]
    Solver(#[from] solver::Error),
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
    #[error(transparent)]
    Surfaces(#[from] surfaces::Error),
    #[error(transparent)]
    Reference(#[from] reference::Error),
    #[error(transparent)]
    Render(#[from] render::Error),
    #[error(transparent)]
    Report(#[from] report::Error),
    #[error(transparent)]
    Volumes(#[from] volumes::Error),
}

impl Error {
    /// The message with its causes, on one line.
    pub fn line(&self) -> String {
        files::with_causes(self)
    }
}

/// Refuses options with this message unless the condition holds.
pub fn require(holds: bool, message: impl Into<String>) -> Result<(), Error> {
    holds
        .then_some(())
        .ok_or_else(|| Error::Options(message.into()))
}
