#![allow(missing_docs, reason = "messages and names say it")]

use thiserror::Error as ThisError;

/// What can go wrong in a finite-element step.
#[derive(Debug, ThisError)]
pub enum Error {
    #[error(
        "tautilde = {step:e} is too large for eps = {eps:e}: the implicit step needs tautilde < 8/9 eps^2 = {bound:e}"
    )]
    StepTooLarge {
        /// `tautilde`.
        step: f64,
        eps: f64,
        /// `8/9 eps^2`.
        bound: f64,
    },
    #[error(
        "{solver} stopped after {iterations} iterations at a relative residual of {residual:.1e}, above {tolerance:.1e}"
    )]
    NotConverged {
        solver: &'static str,
        iterations: usize,
        residual: f64,
        tolerance: f64,
    },
    #[error("{field} is not finite in {solver}")]
    NonFinite {
        field: &'static str,
        solver: &'static str,
    },
    #[error("the sparse Cholesky factorization of {unknowns} unknowns failed: {reason}")]
    Factorization { unknowns: usize, reason: String },
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
}
