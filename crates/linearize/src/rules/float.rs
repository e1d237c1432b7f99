//! Elementary functions and matrix products.

use std::f64::consts::PI;

use burn::backend::ir::{
    BinaryOpIr, CrossOpIr, FloatOperationIr as Float, MatmulOpIr, OperationIr, TensorIr, UnaryOpIr,
};
use burn::tensor::DType;

use super::Context;
use crate::tangent::{Builder, Tangent};

pub(super) fn jvp(cx: &mut Context, dtype: DType, op: &Float) -> Option<Vec<Tangent>> {
    let wrap = move |op| OperationIr::Float(dtype, op);
    let one = match op {
        Float::Matmul(m) => {
            let l = cx.d(&m.lhs).map(|e| {
                cx.build.linear(e, |lhs| {
                    wrap(Float::Matmul(MatmulOpIr { lhs, ..m.clone() }))
                })
            });
            let r = cx.d(&m.rhs).map(|e| {
                cx.build.linear(e, |rhs| {
                    wrap(Float::Matmul(MatmulOpIr { rhs, ..m.clone() }))
                })
            });
            cx.build.plus(l, r)
        }
        Float::Cross(m) => {
            let l = cx.d(&m.lhs).map(|e| {
                cx.build
                    .linear(e, |lhs| wrap(Float::Cross(CrossOpIr { lhs, ..m.clone() })))
            });
            let r = cx.d(&m.rhs).map(|e| {
                cx.build
                    .linear(e, |rhs| wrap(Float::Cross(CrossOpIr { rhs, ..m.clone() })))
            });
            cx.build.plus(l, r)
        }
        Float::PowfScalar(s) => {
            let exponent: f64 = s.rhs.elem();
            let power = cx.build.primal.powf(&s.lhs, exponent - 1.0);
            Builder::scaled(cx.times(&power, cx.d(&s.lhs), &s.out), exponent)
        }
        Float::Powf(b) => powf(cx, b),
        // (l l̇ + r ṙ) / √(l² + r²)
        Float::Hypot(b) => {
            let l = cx.build.primal.div(&b.lhs, &b.out);
            let r = cx.build.primal.div(&b.rhs, &b.out);
            let l = cx.times(&l, cx.d(&b.lhs), &b.out);
            let r = cx.times(&r, cx.d(&b.rhs), &b.out);
            cx.build.plus(l, r)
        }
        // (r l̇ − l ṙ) / (l² + r²)
        Float::ArcTan2(b) => {
            let primal = &mut cx.build.primal;
            let (ll, rr) = (primal.mul(&b.lhs, &b.lhs), primal.mul(&b.rhs, &b.rhs));
            let norm = primal.add(&ll, &rr);
            let (l, r) = (primal.div(&b.rhs, &norm), primal.div(&b.lhs, &norm));
            let l = cx.times(&l, cx.d(&b.lhs), &b.out);
            let r = cx.times(&r, cx.d(&b.rhs), &b.out);
            cx.build.plus(l, Builder::scaled(r, -1.0))
        }
        // Piecewise constant, or not real.
        Float::Round(_)
        | Float::Floor(_)
        | Float::Ceil(_)
        | Float::Trunc(_)
        | Float::IntoInt(_)
        | Float::IsNan(_)
        | Float::IsInf(_)
        | Float::Random(_) => None,
        _ => return pointwise(cx, op).map(|tangent| vec![tangent]),
    };
    Some(vec![one])
}

/// `r lʳ⁻¹ l̇ + lʳ ln(l) ṙ`
fn powf(cx: &mut Context, b: &BinaryOpIr) -> Tangent {
    let wrap = |op| OperationIr::Float(b.out.dtype, op);
    let l = if cx.d(&b.lhs).is_some() {
        let primal = &mut cx.build.primal;
        let lower = primal.shift(&b.rhs, -1.0);
        let power = primal.emit_one(wrap(Float::Powf(BinaryOpIr {
            rhs: lower,
            ..b.clone()
        })));
        let slope = primal.mul(&power, &b.rhs);
        cx.times(&slope, cx.d(&b.lhs), &b.out)
    } else {
        None
    };
    let r = if cx.d(&b.rhs).is_some() {
        let log = cx.build.primal.unary(&b.lhs, Float::Log);
        let slope = cx.build.primal.mul(&b.out, &log);
        cx.times(&slope, cx.d(&b.rhs), &b.out)
    } else {
        None
    };
    cx.build.plus(l, r)
}

