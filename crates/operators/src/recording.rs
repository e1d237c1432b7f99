//! How extension operations are recorded: on the tape of autodiff, and in captured graphs.

use std::sync::Arc;

use burn::backend::{Backend, tensor::FloatTensor};
use burn_autodiff::{
    Autodiff,
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, NodeGuard, Ops, OpsKind},
};
use burn_backend::Shape;
use burn_capture::CaptureBackend;
use burn_ir::{CustomOpIr, OperationIr, OperationOutput, ScalarIr, TensorIr};
use burn_router::{RouterClient, RouterTensor};

/// The gradient with respect to an input, from that with respect to the result.
#[derive(Clone, derive_more::Debug)]
#[debug("Pullback")]
pub struct Pullback<B: Backend>(Arc<dyn Fn(FloatTensor<B>) -> FloatTensor<B> + Send + Sync>);

impl<B: Backend> Pullback<B> {
    /// A linear function of the gradient.
    pub fn new(of: impl Fn(FloatTensor<B>) -> FloatTensor<B> + Send + Sync + 'static) -> Self {
        Self(Arc::new(of))
    }
}

/// Puts the result of an operation on the tape, with a pullback for each of its inputs.
pub fn on_tape<B: Backend, C: CheckpointStrategy, const N: usize>(
    inputs: [NodeGuard; N],
    result: FloatTensor<B>,
    pullbacks: [Pullback<B>; N],
) -> FloatTensor<Autodiff<B, C>> {
    match Recorded.prepare::<C>(inputs).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => prepared.finish(pullbacks, result),
        OpsKind::UnTracked(prepared) => prepared.finish(result),
    }
}

#[derive(Debug)]
struct Recorded;

impl<B: Backend, const N: usize> Backward<B, N> for Recorded {
    type State = [Pullback<B>; N];

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let gradient = grads.consume::<B>(&ops.node);
        for (parent, Pullback(pullback)) in ops.parents.into_iter().zip(ops.state) {
            if let Some(parent) = parent {
                grads.register::<B>(parent.id, pullback(gradient.clone()));
            }
        }
    }
}

/// Records an operation with a result of this shape in a captured graph.
pub fn captured(
    id: &'static str,
    inputs: Vec<FloatTensor<CaptureBackend>>,
    shape: Shape,
    scalars: Vec<ScalarIr>,
) -> FloatTensor<CaptureBackend> {
    let client = inputs[0].client.clone();
    let inputs: Vec<TensorIr> = inputs.into_iter().map(RouterTensor::into_ir).collect();
    let output = TensorIr::uninit(client.create_empty_handle(), shape, inputs[0].dtype);
    let operation = CustomOpIr::with_scalars(id, &inputs, &[output], scalars);
    client.register(OperationIr::Custom(operation)).output()
}
