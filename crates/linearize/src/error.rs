//! What can go wrong between a traced function and its Hessian-vector product.

#![allow(missing_docs, reason = "messages and names say it")]

use burn::tensor::DType;

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
    #[error("the rule of custom operation `{operation}` is wrong: {reason}")]
    Rule { operation: String, reason: String },
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
    /// Not as many tensors as the graph was traced with.
    #[error("expected {expected} {role}, found {found}")]
    Count {
        /// "variables", "parameters" or "directions".
        role: &'static str,
        expected: usize,
        found: usize,
    },
    /// A tensor's shape differs from the one the graph was traced with.
    #[error("{role} {index}: expected shape {expected:?}, found {found:?}; trace again")]
    Shape {
        /// "variable", "parameter" or "direction".
        role: &'static str,
        index: usize,
        expected: Vec<usize>,
        found: Vec<usize>,
    },
    /// A tensor's element type differs from the one the graph was traced with.
    #[error("{role} {index}: expected elements of type {expected:?}, found {found:?}")]
    DType {
        /// "variable", "parameter" or "direction".
        role: &'static str,
        index: usize,
        expected: DType,
        found: DType,
    },
    /// A tensor lives on another backend than the program, or is tracked by autodiff.
    #[error("{role} {index} does not live on the program's backend: {reason}")]
    Backend {
        /// "variable", "parameter" or "direction".
        role: &'static str,
        index: usize,
        reason: String,
    },
    /// Replaying on this device is not compiled in.
    #[error("cannot replay on device {device}: enable the feature of its backend")]
    Device { device: String },
    /// [`apply`](crate::Linearization::apply) needs a point.
    #[error("no point to apply the linearization at: call `at` first")]
    NotEvaluated,
}
