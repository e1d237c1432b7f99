//! What can go wrong between a traced function and its Hessian-vector product.

#![allow(missing_docs, reason = "messages and names say it")]

/// Errors of tracing, linearizing and replaying.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A tangent reaches an operation without a differentiation rule.
    #[error(
        "no differentiation rule for operation `{operation}`: write the function with other \
         operations, or register a rule with `Extensions::rule` if it is a custom operation"
    )]
    NoRule { operation: String },
    /// A rule returned something that does not fit its operation.
    #[error(
        "the rule of custom operation `{operation}` must give a tangent or none for each output, \
         of its shape"
    )]
    Rule { operation: String },
    /// A program contains a custom operation that the backend has no handler for.
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
    /// A traced function returned a tensor that is not derived from its inputs' device.
    #[error(
        "output {index} of the traced function does not live on the tracing device \
         (found {found}): create constants on `Inputs::device` and move data there"
    )]
    OutputDevice { index: usize, found: String },
    /// The energy is not a single number.
    #[error("the traced function must return one number, shape [1], but has shape {shape:?}")]
    NotScalar { shape: Vec<usize> },
    /// A traced function returned nothing.
    #[error("the traced function has no outputs")]
    NoOutputs,
    /// A tensor has the wrong number of axes.
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
    /// Replaying on this device is not compiled in.
    #[error("cannot replay on device {device}: enable the feature of its backend")]
    Device { device: String },
    /// [`apply`](crate::Linearization::apply) needs a point.
    #[error("no point to apply the linearization at: call `at` first")]
    NotEvaluated,
}
