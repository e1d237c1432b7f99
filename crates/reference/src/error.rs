//! Everything that can go wrong in this crate.

#![allow(missing_docs, reason = "messages and names say it")]

/// Errors of shapes, flows and equilibria.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error("{name} must be {requirement}, got {value}")]
    InvalidParameter {
        name: &'static str,
        requirement: &'static str,
        value: f64,
    },
    #[error(
        "the curve turns by {turning:.3} times 2 pi where a simple closed curve turns once; give its points in order, without crossings or cusps"
    )]
    Turning {
        /// Total turning over `2 pi`.
        turning: f64,
    },
    #[error(
        "no self-similar solution found at a corner of exterior angle {angle:.4}; the last Newton step was {residual:.1e}"
    )]
    Corner {
        angle: f64,
        /// Largest entry of the last Newton step.
        residual: f64,
    },
    #[error(
        "time {time:.3e} is before {first:.3e}, when the polygon starts with rounded corners; take a smaller rounding"
    )]
    TooEarly { time: f64, first: f64 },
    #[error(
        "times must be finite, not negative and in increasing order, got {time} after {before}"
    )]
    TimesNotIncreasing { time: f64, before: f64 },
    #[error(
        "{points} points do not resolve the curve at time {time:.6e}; the flow may be singular there, or the start needs more points"
    )]
    Unresolved { points: usize, time: f64 },
    #[error("no time step meets the tolerance at time {time:.6e}; the flow may be singular there")]
    StepTooShort { time: f64 },
    #[error(
        "a surface of revolution needs a curve with positive x, or one symmetric about the y axis that starts on it"
    )]
    NoProfile,
    #[error(
        "no equilibrium found at ratio {ratio}: residual {residual:.2e} after {iterations} Newton steps; the branch may end before"
    )]
    NoEquilibrium {
        /// Reduced volume or isoperimetric quotient.
        ratio: f64,
        residual: f64,
        iterations: usize,
    },
}

/// The value, of which the requirement must hold.
pub(crate) fn checked(
    name: &'static str,
    requirement: &'static str,
    value: f64,
    holds: bool,
) -> Result<f64, Error> {
    let error = Error::InvalidParameter {
        name,
        requirement,
        value,
    };
    holds.then_some(value).ok_or(error)
}

pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64, Error> {
    let holds = value > 0.0 && value.is_finite();
    checked(name, "positive and finite", value, holds)
}

pub(crate) fn finite(points: &[[f64; 2]]) -> Result<(), Error> {
    for &x in points.iter().flatten() {
        checked("coordinate", "finite", x, x.is_finite())?;
    }
    Ok(())
}

/// Reduced volumes and isoperimetric quotients.
pub(crate) fn below_one(name: &'static str, value: f64) -> Result<f64, Error> {
    let holds = value > 0.0 && value < 1.0;
    checked(name, "between 0 and 1", value, holds)
}
