//! Arithmetic, reductions, comparisons, clamping.

use burn::backend::ir::{BaseOperationIr as Base, FloatOperationIr as Float};
use burn::backend::ir::{
    BinaryOpIr, CastOpIr, GatherOpIr, IntOperationIr, NumericOperationIr as Num, OperationIr,
    PadModeIr, ReduceDimWithIndicesOpIr, ScalarIr, ScalarOpIr, TensorIr,
};
use burn::tensor::DType;

use super::Context;
use crate::ir::{like, output, read_only};
use crate::tangent::{Builder, Tangent};

pub(super) fn jvp(
    cx: &mut Context,
    whole: &OperationIr,
    dtype: DType,
    op: &Num,
) -> Option<Tangent> {
    let wrap = move |op| OperationIr::NumericFloat(dtype, op);
    Some(match op {
        Num::Add(b) => {
            let (l, r) = spread_operands(cx, b);
            cx.build.plus(l, r)
        }
        Num::Sub(b) => {
            let (l, r) = spread_operands(cx, b);
            cx.build.plus(l, Builder::scaled(r, -1.0))
        }
        Num::Mul(b) => {
            let l = cx.times(&b.rhs, cx.d(&b.lhs), &b.out);
            let r = cx.times(&b.lhs, cx.d(&b.rhs), &b.out);
            cx.build.plus(l, r)
        }
        Num::Div(b) => {
            let reciprocal = cx.build.primal.powi(&b.rhs, -1);
            let l = cx.times(&reciprocal, cx.d(&b.lhs), &b.out);
            let r = cx.d(&b.rhs).and_then(|dr| {
                let slope = cx.build.primal.mul(&b.out, &reciprocal);
                cx.times(&slope, Some(dr), &b.out)
            });
            cx.build.plus(l, Builder::scaled(r, -1.0))
        }
        // l mod r = l − r ⌊l/r⌋
        Num::Rem(b) => {
            let l = cx.d(&b.lhs).map(|e| cx.build.spread(e, &b.out.shape));
            let r = cx.d(&b.rhs).and_then(|dr| {
                let quotient = cx.build.primal.div(&b.lhs, &b.rhs);
                let floor = cx.build.primal.unary(&quotient, Float::Floor);
                cx.times(&floor, Some(dr), &b.out)
            });
            cx.build.plus(l, Builder::scaled(r, -1.0))
        }
        Num::AddScalar(s) | Num::SubScalar(s) | Num::RemScalar(s) => cx.d(&s.lhs),
        Num::MulScalar(s) => Builder::scaled(cx.d(&s.lhs), s.rhs.elem()),
        Num::DivScalar(s) => Builder::scaled(cx.d(&s.lhs), 1.0 / s.rhs.elem::<f64>()),
        Num::Neg(u) => Builder::scaled(cx.d(&u.input), -1.0),
        Num::Abs(u) => {
            let sign = cx.build.primal.numeric(&u.input, Num::Sign);
            cx.times(&sign, cx.d(&u.input), &u.out)
        }
        Num::PowiScalar(s) => {
            let exponent: i64 = s.rhs.elem();
            let power = cx.build.primal.powi(&s.lhs, exponent - 1);
            Builder::scaled(cx.times(&power, cx.d(&s.lhs), &s.out), exponent as f64)
        }
        Num::Powi(b) => {
            let slope = powi_slope(cx, dtype, b);
            cx.times(&slope, cx.d(&b.lhs), &b.out)
        }
        // Indicator of `min ≤ x ≤ max`.
        Num::Clamp(c) => {
            let above = cx.indicator(&c.tensor, c.min, Num::GreaterEqualElem);
            let below = cx.indicator(&c.tensor, c.max, Num::LowerEqualElem);
            let inside = cx.build.primal.mul(&above, &below);
            cx.times(&inside, cx.d(&c.tensor), &c.out)
        }
        Num::ClampMin(s) => {
            let inside = cx.indicator(&s.lhs, s.rhs, Num::GreaterEqualElem);
            cx.times(&inside, cx.d(&s.lhs), &s.out)
        }
        Num::ClampMax(s) => {
            let inside = cx.indicator(&s.lhs, s.rhs, Num::LowerEqualElem);
            cx.times(&inside, cx.d(&s.lhs), &s.out)
        }
        Num::Sum(_)
        | Num::Mean(_)
        | Num::SumDim(_)
        | Num::MeanDim(_)
        | Num::SumDims(_)
        | Num::CumSum(_) => cx.linear(whole),
        Num::Pad(p) => {
            let mut p = p.clone();
            if let PadModeIr::Constant(value) = &mut p.mode {
                *value = ScalarIr::Float(0.0);
            }
            cx.linear(&wrap(Num::Pad(p)))
        }
        Num::MaxDimWithIndices(m) | Num::MinDimWithIndices(m) => {
            gather(cx, &m.tensor, m.dim, &m.out_indices, &m.out)
        }
        Num::MaxDim(r) | Num::MinDim(r) => {
            let variant = if matches!(op, Num::MaxDim(_)) {
                Num::MaxDimWithIndices
            } else {
                Num::MinDimWithIndices
            };
            let indices = cx.build.primal.emit(wrap(variant(ReduceDimWithIndicesOpIr {
                tensor: read_only(&r.input),
                dim: r.axis,
                out: like(&r.out),
                out_indices: output(r.out.shape.clone(), DType::I64),
            })));
            gather(cx, &r.input, r.axis, &indices[1], &r.out)
        }
        Num::TopKWithIndices(m) => gather(cx, &m.tensor, m.dim, &m.out_indices, &m.out),
        Num::SortWithIndices(m) => gather(cx, &m.input, m.dim, &m.out_indices, &m.out),
        // Piecewise constant.
        Num::Sign(_) => None,
        _ => return None,
    })
}

fn spread_operands(cx: &mut Context, b: &BinaryOpIr) -> (Tangent, Tangent) {
    let l = cx.d(&b.lhs).map(|e| cx.build.spread(e, &b.out.shape));
    let r = cx.d(&b.rhs).map(|e| cx.build.spread(e, &b.out.shape));
    (l, r)
}

/// `n xⁿ⁻¹` for integer tensors `n`.
fn powi_slope(cx: &mut Context, dtype: DType, b: &BinaryOpIr) -> TensorIr {
    let primal = &mut cx.build.primal;
    let lower = primal.emit_one(OperationIr::NumericInt(
        b.rhs.dtype,
        Num::SubScalar(ScalarOpIr {
            lhs: read_only(&b.rhs),
            rhs: ScalarIr::Int(1),
            out: like(&b.rhs),
        }),
    ));
    let power = primal.emit_one(OperationIr::NumericFloat(
        dtype,
        Num::Powi(BinaryOpIr {
            lhs: read_only(&b.lhs),
            rhs: lower,
            out: like(&b.out),
        }),
    ));
    let exponent = primal.emit_one(OperationIr::Int(IntOperationIr::IntoFloat(CastOpIr {
        input: read_only(&b.rhs),
        out: output(b.rhs.shape.clone(), dtype),
    })));
    primal.mul(&power, &exponent)
}

/// The tangent of selected elements is the selection of the tangent.
fn gather(
    cx: &mut Context,
    input: &TensorIr,
    dim: usize,
    indices: &TensorIr,
    out: &TensorIr,
) -> Tangent {
    cx.linear(&OperationIr::BaseFloat(Base::Gather(GatherOpIr {
        tensor: input.clone(),
        dim,
        indices: indices.clone(),
        out: like(out),
    })))
}
