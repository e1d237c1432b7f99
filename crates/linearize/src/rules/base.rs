//! Moving data around: views, selections, concatenations. All are linear in their float arguments.

use burn::backend::ir::{BaseOperationIr as Base, MaskFillOpIr, OperationIr, ScalarIr};
use burn::tensor::IndexingUpdateOp;

use super::Context;
use crate::tangent::Tangent;

pub(super) fn jvp(cx: &mut Context, whole: &OperationIr, op: &Base) -> Option<Tangent> {
    Some(match op {
        Base::Reshape(_)
        | Base::Expand(_)
        | Base::SwapDims(_)
        | Base::Permute(_)
        | Base::Flip(_)
        | Base::Unfold(_)
        | Base::Slice(_)
        | Base::Select(_)
        | Base::Gather(_)
        | Base::GatherNd(_)
        | Base::RepeatDim(_)
        | Base::Cast(_) => cx.linear(whole),
        Base::SliceAssign(_) => cx.jointly_linear(whole, &[0, 1]),
        Base::SelectAssign(s) if overwrites(s.update) => cx.jointly_linear(whole, &[0, 2]),
        Base::Scatter(s) if overwrites(s.update) => cx.jointly_linear(whole, &[0, 2]),
        Base::ScatterNd(s) if overwrites(s.reduction) => cx.jointly_linear(whole, &[0, 2]),
        Base::MaskWhere(_) => cx.jointly_linear(whole, &[0, 2]),
        Base::MaskFill(s) => {
            let filled = MaskFillOpIr {
                value: ScalarIr::Float(0.0),
                ..s.clone()
            };
            cx.linear(&OperationIr::BaseFloat(Base::MaskFill(filled)))
        }
        Base::Cat(c) => cx.jointly_linear(whole, &(0..c.tensors.len()).collect::<Vec<_>>()),
        _ => return None,
    })
}

fn overwrites(update: IndexingUpdateOp) -> bool {
    matches!(update, IndexingUpdateOp::Add | IndexingUpdateOp::Assign)
}
