#![allow(missing_docs, reason = "messages and names say it")]

use thiserror::Error as ThisError;

/// What can go wrong before an operation runs.
#[derive(Clone, Debug, PartialEq, ThisError)]
pub enum Error {
    #[error("unknown device '{name}': this program was built with {compiled}")]
    UnknownDevice { name: String, compiled: String },
    #[error(
        "device '{name}' is not compiled in (available: {compiled}); rebuild with --features {name}"
    )]
    NotCompiled {
        name: &'static str,
        compiled: String,
    },
    #[error("device '{name}' cannot be used: {reason}")]
    Unavailable { name: &'static str, reason: String },
    #[error(
        "device '{name}' computes wrongly: {operation} differs from the CPU by {difference:.1e} (limit {limit:.0e})"
    )]
    WrongArithmetic {
        name: &'static str,
        operation: &'static str,
        difference: f64,
        limit: f64,
    },
    #[error("a result could not be read from the device: {reason}")]
    Read { reason: String },
    #[error("a table needs a finite interval and cells, got [{low}, {high}] with {cells} cells")]
    TableRange { low: f64, high: f64, cells: usize },
    #[error("the function to tabulate is not finite at {at}")]
    NonFiniteTable { at: f64 },
}
