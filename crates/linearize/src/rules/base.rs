//! Moving data around: views, selections, concatenations. All are linear in their float arguments.

use burn::backend::ir::{BaseOperationIr as Base, MaskFillOpIr, OperationIr, ScalarIr};
use burn::tensor::IndexingUpdateOp;

use super::Context;
use crate::tangent::Tangent;

pub(super) fn jvp(cx: &mut Context, whole: &OperationIr, op: &Base) -> Option<Vec<Tangent>> {
    let one = match op {
        Base::Reshape(s) | Base::Expand(s) => cx.linear(whole, &s.input),
        Base::SwapDims(s) => cx.linear(whole, &s.input),
        Base::Permute(s) => cx.linear(whole, &s.input),
        Base::Flip(s) => cx.linear(whole, &s.input),
        Base::Unfold(s) => cx.linear(whole, &s.input),
        Base::Slice(s) => cx.linear(whole, &s.tensor),
        Base::Select(s) => cx.linear(whole, &s.tensor),
        Base::Gather(s) => cx.linear(whole, &s.tensor),
        Base::GatherNd(s) => cx.linear(whole, &s.data),
        Base::RepeatDim(s) => cx.linear(whole, &s.tensor),
        Base::Cast(s) => cx.linear(whole, &s.input),
        Base::SliceAssign(s) => cx.jointly_linear(whole, &[&s.tensor, &s.value]),
        Base::SelectAssign(s) if overwrites(s.update) => {
            cx.jointly_linear(whole, &[&s.tensor, &s.value])
        }
        Base::Scatter(s) if overwrites(s.update) => {
            cx.jointly_linear(whole, &[&s.tensor, &s.value])
        }
        Base::ScatterNd(s) if overwrites(s.reduction) => {
            cx.jointly_linear(whole, &[&s.data, &s.values])
        }
        Base::MaskWhere(s) => cx.jointly_linear(whole, &[&s.tensor, &s.value]),
        Base::MaskFill(s) => {
            let filled = MaskFillOpIr {
                value: ScalarIr::Float(0.0),
                ..s.clone()
            };
            cx.linear(&OperationIr::BaseFloat(Base::MaskFill(filled)), &s.tensor)
        }
        Base::Cat(c) => cx.jointly_linear(whole, &c.tensors.iter().collect::<Vec<_>>()),
        // Not real.
        Base::Equal(_)
        | Base::EqualElem(_)
        | Base::NotEqual(_)
        | Base::NotEqualElem(_)
        | Base::All(_)
        | Base::Any(_)
        | Base::AllDim(_)
        | Base::AnyDim(_) => None,
        _ => return None,
    };
    Some(vec![one])
}

fn overwrites(update: IndexingUpdateOp) -> bool {
    matches!(update, IndexingUpdateOp::Add | IndexingUpdateOp::Assign)
}
