//! Forward-mode rules and replay handlers of the extension operations.

use burn_ir::{BackendIr, CustomOpIr, ScalarIr, TensorIr};
use linearize::{Builder, CustomOpRegistry, Error, Extensions, Tangents, multilinear};

use crate::ops::{BRICKS, CONVOLUTION, CORRELATION, GridOps, TABULATED};
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

fn register<B: BackendIr + GridOps>(registry: &mut CustomOpRegistry<B>) {
    registry.register_function(CONVOLUTION, |[x, kernel], scalars| {
        B::circular_convolution(x, kernel, scalars[0] == ScalarIr::Bool(true))
    });
    registry.register_function(CORRELATION, |[x, g], scalars| {
        let [width, axes] = [0, 1].map(|i| scalars[i].elem::<u64>() as usize);
        B::kernel_correlation(x, g, width, axes)
    });
    registry.register_function(BRICKS, |[x, taps, neighbours], scalars| {
        B::brick_convolution(x, taps, neighbours, scalars[0] == ScalarIr::Bool(true))
    });
    registry.register_function(TABULATED, |[w, table], scalars| {
        let order = scalars[0].elem::<u64>() as usize;
        let range = TableRange {
            low: scalars[1].elem(),
            high: scalars[2].elem(),
            cells: scalars[3].elem::<u64>() as usize,
        };
        B::tabulated(w, table, range, order)
    });
}

/// Everything [`linearize`] needs to differentiate and replay the operations of this crate.
pub fn extensions() -> Extensions {
    let mut extensions = Extensions::new();
    extensions
        .rule(CONVOLUTION, multilinear)
        .rule(CORRELATION, multilinear)
        .rule(BRICKS, multilinear)
        .rule(TABULATED, of_table);
    #[cfg(feature = "flex")]
    extensions.on_flex(|registry| {
        register(registry);
        crate::host::flex::register_elementwise(registry);
    });
    #[cfg(feature = "ndarray")]
    extensions.on_ndarray(|registry| {
        register(registry);
        crate::host::ndarray::register_elementwise(registry);
    });
    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    extensions.on_cube(register);
    extensions
}
