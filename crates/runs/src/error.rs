//! The one error type of the crate.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// What can go wrong with a run directory. Every message is one line and says what to do.
///
/// Whatever went wrong, the directory on the disk is that of the last commit and can be opened
/// again, except where the error says that it is damaged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A new run where there is something already.
    #[error("cannot start a run in {}: it holds {found}; {advice}", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// What is there.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// A folder without a committed index.
    #[error("{} holds no run (no index.json): start one there, or give another folder", path.display())]
    NoRun {
        /// The folder.
        path: PathBuf,
    },
    /// Another process works on the run.
    #[error("another process works on the run in {}: wait for it or stop it", path.display())]
    Locked {
        /// The run directory.
        path: PathBuf,
    },
    /// There is nothing to resume.
    #[error("the run in {} is finished: start a new one in another folder", path.display())]
    Finished {
        /// The run directory.
        path: PathBuf,
    },
    /// A file is not what was committed.
    #[error("{} is damaged: {damage}; {}", path.display(), advice(*.fallback))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        damage: Damage,
        /// The step from which [`RunDirectory::recover`](crate::RunDirectory::recover) can go on.
        fallback: Option<u64>,
    },
    /// A file of another version of its format.
    #[error(
        "{} has format version {found}, this program reads version {supported}: use the program \
         that wrote it, or start a new run", path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The version that can be read.
        supported: u32,
    },
    /// A checkpoint or run made for something else.
    #[error(
        "{} was made with another {what}: {found} there, {expected} now; resume with the same, or \
         start a new run in another folder", path.display()
    )]
    Mismatch {
        /// The checkpoint or the run directory.
        path: PathBuf,
        /// What differs.
        what: &'static str,
        /// Its value in the file.
        found: String,
        /// Its value now.
        expected: String,
    },
    /// A file name outside the allowed grammar.
    #[error("file name {name:?} is not allowed: {reason}")]
    Name {
        /// The name as given.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A file that is written twice.
    #[error("{name:?} is already a file of this run: files are written once, choose another name")]
    Exists {
        /// Its name.
        name: String,
    },
    /// A checkpoint that does not follow the last one.
    #[error(
        "the state of step {step} cannot follow the checkpoint of step {last}: commit later steps, \
         or the same state again"
    )]
    Order {
        /// The step to be committed.
        step: u64,
        /// The step of the last checkpoint.
        last: u64,
    },
    /// A state that cannot be stored, or lacks what is looked for.
    #[error("the state of step {step} cannot be used: {reason}")]
    State {
        /// Its step.
        step: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// Rows of metrics that do not go together.
    #[error("the row of metrics has the columns {found:?}, but {} begins with {expected:?}", path.display())]
    Columns {
        /// The file of metrics.
        path: PathBuf,
        /// The first line of the file.
        expected: String,
        /// The columns of the row, empty unless it is a struct.
        found: String,
    },
    /// A row that cannot be written as CSV.
    #[error("the row of metrics cannot be written as CSV: {source}")]
    Row {
        /// The cause.
        source: csv::Error,
    },
    /// Something that cannot be turned into JSON.
    #[error("{what} cannot be written as JSON: {source}")]
    Json {
        /// What was being written.
        what: &'static str,
        /// The cause.
        source: serde_json::Error,
    },
    /// Something of unlimited length, such as the list of all files, has become too long.
    #[error("{what} would take {length} bytes, and at most {limit} can be read: write less")]
    TooLong {
        /// What was being written.
        what: &'static str,
        /// Its length in bytes.
        length: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// An earlier write has failed, and what is in memory is no longer what is on the disk.
    #[error("writing to the run in {} has failed before: open it again to go on", path.display())]
    Broken {
        /// The run directory.
        path: PathBuf,
    },
    /// A file could not be written whole.
    #[error(transparent)]
    Write(#[from] files::Error),
    /// The operating system refused.
    #[error("could not {action} {}: {source}", path.display())]
    Io {
        /// What was attempted.
        action: &'static str,
        /// On which file.
        path: PathBuf,
        /// Why it failed.
        source: io::Error,
    },
    /// Signals cannot be caught.
    #[error("could not catch the signals that interrupt the program: {source}")]
    Signals {
        /// Why not.
        source: io::Error,
    },
}

/// How a file differs from what was committed.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Damage {
    /// It is not there.
    Missing,
    /// It is a folder, a link or the like.
    NotAFile,
    /// It is shorter or longer, in bytes.
    Length {
        /// The length now.
        found: u64,
        /// The length that it should have.
        expected: u64,
    },
    /// Its checksum is another one.
    Checksum,
    /// It does not follow its format.
    Content(String),
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => write!(f, "it is missing"),
            Self::NotAFile => write!(f, "it is not an ordinary file"),
            Self::Length { found, expected } => {
                write!(f, "it has {found} bytes where it should have {expected}")
            }
            Self::Checksum => write!(f, "its checksum is wrong"),
            Self::Content(what) => write!(f, "{what}"),
        }
    }
}

fn advice(fallback: Option<u64>) -> String {
    match fallback {
        Some(step) => format!("the run can be recovered from step {step}"),
        None => "restore it from a copy, or start a new run in another folder".to_owned(),
    }
}

/// What a parser says about bytes that nobody has written: quotations made one line, and short.
pub(crate) fn one_line(text: impl fmt::Display) -> String {
    let text = text.to_string();
    let plain = |c: char| if c.is_control() { ' ' } else { c };
    let mut line: String = text.chars().take(300).map(plain).collect();
    if line.len() < text.len() {
        line.push('…');
    }
    line
}

impl Damage {
    /// Content that a parser of JSON has refused.
    pub(crate) fn json(what: &str, error: &serde_json::Error) -> Self {
        Self::Content(one_line(format_args!("{what} is not as expected: {error}")))
    }
}

impl Error {
    /// Damage of a file on its own, as seen by a reader that knows of no other files.
    pub(crate) fn damaged(path: impl Into<PathBuf>, damage: Damage) -> Self {
        Self::Damaged {
            path: path.into(),
            damage,
            fallback: None,
        }
    }

    /// An error of the operating system, for `map_err`.
    pub(crate) fn io(
        action: &'static str,
        path: impl Into<PathBuf>,
    ) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io {
            action,
            path,
            source,
        }
    }
}
