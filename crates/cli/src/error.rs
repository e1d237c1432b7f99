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
            _ => Self::options(format!("{}; see --help", one_line(&error))),
        }
    }
}

impl Error {
    pub(crate) fn options(message: impl Into<String>) -> Self {
        Self::Options(message.into())
    }
}

/// What clap says, on one line.
pub fn one_line(error: &clap::Error) -> String {
    let text = error.to_string();
    let paragraphs = text.split("\n\n").filter(|p| {
        !(p.starts_with("Usage") || p.starts_with("For more information") || p.trim().is_empty())
    });
    let words: Vec<&str> = paragraphs.flat_map(str::split_whitespace).collect();
    let line = words.join(" ");
    let line = line.strip_prefix("error: ").unwrap_or(&line);
    line.replace(
        "invalid digit found in string",
        "it must be a whole number, not negative",
    )
}
