//! Forward-mode rules of Burn's operations.
//!
//! Each rule maps the tangents of an operation's inputs to that of its first output. Operations without
//! active inputs or without float outputs never get here; operations that are not listed are
//! [`Error::NoRule`].

mod activation;
mod base;
mod float;
mod module;
mod numeric;

use std::collections::HashMap;

use burn::backend::ir::{
    BoolOperationIr, CastOpIr, NumericOperationIr, OperationIr, ScalarIr, ScalarOpIr, TensorId,
    TensorIr,
};
use burn::tensor::{BoolStore, DType};

use crate::ir::{like, name, output, read_only, with_inputs};
use crate::tangent::{Builder, Expression, Tangent};
use crate::{Error, Extensions};

/// The state of a linearization: programs under construction, tangents of what they contain.
pub(crate) struct Context<'a> {
    pub(crate) build: Builder,
    pub(crate) extensions: &'a Extensions,
    pub(crate) tangents: HashMap<TensorId, Expression>,
}

impl Context<'_> {
    fn d(&self, t: &TensorIr) -> Tangent {
        self.tangents.get(&t.id).cloned()
    }

    /// `p ⊙ ṫ`, in the shape of `out`.
    fn times(&mut self, p: &TensorIr, t: Tangent, out: &TensorIr) -> Tangent {
        t.and_then(|e| self.build.times(p, e, &out.shape))
    }

    /// The operation on the tangent of its first input, in which it is linear. Others are no floats.
    fn linear(&mut self, operation: &OperationIr) -> Tangent {
        self.jointly_linear(operation, &[0])
    }

    /// The operation on the tangents of its inputs at these places, in which it is jointly linear. Others are no floats, or give it
    /// their shapes only, or stay as they are.
    fn jointly_linear(&mut self, operation: &OperationIr, places: &[usize]) -> Tangent {
        let inputs: Vec<&TensorIr> = operation.inputs().collect();
        let tangents = places.iter().map(|i| (self.d(inputs[*i]), inputs[*i]));
        let tangents = tangents.collect();
        (self.build).jointly_linear(tangents, |t| with_inputs(operation, places, &t))
    }

    /// The sum of the operation on the tangent of each of its inputs at these places, in which it is linear separately.
    fn multilinear(&mut self, operation: &OperationIr, places: &[usize]) -> Tangent {
        places.iter().fold(None, |sum, place| {
            let term = self.jointly_linear(operation, &[*place]);
            self.build.plus(sum, term)
        })
    }

    /// `1` where `t` compares true, `0` elsewhere.
    fn indicator(
        &mut self,
        t: &TensorIr,
        bound: ScalarIr,
        compare: fn(ScalarOpIr) -> NumericOperationIr,
    ) -> TensorIr {
        let comparison = compare(ScalarOpIr {
            lhs: read_only(t),
            rhs: bound,
            out: output(t.shape.clone(), DType::Bool(BoolStore::U8)),
        });
        let comparison = OperationIr::NumericFloat(t.dtype, comparison);
        let mask = self.build.primal.emit_one(comparison);
        self.build
            .primal
            .emit_one(OperationIr::Bool(BoolOperationIr::IntoFloat(CastOpIr {
                input: mask,
                out: like(t),
            })))
    }
}

/// Tangents of the outputs of `operation`, which is part of the primal program.
pub(crate) fn jvp(cx: &mut Context, operation: &OperationIr) -> Result<Vec<Tangent>, Error> {
    let mut tangents = vec![None; operation.outputs().count()];
    let active = operation.inputs().any(|t| cx.tangents.contains_key(&t.id));
    if !active || operation.outputs().all(is_discrete) {
        return Ok(tangents);
    }
    let first = match operation {
        OperationIr::NumericFloat(dtype, op) => numeric::jvp(cx, operation, *dtype, op),
        OperationIr::Float(_, op) => float::jvp(cx, operation, op),
        OperationIr::BaseFloat(op) => base::jvp(cx, operation, op),
        OperationIr::Module(op) => module::jvp(cx, operation, op),
        OperationIr::Activation(op) => activation::jvp(cx, op),
        OperationIr::Custom(op) => return custom(cx, op),
        _ => None,
    };
    // Further outputs are indices.
    tangents[0] = first.ok_or_else(|| Error::NoRule {
        operation: name(operation),
    })?;
    Ok(tangents)
}

/// Whether the elements are integers or truth values, which do not vary with the variables but for jumps.
fn is_discrete(t: &TensorIr) -> bool {
    t.dtype.is_int() || t.dtype.is_uint() || t.dtype.is_bool()
}

fn custom(
    cx: &mut Context,
    operation: &burn::backend::ir::CustomOpIr,
) -> Result<Vec<Tangent>, Error> {
    let id = &operation.id;
    let rule = cx.extensions.rules.get(id).ok_or_else(|| Error::NoRule {
        operation: id.clone(),
    })?;
    let tangents: Vec<Option<TensorIr>> = operation
        .inputs
        .iter()
        .map(|t| cx.d(t).map(|e| cx.build.handle(e)))
        .collect();
    let outputs = rule(operation, &tangents, &mut cx.build)?;
    let fits = |(tangent, out): (&Option<TensorIr>, &TensorIr)| {
        tangent.as_ref().is_none_or(|t| t.shape == out.shape)
    };
    if outputs.len() != operation.outputs.len() || !outputs.iter().zip(&operation.outputs).all(fits)
    {
        return Err(Error::Rule {
            operation: id.clone(),
        });
    }
    Ok(outputs
        .into_iter()
        .map(|tangent| tangent.map(|t| cx.build.expression(&t)))
        .collect())
}
