//! Repairs of operations that lose digits in Burn 0.22.1.

use std::collections::HashMap;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

use burn::backend::ir::{
    ActivationOperationIr as Act, FloatOperationIr as Float, NumericOperationIr as Num,
    OperationIr, ScalarIr, TensorIr,
};
use burn::tensor::DType;

use crate::emit::Emitter;

/// Burn 0.22.1 computes the factor `1/c` in the backward pass of a division by a number `c` in single
/// precision, whatever the precision of the tensors. Give such factors back their digits.
pub(crate) fn restore_reciprocals(operations: &mut [OperationIr]) {
    let mut exact: HashMap<u64, f64> = HashMap::new();
    for operation in &*operations {
        if let OperationIr::NumericFloat(DType::F64, Num::DivScalar(division)) = operation {
            let divisor: f64 = division.rhs.elem();
            let single = f64::from(1.0 / divisor as f32);
            exact.insert(single.to_bits(), 1.0 / divisor);
        }
    }
    for operation in operations {
        if let OperationIr::NumericFloat(DType::F64, Num::MulScalar(product)) = operation
            && let Some(factor) = exact.get(&product.rhs.elem::<f64>().to_bits())
        {
            product.rhs = ScalarIr::Float(*factor);
        }
    }
}

/// [`Emitter::simplify`], with activations that lose digits lowered: some backends compute sigmoids in single precision, and the
/// derivative of `gelu` from another function that is only close to it. Elementary functions are exact.
pub(crate) fn simplify(emitter: &mut Emitter, operation: OperationIr) -> Vec<TensorIr> {
    let lowered = match &operation {
        OperationIr::Activation(Act::Sigmoid(u)) => {
            let negated = emitter.neg(&u.input);
            sigmoid_of_negative(emitter, &negated)
        }
        OperationIr::Activation(Act::SigmoidBackward(b)) => {
            let slope = sigmoid_slope(emitter, &b.lhs);
            emitter.mul(&slope, &b.rhs)
        }
        OperationIr::Activation(Act::GeluBackward(b)) => {
            let slope = gelu_slope(emitter, &b.lhs);
            emitter.mul(&slope, &b.rhs)
        }
        _ => return emitter.simplify(operation),
    };
    vec![lowered]
}

/// `σ(−x) = 1/(1 + eˣ)`
pub(crate) fn sigmoid_of_negative(emitter: &mut Emitter, x: &TensorIr) -> TensorIr {
    let exp = emitter.unary(x, Float::Exp);
    let shifted = emitter.shift(&exp, 1.0);
    emitter.powi(&shifted, -1)
}

/// `y (1 − y)`, the derivative of `y = σ(x)`.
pub(crate) fn sigmoid_slope(emitter: &mut Emitter, y: &TensorIr) -> TensorIr {
    let negated = emitter.neg(y);
    let rest = emitter.shift(&negated, 1.0);
    emitter.mul(y, &rest)
}

/// `Φ(x) + x φ(x)`, the derivative of `x Φ(x)`, with the normal distribution `Φ` and its density `φ`.
pub(crate) fn gelu_slope(emitter: &mut Emitter, x: &TensorIr) -> TensorIr {
    let scaled = emitter.scale(x, FRAC_1_SQRT_2);
    let erf = emitter.unary(&scaled, Float::Erf);
    let half = emitter.scale(&erf, 0.5);
    let distribution = emitter.shift(&half, 0.5);
    let square = emitter.mul(x, x);
    let exponent = emitter.scale(&square, -0.5);
    let exp = emitter.unary(&exponent, Float::Exp);
    let density = emitter.scale(&exp, 1.0 / (2.0 * PI).sqrt());
    let weighted = emitter.mul(x, &density);
    emitter.add(&distribution, &weighted)
}
