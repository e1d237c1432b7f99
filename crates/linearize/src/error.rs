//! What can go wrong between a traced function and its Hessian-vector product.

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
    NoRule {
        /// Name of the operation, or identifier of the custom operation.
        operation: String,
    },
    /// A rule returned something that does not fit its operation.
    #[error("the rule of custom operation `{operation}` is wrong: {reason}")]
    Rule {
        /// Identifier of the custom operation.
        operation: String,
        /// What does not fit.
        reason: String,
    },
    /// A program contains a custom operation that the backend has no handler for.
    #[error(
        "no handler for custom operation `{operation}` on {backend}: register one with \
         `Extensions::on_{backend}`"
    )]
    NoHandler {
        /// Identifier of the custom operation.
        operation: String,
        /// Lower-case name of the backend.
        backend: &'static str,
    },
    /// Burn's capture device refused the traced function.
    #[error("tracing failed: {reason}")]
    Capture {
        /// The reason given by the capture device.
        reason: String,
    },
    /// A traced function returned a tensor that is not derived from its inputs' device.
    #[error(
        "output {index} of the traced function does not live on the tracing device \
         (found {found}): create constants on `Inputs::device` and move data there"
    )]
    OutputDevice {
        /// Index of the output.
        index: usize,
        /// Device of the output.
        found: String,
    },
    /// The energy is not a single number.
    #[error("the traced function must return one number, shape [1], but has shape {shape:?}")]
    NotScalar {
        /// Shape of the returned tensor.
        shape: Vec<usize>,
    },
    /// A traced function returned nothing.
    #[error("the traced function has no outputs")]
    NoOutputs,
    /// A tensor has the wrong number of axes.
    #[error("expected a tensor with {expected} axes, found {found}")]
    Rank {
        /// Number of axes asked for.
        expected: usize,
        /// Number of axes of the tensor.
        found: usize,
    },
    /// Not as many tensors as the graph was traced with.
    #[error("expected {expected} {role}, found {found}")]
    Count {
        /// "variables", "parameters" or "directions".
        role: &'static str,
        /// Number of tensors the graph was traced with.
        expected: usize,
        /// Number of tensors given.
        found: usize,
    },
    /// A tensor's shape differs from the one the graph was traced with.
    #[error("{role} {index}: expected shape {expected:?}, found {found:?}; trace again")]
    Shape {
        /// "variable", "parameter" or "direction".
        role: &'static str,
        /// Index of the tensor.
        index: usize,
        /// Traced shape.
        expected: Vec<usize>,
        /// Shape given.
        found: Vec<usize>,
    },
    /// A tensor's element type differs from the one the graph was traced with.
    #[error("{role} {index}: expected elements of type {expected:?}, found {found:?}")]
    DType {
        /// "variable", "parameter" or "direction".
        role: &'static str,
        /// Index of the tensor.
        index: usize,
        /// Traced element type.
        expected: DType,
        /// Element type given.
        found: DType,
    },
    /// A tensor lives on another backend than the program, or is tracked by autodiff.
    #[error("{role} {index} does not live on the program's backend: {reason}")]
    Backend {
        /// "variable", "parameter" or "direction".
        role: &'static str,
        /// Index of the tensor.
        index: usize,
        /// Burn's description of the mismatch.
        reason: String,
    },
    /// Replaying on this device is not compiled in.
    #[error("cannot replay on device {device}: enable the feature of its backend")]
    Device {
        /// Debug name of the device.
        device: String,
    },
    /// [`apply`](crate::Linearization::apply) needs a point.
    #[error("no point to apply the linearization at: call `at` first")]
    NotEvaluated,
}
