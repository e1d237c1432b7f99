//! Convolutions, linear layers, pooling, and what their backward passes emit.

use burn::backend::ir::{
    BaseOperationIr as Base, ModuleOperationIr as Mod, OperationIr, ShapeOpIr, TensorIr,
};
use burn::tensor::Shape;

use super::Context;
use crate::ir::{output, read_only};
use crate::tangent::Tangent;

/// A layer `weight * x + bias`: linear in `x` and in `weight`, and its tangent has no bias.
macro_rules! layer {
    ($cx:ident, $op:ident, $variant:path, $bias:expr) => {{
        let mut bare = $op.clone();
        bare.bias = None;
        let x = linear!($cx, bare, $variant, x);
        let weight = linear!($cx, bare, $variant, weight);
        let sum = $cx.build.plus(x, weight);
        let bias = $op
            .bias
            .as_ref()
            .and_then(|bias| $bias($cx, bias, &$op.out));
        $cx.build.plus(sum, bias)
    }};
}

/// The operation with one argument replaced by its tangent.
macro_rules! linear {
    ($cx:ident, $op:ident, $variant:path, $field:ident) => {{
        let mut replaced = $op.clone();
        $cx.d(&$op.$field).map(|e| {
            $cx.build.linear(e, |tangent| {
                replaced.$field = tangent;
                OperationIr::Module($variant(replaced))
            })
        })
    }};
}

/// An operation that is linear in each of the listed arguments. Others give it their shapes only.
macro_rules! multilinear {
    ($cx:ident, $op:ident, $variant:path, $($field:ident),+) => {{
        let sum: Tangent = None;
        $(
            let tangent = linear!($cx, $op, $variant, $field);
            let sum = $cx.build.plus(sum, tangent);
        )+
        sum
    }};
}

pub(super) fn jvp(cx: &mut Context, whole: &OperationIr, op: &Mod) -> Option<Vec<Tangent>> {
    let one = match op {
        Mod::Linear(o) => layer!(cx, o, Mod::Linear, last_axis),
        Mod::LinearXBackward(o) => multilinear!(cx, o, Mod::LinearXBackward, weight, output_grad),
        Mod::LinearWeightBackward(o) => {
            multilinear!(cx, o, Mod::LinearWeightBackward, x, output_grad)
        }
        Mod::LinearBiasBackward(o) => cx.linear(whole, &o.output_grad),

        Mod::Conv1d(o) => layer!(cx, o, Mod::Conv1d, second_axis),
        Mod::Conv2d(o) => layer!(cx, o, Mod::Conv2d, second_axis),
        Mod::Conv3d(o) => layer!(cx, o, Mod::Conv3d, second_axis),
        Mod::Conv1dXBackward(o) => multilinear!(cx, o, Mod::Conv1dXBackward, weight, output_grad),
        Mod::Conv2dXBackward(o) => multilinear!(cx, o, Mod::Conv2dXBackward, weight, output_grad),
        Mod::Conv3dXBackward(o) => multilinear!(cx, o, Mod::Conv3dXBackward, weight, output_grad),
        Mod::Conv1dWeightBackward(o) => {
            multilinear!(cx, o, Mod::Conv1dWeightBackward, x, output_grad)
        }
        Mod::Conv2dWeightBackward(o) => {
            multilinear!(cx, o, Mod::Conv2dWeightBackward, x, output_grad)
        }
        Mod::Conv3dWeightBackward(o) => {
            multilinear!(cx, o, Mod::Conv3dWeightBackward, x, output_grad)
        }
        Mod::Conv1dBiasBackward(o) => cx.linear(whole, &o.output_grad),
        Mod::Conv2dBiasBackward(o) => cx.linear(whole, &o.output_grad),
        Mod::Conv3dBiasBackward(o) => cx.linear(whole, &o.output_grad),
        Mod::ConvTranspose1d(o) => layer!(cx, o, Mod::ConvTranspose1d, second_axis),
        Mod::ConvTranspose2d(o) => layer!(cx, o, Mod::ConvTranspose2d, second_axis),
        Mod::ConvTranspose3d(o) => layer!(cx, o, Mod::ConvTranspose3d, second_axis),
        Mod::ConvTranspose1dWeightBackward(o) => {
            multilinear!(cx, o, Mod::ConvTranspose1dWeightBackward, x, output_grad)
        }
        Mod::ConvTranspose2dWeightBackward(o) => {
            multilinear!(cx, o, Mod::ConvTranspose2dWeightBackward, x, output_grad)
        }
        Mod::ConvTranspose3dWeightBackward(o) => {
            multilinear!(cx, o, Mod::ConvTranspose3dWeightBackward, x, output_grad)
        }
        Mod::ConvTranspose1dBiasBackward(o) => cx.linear(whole, &o.output_grad),
        Mod::ConvTranspose2dBiasBackward(o) => cx.linear(whole, &o.output_grad),
        Mod::ConvTranspose3dBiasBackward(o) => cx.linear(whole, &o.output_grad),

        Mod::Embedding(o) => cx.linear(whole, &o.weights),
        Mod::EmbeddingBackward(o) => cx.linear(whole, &o.out_grad),
        Mod::AvgPool1d(o) => cx.linear(whole, &o.x),
        Mod::AvgPool2d(o) => cx.linear(whole, &o.x),
        Mod::AvgPool1dBackward(o) => cx.linear(whole, &o.grad),
        Mod::AvgPool2dBackward(o) => cx.linear(whole, &o.grad),
        Mod::AdaptiveAvgPool1d(o) => cx.linear(whole, &o.x),
        Mod::AdaptiveAvgPool2d(o) => cx.linear(whole, &o.x),
        Mod::AdaptiveAvgPool3d(o) => cx.linear(whole, &o.x),
        Mod::AdaptiveAvgPool1dBackward(o) => cx.linear(whole, &o.grad),
        Mod::AdaptiveAvgPool2dBackward(o) => cx.linear(whole, &o.grad),
        Mod::AdaptiveAvgPool3dBackward(o) => cx.linear(whole, &o.grad),
        Mod::Interpolate(o) => cx.linear(whole, &o.x),
        Mod::InterpolateBackward(o) => cx.linear(whole, &o.grad),
        Mod::Unfold4d(o) => cx.linear(whole, &o.x),
        _ => return None,
    };
    Some(vec![one])
}

/// Tangent of a bias along the channels of a convolution, `[batch, channels, …]`.
fn second_axis(cx: &mut Context, bias: &TensorIr, out: &TensorIr) -> Tangent {
    along(cx, bias, out, 1)
}

/// Tangent of a bias along the features of a linear layer, `[…, features]`.
fn last_axis(cx: &mut Context, bias: &TensorIr, out: &TensorIr) -> Tangent {
    along(cx, bias, out, out.shape.num_dims() - 1)
}

fn along(cx: &mut Context, bias: &TensorIr, out: &TensorIr, axis: usize) -> Tangent {
    let mut shape = vec![1; out.shape.num_dims()];
    shape[axis] = bias.shape.num_elements();
    let shape = Shape::from(shape);
    let tangent = cx.d(bias)?;
    let reshaped = cx.build.linear(tangent, |input| {
        OperationIr::BaseFloat(Base::Reshape(ShapeOpIr {
            input: read_only(&input),
            out: output(shape, out.dtype),
        }))
    });
    Some(cx.build.spread(reshaped, &out.shape))
}
