//! Elementary functions and matrix products.

use std::f64::consts::PI;

use burn::backend::ir::{BinaryOpIr, FloatOperationIr as Float, OperationIr, TensorIr, UnaryOpIr};

use super::Context;
use crate::emit::Emitter;
use crate::tangent::{Builder, Tangent};

pub(super) fn jvp(cx: &mut Context, whole: &OperationIr, op: &Float) -> Option<Vec<Tangent>> {
    let one = match op {
        Float::Matmul(_) | Float::Cross(_) => cx.multilinear(whole, &[0, 1]),
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
    let l = cx.d(&b.lhs).and_then(|dl| {
        let primal = &mut cx.build.primal;
        let rhs = primal.shift(&b.rhs, -1.0);
        let lower = Float::Powf(BinaryOpIr { rhs, ..b.clone() });
        let power = primal.emit_one(OperationIr::Float(b.out.dtype, lower));
        let slope = primal.mul(&power, &b.rhs);
        cx.times(&slope, Some(dl), &b.out)
    });
    let r = cx.d(&b.rhs).and_then(|dr| {
        let log = cx.build.primal.unary(&b.lhs, Float::Log);
        let slope = cx.build.primal.mul(&b.out, &log);
        cx.times(&slope, Some(dr), &b.out)
    });
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
        Float::Tan(u) => (u, one_plus_square(primal, &u.out, 1.0)),
        Float::Sinh(u) => (u, primal.unary(&u.input, Float::Cosh)),
        Float::Cosh(u) => (u, primal.unary(&u.input, Float::Sinh)),
        Float::Tanh(u) => (u, one_plus_square(primal, &u.out, -1.0)),
        // (1 − x²)^(−1/2)
        Float::ArcSin(u) => {
            let rest = one_plus_square(primal, &u.input, -1.0);
            (u, primal.powf(&rest, -0.5))
        }
        Float::ArcCos(u) => {
            let rest = one_plus_square(primal, &u.input, -1.0);
            let root = primal.powf(&rest, -0.5);
            (u, primal.neg(&root))
        }
        Float::ArcSinh(u) => {
            let rest = one_plus_square(primal, &u.input, 1.0);
            (u, primal.powf(&rest, -0.5))
        }
        // (x² − 1)^(−1/2)
        Float::ArcCosh(u) => {
            let square = primal.mul(&u.input, &u.input);
            let rest = primal.shift(&square, -1.0);
            (u, primal.powf(&rest, -0.5))
        }
        Float::ArcTan(u) => {
            let rest = one_plus_square(primal, &u.input, 1.0);
            (u, primal.powi(&rest, -1))
        }
        Float::ArcTanh(u) => {
            let rest = one_plus_square(primal, &u.input, -1.0);
            (u, primal.powi(&rest, -1))
        }
        // −y²
        Float::Recip(u) => {
            let square = primal.mul(&u.out, &u.out);
            (u, primal.neg(&square))
        }
        _ => return None,
    })
}

/// `1 + sign t²`
fn one_plus_square(primal: &mut Emitter, t: &TensorIr, sign: f64) -> TensorIr {
    let square = primal.mul(t, t);
    let signed = primal.scale(&square, sign);
    primal.shift(&signed, 1.0)
}
