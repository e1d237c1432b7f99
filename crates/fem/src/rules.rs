//! Forward-mode rules and replay handlers of the finite-element operations.

#![expect(clippy::unnecessary_wraps, reason = "all rules have one type")]

use burn_ir::{BackendIr, CustomOpIr, TensorIr};
use linearize::{Builder, CustomOpRegistry, Extensions, Tangents, multilinear};

use crate::backends::on_host;
use crate::ops::{HEAT, IMPLICIT, LINEARIZED, MASS, PRODUCT, host};

/// `d int a b c phi`: linear in each factor, and symmetric, so that equal factors are differentiated once.
fn product(operation: &CustomOpIr, tangents: &[Option<TensorIr>], build: &mut Builder) -> Tangents {
    let mut sum: Option<TensorIr> = None;
    for (i, tangent) in tangents.iter().enumerate() {
        let Some(tangent) = tangent else { continue };
        let same = |k: &usize| operation.inputs[*k].id == operation.inputs[i].id;
        if (0..i).any(|k| same(&k)) {
            continue;
        }
        let multiplicity = (0..3).filter(same).count() as f64;
        let [x, y] = [(i + 1) % 3, (i + 2) % 3].map(|k| operation.inputs[k].clone());
        let mut one = operation.clone();
        one.inputs = vec![x, y, tangent.clone()];
        let term = build.tangent(one);
        let term = build.scale(&term, multiplicity);
        sum = Some(match sum {
            Some(sum) => build.add(&sum, &term),
            None => term,
        });
    }
    Ok(vec![sum])
}

fn with_inputs(operation: &CustomOpIr, id: &'static str, inputs: &[TensorIr]) -> CustomOpIr {
    CustomOpIr::with_scalars(id, inputs, &operation.outputs, operation.scalars.clone())
}

/// `dv = A(v)^-1 M du`
fn implicit_step(
    operation: &CustomOpIr,
    tangents: &[Option<TensorIr>],
    build: &mut Builder,
) -> Tangents {
    let Some(du) = &tangents[0] else {
        return Ok(vec![None]);
    };
    let v = build.primal(operation.clone());
    let source = build.tangent(with_inputs(operation, MASS, std::slice::from_ref(du)));
    let dv = build.tangent(with_inputs(operation, LINEARIZED, &[v, source]));
    Ok(vec![Some(dv)])
}

/// `y = A(v)^-1 g`: `dy = A(v)^-1 (dg - 6 reaction int v dv y phi)`
fn linearized_solve(
    operation: &CustomOpIr,
    tangents: &[Option<TensorIr>],
    build: &mut Builder,
) -> Tangents {
    let v = operation.inputs[0].clone();
    let mut source = tangents[1].clone();
    if let Some(dv) = &tangents[0] {
        let y = build.primal(operation.clone());
        let factor = -6.0 * host(operation.scalars[0].elem::<u64>()).reaction();
        let inputs = [v.clone(), y, dv.clone()];
        let moved = build.tangent(with_inputs(operation, PRODUCT, &inputs));
        let moved = build.scale(&moved, factor);
        source = Some(match source {
            Some(source) => build.add(&source, &moved),
            None => moved,
        });
    }
    let Some(source) = source else {
        return Ok(vec![None]);
    };
    let dy = build.tangent(with_inputs(operation, LINEARIZED, &[v, source]));
    Ok(vec![Some(dy)])
}

fn register<B: BackendIr>(registry: &mut CustomOpRegistry<B>) {
    for id in [MASS, HEAT, PRODUCT, IMPLICIT, LINEARIZED] {
        registry.register(id, |handles, operation, _| {
            let inputs = operation.inputs.iter();
            let inputs = inputs.map(|t| handles.get_float_tensor::<B>(t)).collect();
            let output = on_host::<B>(&operation.id, inputs, operation.scalars[0].elem());
            handles.register_float_tensor::<B>(&operation.outputs[0].id, output);
        });
    }
}

/// Everything [`linearize`] needs to differentiate and replay the operations of this crate.
pub fn extensions() -> Extensions {
    let mut extensions = Extensions::new();
    extensions
        .rule(MASS, multilinear)
        .rule(HEAT, multilinear)
        .rule(PRODUCT, product)
        .rule(IMPLICIT, implicit_step)
        .rule(LINEARIZED, linearized_solve);
    #[cfg(feature = "flex")]
    register(&mut extensions.flex);
    #[cfg(feature = "ndarray")]
    register(&mut extensions.ndarray);
    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    register(&mut extensions.cube);
    extensions
}
