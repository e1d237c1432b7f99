//! Activation functions that Burn keeps whole, and [`precision`] does not rewrite.

use burn::backend::ir::{
    ActivationOperationIr as Act, DimOpIr, FloatOperationIr as Float, NumericOperationIr as Num,
    OperationIr, ReduceDimOpIr, ScalarIr, TensorIr,
};

use super::Context;
use crate::ir::{output, with_inputs};
use crate::precision;
use crate::tangent::{Builder, Tangent};

pub(super) fn jvp(cx: &mut Context, op: &Act) -> Option<Tangent> {
    Some(match op {
        Act::Relu(u) => {
            let positive = positive(cx, &u.input);
            cx.times(&positive, cx.d(&u.input), &u.out)
        }
        // grad where the output is positive
        Act::ReluBackward(b) => {
            let positive = positive(cx, &b.lhs);
            cx.times(&positive, cx.d(&b.rhs), &b.out)
        }
        Act::LeakyRelu(s) => {
            let slope: f64 = s.rhs.elem();
            let positive = positive(cx, &s.lhs);
            let scaled = cx.build.primal.scale(&positive, 1.0 - slope);
            let slope = cx.build.primal.shift(&scaled, slope);
            cx.times(&slope, cx.d(&s.lhs), &s.out)
        }
        // ln σ(x): slope σ(−x)
        Act::LogSigmoid(u) => {
            let slope = precision::sigmoid_of_negative(&mut cx.build.primal, &u.input);
            cx.times(&slope, cx.d(&u.input), &u.out)
        }
        // grad ⊙ σ(−x), derivative by x: −grad ⊙ σ(x) σ(−x)
        Act::LogSigmoidBackward(b) => {
            let slope = precision::sigmoid_of_negative(&mut cx.build.primal, &b.lhs);
            let through_grad = cx.times(&slope, cx.d(&b.rhs), &b.out);
            let primal = &mut cx.build.primal;
            let second = precision::sigmoid_slope(primal, &slope);
            let second = primal.mul(&second, &b.rhs);
            let through_input = cx.times(&second, cx.d(&b.lhs), &b.out);
            cx.build
                .plus(through_grad, Builder::scaled(through_input, -1.0))
        }
        Act::Gelu(u) => {
            let slope = precision::gelu_slope(&mut cx.build.primal, &u.input);
            cx.times(&slope, cx.d(&u.input), &u.out)
        }
        // y ⊙ (ẋ − Σ y ẋ)
        Act::Softmax(s) => {
            let weighted = cx.times(&s.out, cx.d(&s.input), &s.out);
            let mean = sum_along(cx, weighted.clone(), s);
            let mean = cx.times(&s.out, mean, &s.out);
            cx.build.plus(weighted, Builder::scaled(mean, -1.0))
        }
        // ẋ − Σ eʸ ẋ
        Act::LogSoftmax(s) => {
            let softmax = cx.build.primal.unary(&s.out, Float::Exp);
            let weighted = cx.times(&softmax, cx.d(&s.input), &s.out);
            let mean = sum_along(cx, weighted, s).map(|mean| cx.build.spread(mean, &s.out.shape));
            let direct = cx.d(&s.input);
            cx.build.plus(direct, Builder::scaled(mean, -1.0))
        }
        _ => return None,
    })
}

fn positive(cx: &mut Context, t: &TensorIr) -> TensorIr {
    cx.indicator(t, ScalarIr::Float(0.0), Num::GreaterElem)
}

fn sum_along(cx: &mut Context, t: Tangent, s: &DimOpIr) -> Tangent {
    let mut shape = s.out.shape.clone();
    shape[s.axis] = 1;
    let sum = ReduceDimOpIr {
        input: s.input.clone(),
        out: output(shape, s.out.dtype),
        axis: s.axis,
        accumulator_len: 1,
    };
    let sum = OperationIr::NumericFloat(s.out.dtype, Num::SumDim(sum));
    (cx.build).jointly_linear(vec![(t, &s.input)], |t| with_inputs(&sum, &[0], &t))
}
