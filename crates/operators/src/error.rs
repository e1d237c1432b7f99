#![allow(missing_docs, reason = "messages and names say it")]

use thiserror::Error as ThisError;

/// What can go wrong before an operation runs.
#[derive(Clone, Debug, PartialEq, ThisError)]
pub enum Error {
    /// The name is not a device.
    #[error("unknown device '{name}': this program was built with {compiled}")]
    UnknownDevice { name: String, compiled: String },
    /// A device of the right name, but its backend was not compiled in.
    #[error(
        "device '{name}' is not compiled in (available: {compiled}); rebuild with --features {name}"
    )]
    NotCompiled {
        name: &'static str,
        compiled: String,
    },
    /// The device could not be opened.
    #[error("device '{name}' cannot be used: {reason}")]
    Unavailable { name: &'static str, reason: String },
    /// The device's arithmetic disagrees with the CPU.
    #[error(
        "device '{name}' computes wrongly: {operation} differs from the CPU by {difference:.1e} (limit {limit:.0e})"
    )]
    WrongArithmetic {
        name: &'static str,
        operation: &'static str,
        difference: f64,
        limit: f64,
    },
    /// A tensor could not be read back.
    #[error("a result could not be read from the device: {reason}")]
    Read { reason: String },
    /// A grid that cannot be divided into bricks.
    #[error(
        "a grid of {cells} cells per side cannot be divided into bricks of {side}; take a multiple of {side} cells, or store the whole grid"
    )]
    Bricks { cells: usize, side: usize },
    /// An empty or non-finite table interval.
    #[error("a table needs a finite interval and cells, got [{low}, {high}] with {cells} cells")]
    TableRange { low: f64, high: f64, cells: usize },
    /// The tabulated function is not finite.
    #[error("the function to tabulate is not finite at {at}")]
    NonFiniteTable { at: f64 },
}
