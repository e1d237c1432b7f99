//! The one error type of the program.

/// What can fail as the program does, unless it says otherwise.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can stop the program. Every message is one line and says what to do.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub enum Error {
    /// Options that contradict each other, or that cannot be read.
    #[error("{0}")]
    Options(String),
    /// The help or the version, which was asked for.
    Help(clap::Error),
    /// Ctrl-C ended the run, or the training, after what was said of it.
    #[error("interrupted")]
    Interrupted,
    /// From a job.
    Jobs(#[from] jobs::Error),
    /// From a stored run.
    Engine(#[from] engine::Error),
    /// From reading and writing files.
    Files(#[from] files::Error),
    /// From networks.
    Model(#[from] model::Error),
    /// From the folders of runs.
    Runs(#[from] runs::Error),
}

/// Returns [`Error::Options`] with a message that is given as to `format!`.
macro_rules! refuse {
    ($($message:tt)*) => {
        return Err($crate::error::Error::Options(format!($($message)*)))
    };
}
pub(crate) use refuse;

impl From<clap::Error> for Error {
    fn from(error: clap::Error) -> Self {
        use clap::error::ErrorKind as Kind;
        match error.kind() {
            Kind::DisplayHelp | Kind::DisplayVersion => Self::Help(error),
            Kind::DisplayHelpOnMissingArgumentOrSubcommand | Kind::MissingSubcommand => {
                Self::options("there is no command; see willmore --help")
            }
            _ => Self::options(format!("{}; see --help", jobs::one_line(&error))),
        }
    }
}

impl Error {
    pub(crate) fn options(message: impl Into<String>) -> Self {
        Self::Options(message.into())
    }
}
