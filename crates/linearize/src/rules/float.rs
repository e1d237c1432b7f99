//! Elementary functions and matrix products.

use std::f64::consts::PI;

use burn::backend::ir::{BinaryOpIr, FloatOperationIr as Float, OperationIr, TensorIr};

use super::Context;
use crate::emit::Emitter;
use crate::tangent::{Builder, Tangent};

pub(super) fn jvp(cx: &mut Context, whole: &OperationIr, op: &Float) -> Option<Tangent> {
    Some(match op {
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
        // Piecewise constant.
        Float::Round(_) | Float::Floor(_) | Float::Ceil(_) | Float::Trunc(_) => None,
        // f′(x) ⊙ ẋ
        _ => {
            let (x, y) = (whole.inputs().next()?, whole.outputs().next()?);
            let slope = slope(&mut cx.build.primal, op, x, y)?;
            cx.times(&slope, cx.d(x), y)
        }
    })
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

/// Derivative of the function `y` of one number `x`.
fn slope(primal: &mut Emitter, op: &Float, x: &TensorIr, y: &TensorIr) -> Option<TensorIr> {
    Some(match op {
        Float::Exp(_) => y.clone(),
        Float::Log(_) => primal.powi(x, -1),
        // 1/(1 + x)
        Float::Log1p(_) => {
            let shifted = primal.shift(x, 1.0);
            primal.powi(&shifted, -1)
        }
        // 2/√π e^(−x²)
        Float::Erf(_) => {
            let square = primal.mul(x, x);
            let negated = primal.neg(&square);
            let exp = primal.unary(&negated, Float::Exp);
            primal.scale(&exp, 2.0 / PI.sqrt())
        }
        // 1/(2y)
        Float::Sqrt(_) => {
            let reciprocal = primal.powi(y, -1);
            primal.scale(&reciprocal, 0.5)
        }
        Float::Sin(_) => primal.unary(x, Float::Cos),
        Float::Cos(_) => {
            let sin = primal.unary(x, Float::Sin);
            primal.neg(&sin)
        }
        Float::Tan(_) => power_of_one_plus_square(primal, y, 1.0, 1.0),
        Float::Sinh(_) => primal.unary(x, Float::Cosh),
        Float::Cosh(_) => primal.unary(x, Float::Sinh),
        Float::Tanh(_) => power_of_one_plus_square(primal, y, -1.0, 1.0),
        Float::ArcSin(_) => power_of_one_plus_square(primal, x, -1.0, -0.5),
        Float::ArcCos(_) => {
            let of_sine = power_of_one_plus_square(primal, x, -1.0, -0.5);
            primal.neg(&of_sine)
        }
        Float::ArcSinh(_) => power_of_one_plus_square(primal, x, 1.0, -0.5),
        // (x² − 1)^(−1/2)
        Float::ArcCosh(_) => {
            let square = primal.mul(x, x);
            let rest = primal.shift(&square, -1.0);
            primal.powf(&rest, -0.5)
        }
        Float::ArcTan(_) => power_of_one_plus_square(primal, x, 1.0, -1.0),
        Float::ArcTanh(_) => power_of_one_plus_square(primal, x, -1.0, -1.0),
        // −y²
        Float::Recip(_) => {
            let square = primal.mul(y, y);
            primal.neg(&square)
        }
        _ => return None,
    })
}

/// `(1 + sign t²)^power`
fn power_of_one_plus_square(primal: &mut Emitter, t: &TensorIr, sign: f64, power: f64) -> TensorIr {
    let square = primal.mul(t, t);
    let signed = primal.scale(&square, sign);
    let sum = primal.shift(&signed, 1.0);
    primal.powf(&sum, power)
}