/// `f′(x) ⊙ ẋ`
fn pointwise(cx: &mut Context, op: &Float) -> Option<Tangent> {
    let (u, slope) = slope(cx, op)?;
    Some(cx.times(&slope, cx.d(&u.input), &u.out))
}

/// Derivative of a function of one number, in terms of the input `x` and the output `y`.
fn slope<'a>(cx: &mut Context, op: &'a Float) -> Option<(&'a UnaryOpIr, TensorIr)> {
    let primal = &mut cx.build.primal;
    Some(match op {
        Float::Exp(u) => (u, u.out.clone()),
        Float::Log(u) => (u, primal.powi(&u.input, -1)),
        // 1/(1 + x)
        Float::Log1p(u) => {
            let shifted = primal.shift(&u.input, 1.0);
            (u, primal.powi(&shifted, -1))
        }
        // 2/√π e^(−x²)
        Float::Erf(u) => {
            let square = primal.mul(&u.input, &u.input);
            let negated = primal.neg(&square);
            let exp = primal.unary(&negated, Float::Exp);
            (u, primal.scale(&exp, 2.0 / PI.sqrt()))
        }
        // 1/(2y)
        Float::Sqrt(u) => {
            let reciprocal = primal.powi(&u.out, -1);
            (u, primal.scale(&reciprocal, 0.5))
        }
        Float::Sin(u) => (u, primal.unary(&u.input, Float::Cos)),
        Float::Cos(u) => {
            let sin = primal.unary(&u.input, Float::Sin);
            (u, primal.neg(&sin))
        }
        // 1 + y²
        Float::Tan(u) => {
            let square = primal.mul(&u.out, &u.out);
            (u, primal.shift(&square, 1.0))
        }
        Float::Sinh(u) => (u, primal.unary(&u.input, Float::Cosh)),
        Float::Cosh(u) => (u, primal.unary(&u.input, Float::Sinh)),
        // 1 − y²
        Float::Tanh(u) => {
            let square = primal.mul(&u.out, &u.out);
            let negated = primal.neg(&square);
            (u, primal.shift(&negated, 1.0))
        }
        // ±(1 − x²)^(−1/2)
        Float::ArcSin(u) | Float::ArcCos(u) => {
            let square = primal.mul(&u.input, &u.input);
            let negated = primal.neg(&square);
            let rest = primal.shift(&negated, 1.0);
            let root = primal.powf(&rest, -0.5);
            let sign = if matches!(op, Float::ArcSin(_)) {
                1.0
            } else {
                -1.0
            };
            (u, primal.scale(&root, sign))
        }
        // (x² ± 1)^(−1/2)
        Float::ArcSinh(u) | Float::ArcCosh(u) => {
            let square = primal.mul(&u.input, &u.input);
            let sign = if matches!(op, Float::ArcSinh(_)) {
                1.0
            } else {
                -1.0
            };
            let shifted = primal.shift(&square, sign);
            (u, primal.powf(&shifted, -0.5))
        }
        // 1/(1 ± x²)
        Float::ArcTan(u) | Float::ArcTanh(u) => {
            let square = primal.mul(&u.input, &u.input);
            let sign = if matches!(op, Float::ArcTan(_)) {
                1.0
            } else {
                -1.0
            };
            let signed = primal.scale(&square, sign);
            let shifted = primal.shift(&signed, 1.0);
            (u, primal.powi(&shifted, -1))
        }
        // −y²
        Float::Recip(u) => {
            let square = primal.mul(&u.out, &u.out);
            (u, primal.neg(&square))
        }
        _ => return None,
    })
}
