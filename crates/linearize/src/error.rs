//! What can go wrong between a traced function and its Hessian-vector product.

#![allow(missing_docs, reason = "messages and names say it")]

/// Errors of tracing, linearizing and replaying.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error(
        "no differentiation rule for operation `{operation}`: write the function with other \
         operations, or register a rule with `Extensions::rule` if it is a custom operation"
    )]
    NoRule { operation: String },
    #[error(
        "the rule of custom operation `{operation}` must give a tangent or none for each output, \
         of its shape"
    )]
    Rule { operation: String },
    #[error(
        "no handler for custom operation `{operation}` on {backend}: register one in \
         `Extensions::{backend}`"
    )]
    NoHandler {
        operation: String,
        backend: &'static str,
    },
    /// Burn's capture device refused the traced function.
    #[error("tracing failed: {reason}")]
    Capture { reason: String },
    #[error(
        "output {index} of the traced function does not live on the tracing device \
         (found {found}): create constants on `Inputs::device` and move data there"
    )]
    OutputDevice { index: usize, found: String },
    #[error("the traced function must return one number, shape [1], but has shape {shape:?}")]
    NotScalar { shape: Vec<usize> },
    #[error("the traced function has no outputs")]
    NoOutputs,
    #[error("expected a tensor with {expected} axes, found {found}")]
    Rank { expected: usize, found: usize },
    /// Inputs differ from those the graph was traced with in number, shape or element type, or do not live on the program's backend.
    #[error("{input}: expected {expected}, found {found}")]
    Input {
        /// "variables" or "variable 0", and so on for parameters and directions.
        input: String,
        expected: String,
        found: String,
    },
    #[error("cannot replay on device {device}: enable the feature of its backend")]
    Device { device: String },
    /// [`apply`](crate::Linearization::apply) needs a point.
    #[error("no point to apply the linearization at: call `at` first")]
    NotEvaluated,
}
