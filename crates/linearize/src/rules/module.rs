//! Convolutions, linear layers, pooling, and what their backward passes emit.

use burn::backend::ir::{ModuleOperationIr as Mod, OperationIr, TensorIr};

use super::Context;
use crate::ir::with_inputs;
use crate::tangent::Tangent;

pub(super) fn jvp(cx: &mut Context, whole: &OperationIr, op: &Mod) -> Option<Tangent> {
    Some(match op {
        Mod::Linear(_)
        | Mod::Conv1d(_)
        | Mod::Conv2d(_)
        | Mod::Conv3d(_)
        | Mod::ConvTranspose1d(_)
        | Mod::ConvTranspose2d(_)
        | Mod::ConvTranspose3d(_) => layer(cx, whole),
        // Of weight or input, and gradient.
        Mod::LinearXBackward(_) | Mod::LinearWeightBackward(_) => cx.multilinear(whole, &[0, 1]),
        // Of input, weight, and gradient; that in whose place the result is gives its shape only.
        Mod::Conv1dXBackward(_) | Mod::Conv2dXBackward(_) | Mod::Conv3dXBackward(_) => {
            cx.multilinear(whole, &[1, 2])
        }
        Mod::Conv1dWeightBackward(_)
        | Mod::Conv2dWeightBackward(_)
        | Mod::Conv3dWeightBackward(_)
        | Mod::ConvTranspose1dWeightBackward(_)
        | Mod::ConvTranspose2dWeightBackward(_)
        | Mod::ConvTranspose3dWeightBackward(_) => cx.multilinear(whole, &[0, 2]),
        Mod::Conv1dBiasBackward(_)
        | Mod::Conv2dBiasBackward(_)
        | Mod::Conv3dBiasBackward(_)
        | Mod::ConvTranspose1dBiasBackward(_)
        | Mod::ConvTranspose2dBiasBackward(_)
        | Mod::ConvTranspose3dBiasBackward(_) => cx.jointly_linear(whole, &[2]),
        // Of what gives the shape, and gradient.
        Mod::EmbeddingBackward(_)
        | Mod::AvgPool1dBackward(_)
        | Mod::AvgPool2dBackward(_)
        | Mod::AdaptiveAvgPool1dBackward(_)
        | Mod::AdaptiveAvgPool2dBackward(_)
        | Mod::AdaptiveAvgPool3dBackward(_)
        | Mod::InterpolateBackward(_) => cx.jointly_linear(whole, &[1]),
        Mod::LinearBiasBackward(_)
        | Mod::Embedding(_)
        | Mod::AvgPool1d(_)
        | Mod::AvgPool2d(_)
        | Mod::AdaptiveAvgPool1d(_)
        | Mod::AdaptiveAvgPool2d(_)
        | Mod::AdaptiveAvgPool3d(_)
        | Mod::Interpolate(_)
        | Mod::Unfold4d(_) => cx.linear(whole),
        _ => return None,
    })
}

/// `weight * x + bias`: jointly linear in `x` and `bias`, and in `weight` with zeros for the bias.
fn layer(cx: &mut Context, whole: &OperationIr) -> Tangent {
    let inputs: Vec<&TensorIr> = whole.inputs().collect();
    let [_, _, bias] = inputs[..] else {
        return cx.multilinear(whole, &[0, 1]);
    };
    let by_input_and_bias = cx.jointly_linear(whole, &[0, 2]);
    let zeros = cx.build.or_zeros(None, &bias.shape, bias.dtype);
    let bare = with_inputs(whole, &[2], &[zeros]);
    let by_weight = cx.jointly_linear(&bare, &[1]);
    cx.build.plus(by_input_and_bias, by_weight)
}
