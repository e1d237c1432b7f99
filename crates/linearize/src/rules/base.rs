//! Moving data around: views, selections, concatenations. All are linear in their float arguments.

use burn::backend::ir::{
    BaseOperationIr as Base, CatOpIr, MaskFillOpIr, MaskWhereOpIr, OperationIr, ScalarIr,
    ScatterNdOpIr, ScatterOpIr, SelectAssignOpIr, SliceAssignOpIr, TensorIr,
};
use burn::tensor::IndexingUpdateOp;

use super::Context;
use crate::ir::each_tensor;
use crate::tangent::Tangent;

pub(super) fn jvp(cx: &mut Context, op: &Base) -> Option<Vec<Tangent>> {
    let wrap = OperationIr::BaseFloat;
    let one = match op {
        Base::Reshape(s) | Base::Expand(s) => unary(cx, op, &s.input),
        Base::SwapDims(s) => unary(cx, op, &s.input),
        Base::Permute(s) => unary(cx, op, &s.input),
        Base::Flip(s) => unary(cx, op, &s.input),
        Base::Unfold(s) => unary(cx, op, &s.input),
        Base::Slice(s) => unary(cx, op, &s.tensor),
        Base::Select(s) => unary(cx, op, &s.tensor),
        Base::Gather(s) => unary(cx, op, &s.tensor),
        Base::GatherNd(s) => unary(cx, op, &s.data),
        Base::RepeatDim(s) => unary(cx, op, &s.tensor),
        Base::Cast(s) => unary(cx, op, &s.input),
        Base::SliceAssign(s) => pair(cx, &s.tensor, &s.value, |tensor, value| {
            wrap(Base::SliceAssign(SliceAssignOpIr {
                tensor,
                value,
                ..s.clone()
            }))
        }),
        Base::SelectAssign(s) if overwrites(s.update) => {
            pair(cx, &s.tensor, &s.value, |tensor, value| {
                wrap(Base::SelectAssign(SelectAssignOpIr {
                    tensor,
                    value,
                    ..s.clone()
                }))
            })
        }
        Base::Scatter(s) if overwrites(s.update) => {
            pair(cx, &s.tensor, &s.value, |tensor, value| {
                wrap(Base::Scatter(ScatterOpIr {
                    tensor,
                    value,
                    ..s.clone()
                }))
            })
        }
        Base::ScatterNd(s) if overwrites(s.reduction) => {
            pair(cx, &s.data, &s.values, |data, values| {
                wrap(Base::ScatterNd(ScatterNdOpIr {
                    data,
                    values,
                    ..s.clone()
                }))
            })
        }
        Base::MaskWhere(s) => pair(cx, &s.tensor, &s.value, |tensor, value| {
            wrap(Base::MaskWhere(MaskWhereOpIr {
                tensor,
                value,
                ..s.clone()
            }))
        }),
        Base::MaskFill(s) => cx.d(&s.tensor).map(|e| {
            cx.build.linear(e, |tensor| {
                wrap(Base::MaskFill(MaskFillOpIr {
                    tensor,
                    value: ScalarIr::Float(0.0),
                    ..s.clone()
                }))
            })
        }),
        Base::Cat(c) => {
            let arguments = c.tensors.iter().map(|t| (cx.d(t), t)).collect();
            cx.build.jointly_linear(arguments, |tensors| {
                wrap(Base::Cat(CatOpIr {
                    tensors,
                    ..c.clone()
                }))
            })
        }
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

/// The same operation on the tangent of its one float argument.
fn unary(cx: &mut Context, op: &Base, input: &TensorIr) -> Tangent {
    let mut operation = OperationIr::BaseFloat(op.clone());
    cx.d(input).map(|e| {
        cx.build.linear(e, |tangent| {
            each_tensor(&mut operation, |t| {
                if t.id == input.id {
                    t.id = tangent.id;
                }
            });
            operation
        })
    })
}

fn pair(
    cx: &mut Context,
    a: &TensorIr,
    b: &TensorIr,
    make: impl FnOnce(TensorIr, TensorIr) -> OperationIr,
) -> Tangent {
    let arguments = vec![(cx.d(a), a), (cx.d(b), b)];
    cx.build.jointly_linear(arguments, |tangents| {
        let mut tangents = tangents.into_iter();
        let mut next = || tangents.next().expect("two arguments give two tangents");
        let first = next();
        make(first, next())
    })
}
