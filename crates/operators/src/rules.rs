//! Forward-mode rules and replay handlers of the extension operations.

use burn_ir::{BackendIr, CustomOpIr, ScalarIr, TensorIr};
use linearize::{Builder, CustomOpRegistry, Error, Extensions, Tangents, multilinear};

use crate::ops::{BRICKS, CONVOLUTION, CORRELATION, GridOps, Operation, Passes, TABULATED};
use crate::table::TableRange;

/// `d F^(k)(w) = F^(k+1)(w) dw`; the table is constant.
fn of_table(
    operation: &CustomOpIr,
    tangents: &[Option<TensorIr>],
    build: &mut Builder,
) -> Tangents {
    let (Some(dw), None) = (&tangents[0], &tangents[1]) else {
        return Err(Error::NoRule {
            operation: format!("{TABULATED} with respect to its table"),
        });
    };
    let order = operation.scalars[0].elem::<u64>();
    let mut derivative = operation.clone();
    derivative.scalars[0] = ScalarIr::UInt(order + 1);
    let derivative = build.primal(derivative);
    Ok(vec![Some(build.mul(&derivative, dw))])
}

/// Linear in the field; the taps come once for each axis, and are constant like the neighbours.
fn of_bricks(
    operation: &CustomOpIr,
    tangents: &[Option<TensorIr>],
    build: &mut Builder,
) -> Tangents {
    if tangents[1..].iter().any(Option::is_some) {
        return Err(Error::NoRule {
            operation: format!("{BRICKS} with respect to its taps or neighbours"),
        });
    }
    multilinear(operation, tangents, build)
}

fn register<B: BackendIr + GridOps>(registry: &mut CustomOpRegistry<B>) {
    let flag = |scalar: &ScalarIr| *scalar == ScalarIr::Bool(true);
    let count = |scalar: &ScalarIr| scalar.elem::<u64>() as usize;
    registry.register_function(CONVOLUTION, move |[x, kernel], s| {
        B::grid(Operation::Convolution(x, kernel, flag(&s[0])))
    });
    registry.register_function(CORRELATION, move |[x, g], s| {
        B::grid(Operation::Correlation(x, g, count(&s[0]), count(&s[1])))
    });
    registry.register_function(BRICKS, move |[x, taps, neighbours], s| {
        let (adjoint, axis) = (flag(&s[0]), s.get(1).map(count));
        B::grid(Operation::Bricks(
            x,
            taps,
            neighbours,
            Passes { axis, adjoint },
        ))
    });
    registry.register_function(TABULATED, move |[w, table], s| {
        let (low, high, cells) = (s[1].elem(), s[2].elem(), count(&s[3]));
        let range = TableRange { low, high, cells };
        B::grid(Operation::Tabulated(w, table, range, count(&s[0])))
    });
}

/// Everything [`linearize`] needs to differentiate and replay the operations of this crate.
pub fn extensions() -> Extensions {
    let mut extensions = Extensions::new();
    extensions
        .rule(CONVOLUTION, multilinear)
        .rule(CORRELATION, multilinear)
        .rule(BRICKS, of_bricks)
        .rule(TABULATED, of_table);
    #[cfg(feature = "flex")]
    {
        register(&mut extensions.flex);
        crate::host::register_elementwise(&mut extensions.flex);
    }
    #[cfg(feature = "ndarray")]
    {
        register(&mut extensions.ndarray);
        crate::host::register_elementwise(&mut extensions.ndarray);
    }
    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    {
        register(&mut extensions.cube);
        crate::cube::register_elementwise(&mut extensions.cube);
    }
    extensions
}

#[cfg(test)]
mod tests {
    use linearize::Graph;

    use super::*;
    use crate::{ComputeDevice, brick_convolution};

    #[test]
    fn taps_of_bricks_are_constant_in_forward_mode_too() {
        let device = ComputeDevice::default_compiled().unwrap();
        let x = device.tensor::<2>(&[0.5; 64], [8, 8]);
        let taps = device.tensor::<1>(&[0.25, 0.5, 0.25], [3]);
        let neighbours = device.tensor::<2>(&[0.0; 4], [1, 4]);
        let variables = [(&x).into(), (&taps).into()];
        let graph = Graph::trace(&variables, &[neighbours.into()], |i| {
            let (x, taps) = (i.variable::<2>(0), i.variable::<1>(1));
            vec![brick_convolution(x, taps, i.parameter::<2>(0), false).into()]
        });
        let refused = graph.unwrap().linearize(&extensions(), None).unwrap_err();
        assert!(matches!(&refused, Error::NoRule { operation } if operation.contains("taps")));
    }
}
