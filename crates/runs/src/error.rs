//! The one error type of the crate.

#![allow(missing_docs, reason = "messages and names say it")]

use std::io;
use std::path::PathBuf;

/// What can go wrong with a run directory. Every message is one line and says what to do.
///
/// Whatever went wrong, the directory on the disk is that of the last commit and can be opened
/// again, except where the error says that it is damaged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error(
        "cannot start a run in {}: it holds {found}; resume the run that is there, or give an empty \
         folder, or one that does not exist", path.display()
    )]
    Occupied { path: PathBuf, found: String },
    #[error("{} holds no run (no checkpoint): start one there, or give another folder", .0.display())]
    NoRun(PathBuf),
    #[error("another process works on the run in {}: wait for it or stop it", .0.display())]
    Locked(PathBuf),
    #[error("{} is damaged: {what}; {}", path.display(), advice(*.fallback))]
    Damaged {
        path: PathBuf,
        what: String,
        /// The step from which [`RunDirectory::recover`](crate::RunDirectory::recover) can go on.
        fallback: Option<u64>,
    },
    #[error(
        "{} has format version {found}, this program reads version {supported}: finish the run with \
         the version of the program that made it, or start a new run in another folder", path.display()
    )]
    Version {
        path: PathBuf,
        found: u32,
        supported: u32,
    },
    /// A state that cannot be committed, a file that cannot be stored, and the like: a mistake of the
    /// calling program, which changes nothing.
    #[error("{0}")]
    Invalid(String),
    #[error(transparent)]
    Io(#[from] files::Error),
    #[error("could not catch the signals that interrupt the program: {0}")]
    Signals(#[source] io::Error),
}

fn advice(fallback: Option<u64>) -> String {
    match fallback {
        Some(step) => format!("the run can be recovered from step {step}"),
        None => "restore it from a copy, or start a new run in another folder".to_owned(),
    }
}

impl Error {
    /// Damage as seen by a reader that knows of no other files.
    pub(crate) fn damaged(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::Damaged {
            path: path.into(),
            what: what.into(),
            fallback: None,
        }
    }

    pub(crate) fn file(name: &str, reason: &str) -> Self {
        let shown = files::shortened(name, 600);
        Self::Invalid(format!("{shown:?} cannot be stored: {reason}"))
    }
}
