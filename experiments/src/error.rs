use thiserror::Error as ThisError;

/// What can stop an experiment.
#[derive(Debug, ThisError)]
pub enum Error {
    /// Options that contradict each other or the experiment.
    #[error("{0}")]
    Options(String),
    /// A file that cannot be read.
    #[error(transparent)]
    Files(#[from] files::Error),
    /// From a flow.
    #[error(transparent)]
    Engine(#[from] engine::Error),
    /// From run directories and stored results.
    #[error(transparent)]
    Runs(#[from] runs::Error),
    /// From the finite elements.
    #[error(transparent)]
    Fem(#[from] fem::Error),
    /// From networks and training.
    #[error(transparent)]
    Model(#[from] model::Error),
    /// From the device.
    #[error(transparent)]
    Operators(#[from] operators::Error),
    /// From the flows.
    #[error(transparent)]
    Solver(#[from] solver::Error),
    /// From the geometry.
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
    /// From meshes.
    #[error(transparent)]
    Surfaces(#[from] surfaces::Error),
    /// From pictures of surfaces.
    #[error(transparent)]
    Render(#[from] render::Error),
    /// From figures, tables and output files.
    #[error(transparent)]
    Report(#[from] report::Error),
}

impl Error {
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
