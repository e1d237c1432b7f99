use thiserror::Error as ThisError;

/// What can stop an experiment. Errors of the libraries pass through.
#[derive(Debug, ThisError)]
#[error(transparent)]
pub enum Error {
    /// Options that contradict each other or the experiment.
    #[error("{0}")]
    Options(String),
    Files(#[from] files::Error),
    Engine(#[from] engine::Error),
    Fem(#[from] fem::Error),
    Model(#[from] model::Error),
    Operators(#[from] operators::Error),
    Solver(#[from] solver::Error),
    Geometry(#[from] geometry::Error),
    Surfaces(#[from] surfaces::Error),
    Reference(#[from] reference::Error),
    Render(#[from] render::Error),
    Report(#[from] report::Error),
    Volumes(#[from] volumes::Error),
}

/// What can fail as an experiment does, unless it says otherwise.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Refuses options with this message unless the condition holds.
pub fn require(holds: bool, message: impl Into<String>) -> Result<()> {
    holds
        .then_some(())
        .ok_or_else(|| Error::Options(message.into()))
}
