//! Custom operations: how they differentiate, and how each backend runs them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use burn::backend::BackendTypes;
use burn::backend::ir::{BackendIr, CustomOpIr, HandleContainer, ScalarIr, TensorIr};
use burn::backend::tensor::FloatTensor;

use crate::tangent::{Builder, Tangents};

/// Forward-mode rule of a custom operation.
///
/// A rule maps the tangents of the inputs (`None` is zero) to the tangents of the outputs. It may
/// add operations to the primal program, which runs once per point, and builds tangents, which must
/// depend linearly on the given ones; [`multilinear`](crate::multilinear) is the rule of an operation that is linear in each of
/// its inputs. It gives [`Error::NoRule`](crate::Error::NoRule) if this combination of active inputs cannot be differentiated.
///
/// A pointwise function `f⁽ᵏ⁾(x)` whose order `k` is a scalar argument differentiates to
/// `f⁽ᵏ⁺¹⁾(x) ⊙ ẋ`:
///
/// ```
/// use burn_linearize::{Extensions, ScalarIr};
/// let mut extensions = Extensions::new();
/// extensions.rule("pointwise", |operation: &burn_linearize::CustomOpIr,
///                               tangents: &[Option<burn_linearize::TensorIr>],
///                               build: &mut burn_linearize::Builder| {
///     let Some(tangent) = &tangents[0] else { return Ok(vec![None]) };
///     let order = operation.scalars[0].elem::<u64>();
///     let mut derivative = operation.clone();
///     derivative.scalars[0] = ScalarIr::UInt(order + 1);
///     let derivative = build.primal(derivative);
///     Ok(vec![Some(build.mul(&derivative, tangent))])
/// });
/// ```
pub type Rule = dyn Fn(&CustomOpIr, &[Option<TensorIr>], &mut Builder) -> Tangents + Send + Sync;

/// Handlers of custom operations on backend `B`, by identifier.
///
/// Burn's registry of the same name, which additionally knows what it contains, so that a missing
/// handler is an [error](crate::Error::NoHandler) when a program is loaded rather than a panic when it
/// runs.
#[derive(Clone, Default)]
pub struct CustomOpRegistry<B: BackendIr> {
    pub(crate) handlers: burn_router::CustomOpRegistry<B>,
    pub(crate) known: BTreeSet<String>,
}

impl<B: BackendIr> CustomOpRegistry<B> {
    /// Run operations called `id` with `handler`, which reads the inputs from the container and
    /// registers the outputs in it. Replaces an earlier handler of the same name.
    pub fn register<F>(&mut self, id: &str, handler: F)
    where
        F: Fn(&mut HandleContainer<B::Handle>, &CustomOpIr, &<B as BackendTypes>::Device)
            + Send
            + Sync
            + 'static,
    {
        self.handlers.register(id, handler);
        self.known.insert(id.to_owned());
    }

    /// Run operations called `id`, which have one output, by a function of their inputs and scalars.
    pub fn register_function<const N: usize>(
        &mut self,
        id: &str,
        function: impl Fn([FloatTensor<B>; N], &[ScalarIr]) -> FloatTensor<B> + Send + Sync + 'static,
    ) {
        self.register(id, move |handles, operation, _| {
            let input = |i: usize| handles.get_float_tensor::<B>(&operation.inputs[i]);
            let output = function(std::array::from_fn(input), &operation.scalars);
            handles.register_float_tensor::<B>(&operation.outputs[0].id, output);
        });
    }
}

/// Differentiation rules and per-backend handlers of custom (backend-extension) operations.
#[derive(Clone, Default)]
pub struct Extensions {
    pub(crate) rules: BTreeMap<String, Arc<Rule>>,
    /// Handlers on the Flex backend.
    #[cfg(feature = "flex")]
    pub flex: CustomOpRegistry<burn::backend::Flex>,
    /// Handlers on the `NdArray` backend.
    #[cfg(feature = "ndarray")]
    #[allow(
        deprecated,
        reason = "burn deprecates the backend, which we still offer"
    )]
    pub ndarray: CustomOpRegistry<burn::backend::NdArray>,
    /// Handlers on the `CubeCL` backend (wgpu, CUDA).
    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    pub cube: CustomOpRegistry<burn::backend::Cube>,
}

impl Extensions {
    /// No custom operations.
    pub fn new() -> Self {
        Self::default()
    }

    /// Differentiate custom operations called `id` with `rule`.
    pub fn rule<F>(&mut self, id: &str, rule: F) -> &mut Self
    where
        F: Fn(&CustomOpIr, &[Option<TensorIr>], &mut Builder) -> Tangents + Send + Sync + 'static,
    {
        self.rules.insert(id.to_owned(), Arc::new(rule));
        self
    }
}
