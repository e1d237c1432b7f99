use thiserror::Error as ThisError;

/// What can go wrong before an operation runs.
#[derive(Clone, Debug, PartialEq, ThisError)]
pub enum Error {
    /// The name is not a device.
    #[error("unknown device '{name}': this program was built with {compiled}")]
    UnknownDevice {
        /// What was asked for.
        name: String,
        /// The devices compiled in.
        compiled: String,
    },
    /// A device of the right name, but its backend was not compiled in.
    #[error(
        "device '{name}' is not compiled in (available: {compiled}); rebuild with --features {name}"
    )]
    NotCompiled {
        /// What was asked for.
        name: &'static str,
        /// The devices compiled in.
        compiled: String,
    },
    /// The device could not be opened.
    #[error("device '{name}' cannot be used: {reason}")]
    Unavailable {
        /// The device.
        name: &'static str,
        /// The message of the driver.
        reason: String,
    },
    /// The device's arithmetic disagrees with the CPU.
    #[error(
        "device '{name}' computes wrongly: {operation} differs from the CPU by {difference:.1e} (limit {limit:.0e})"
    )]
    WrongArithmetic {
        /// The device.
        name: &'static str,
        /// What was computed.
        operation: &'static str,
        /// Largest difference seen.
        difference: f64,
        /// Largest difference accepted.
        limit: f64,
    },
    /// A tensor could not be read back.
    #[error("a result could not be read from the device: {reason}")]
    Read {
        /// The message of the backend.
        reason: String,
    },
    /// A grid that cannot be divided into bricks.
    #[error(
        "a grid of {cells} cells per side cannot be divided into bricks of {side}; take a multiple of {side} cells, or store the whole grid"
    )]
    Bricks {
        /// Cells per axis of the grid.
        cells: usize,
        /// Cells per axis of a brick.
        side: usize,
    },
    /// An empty or non-finite table interval.
    #[error("a table needs a finite interval and cells, got [{low}, {high}] with {cells} cells")]
    TableRange {
        /// Left end.
        low: f64,
        /// Right end.
        high: f64,
        /// Number of cells.
        cells: usize,
    },
    /// The tabulated function is not finite.
    #[error("the function to tabulate is not finite at {at}")]
    NonFiniteTable {
        /// Where.
        at: f64,
    },
}
