use thiserror::Error as ThisError;

/// What can go wrong in a finite-element step.
#[derive(Clone, Debug, PartialEq, ThisError)]
pub enum Error {
    /// A parameter out of range.
    #[error("{name} = {value:e} is out of range: {expected}")]
    Parameter {
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        expected: &'static str,
    },
    /// The time step is so large that the implicit step has no unique solution.
    #[error(
        "tautilde = {step:e} is too large for eps = {eps:e}: the implicit step needs tautilde < 8/9 eps^2 = {bound:e}"
    )]
    StepTooLarge {
        /// `tautilde`.
        step: f64,
        /// `eps`.
        eps: f64,
        /// `8/9 eps^2`.
        bound: f64,
    },
    /// An inner iteration ended above its tolerance.
    #[error(
        "{solver} stopped after {iterations} iterations at a relative residual of {residual:.1e}, above {tolerance:.1e}"
    )]
    NotConverged {
        /// Which iteration.
        solver: &'static str,
        /// Iterations done.
        iterations: usize,
        /// Where it stopped.
        residual: f64,
        /// What was asked for.
        tolerance: f64,
    },
    /// A value became NaN or infinite.
    #[error("{field} is not finite in {solver}")]
    NonFinite {
        /// Which quantity.
        field: &'static str,
        /// Where.
        solver: &'static str,
    },
    /// The sparse factorization failed.
    #[error("the sparse Cholesky factorization of {unknowns} unknowns failed: {reason}")]
    Factorization {
        /// Size of the matrix.
        unknowns: usize,
        /// What the library says.
        reason: String,
    },
}
