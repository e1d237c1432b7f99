//! Small helpers over Burn's intermediate representation.

use std::collections::HashMap;

use burn::backend::ir::{IrVisitorMut, OperationIr, TensorId, TensorIr, TensorStatus};
use burn::tensor::{DType, Shape};

/// First identifier of tensors converted to the precision of the tangent program.
pub(crate) const CAST_IDS: u64 = 1 << 28;
/// First identifier of tensors of the tangent program.
pub(crate) const TANGENT_IDS: u64 = 1 << 32;
/// First identifier of unevaluated tangent expressions.
pub(crate) const EXPRESSION_IDS: u64 = 1 << 48;

pub(crate) fn tensor(id: u64, shape: Shape, dtype: DType) -> TensorIr {
    TensorIr::uninit(TensorId::new(id), shape, dtype)
}

/// `like` with another status.
pub(crate) fn with_status(like: &TensorIr, status: TensorStatus) -> TensorIr {
    TensorIr {
        status,
        ..like.clone()
    }
}

pub(crate) fn read_only(tensor: &TensorIr) -> TensorIr {
    with_status(tensor, TensorStatus::ReadOnly)
}

/// A description of an output whose identifier the emitter will choose.
pub(crate) fn output(shape: Shape, dtype: DType) -> TensorIr {
    tensor(u64::MAX, shape, dtype)
}

pub(crate) fn like(tensor: &TensorIr) -> TensorIr {
    output(tensor.shape.clone(), tensor.dtype)
}

/// Name of an operation, for messages and statistics: `Mul`, `SumDim`, or a custom identifier.
pub(crate) fn name(operation: &OperationIr) -> String {
    if let OperationIr::Custom(custom) = operation {
        return custom.id.clone();
    }
    // `NumericFloat(F64, Mul(BinaryOpIr { … }))`: the word before the description.
    let debug = format!("{operation:?}");
    let head = debug.split(" {").next().unwrap_or_default();
    let mut words = head.split(['(', ',', ' ']).filter(|word| !word.is_empty());
    match (words.next_back(), words.next_back()) {
        (_, Some(name)) | (Some(name), None) => name.to_owned(),
        (None, None) => "unknown".to_owned(),
    }
}

struct EachTensor<F>(F);

impl<F: FnMut(&mut TensorIr)> IrVisitorMut for EachTensor<F> {
    fn visit_tensor_mut(&mut self, tensor: &mut TensorIr) {
        (self.0)(tensor);
    }
}

/// Call `f` on every tensor of `operation`, inputs and outputs.
pub(crate) fn each_tensor(operation: &mut OperationIr, f: impl FnMut(&mut TensorIr)) {
    operation.visit_mut(&mut EachTensor(f));
}

/// Give the outputs placeholder identifiers, numbered in the order of visits, and make the inputs
/// read-only: the form in which operations are compared, and in which an emitter takes them.
pub(crate) fn detach_outputs(operation: &mut OperationIr) {
    let outputs: Vec<TensorId> = operation.outputs().map(|out| out.id).collect();
    let mut position = 0;
    each_tensor(operation, |tensor| {
        if outputs.contains(&tensor.id) {
            tensor.id = TensorId::new(u64::MAX - position);
            tensor.status = TensorStatus::NotInit;
            position += 1;
        } else {
            tensor.status = TensorStatus::ReadOnly;
        }
    });
}

/// Replace tensors by their image under `map`, keeping the ones without an image.
pub(crate) fn rename(operation: &mut OperationIr, map: &HashMap<TensorId, TensorIr>) {
    each_tensor(operation, |tensor| {
        if let Some(image) = map.get(&tensor.id) {
            tensor.id = image.id;
        }
    });
}

/// The operation with other tensors for its inputs at these places.
pub(crate) fn with_inputs(
    operation: &OperationIr,
    places: &[usize],
    tensors: &[TensorIr],
) -> OperationIr {
    let mut operation = operation.clone();
    let mut position = 0;
    // Inputs are visited before outputs, in their order.
    each_tensor(&mut operation, |tensor| {
        if let Some(i) = places.iter().position(|place| *place == position) {
            tensor.id = tensors[i].id;
        }
        position += 1;
    });
    operation
}
