//! Forward-mode rules and replay handlers of the extension operations.

use burn_ir::{BackendIr, CustomOpIr, ScalarIr, TensorIr};
use linearize::{Builder, CustomOpRegistry, Error, Extensions, Multilinear, Rule};

use crate::ops::{BRICKS, CONVOLUTION, CORRELATION, GridOps, TABULATED};
use crate::table::TableRange;

/// `d F^(k)(w) = F^(k+1)(w) dw`; the table is constant.
struct Tabulated;

impl Rule for Tabulated {
    fn jvp(
        &self,
        operation: &CustomOpIr,
        tangents: &[Option<TensorIr>],
        build: &mut Builder,
    ) -> Result<Vec<Option<TensorIr>>, Error> {
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
}

fn register<B: BackendIr + GridOps>(registry: &mut CustomOpRegistry<B>) {
    registry.register(CONVOLUTION, |handles, ir, _| {
        let x = handles.get_float_tensor::<B>(&ir.inputs[0]);
        let kernel = handles.get_float_tensor::<B>(&ir.inputs[1]);
        let adjoint = ir.scalars[0] == ScalarIr::Bool(true);
        let y = B::circular_convolution(x, kernel, adjoint);
        handles.register_float_tensor::<B>(&ir.outputs[0].id, y);
    });
    registry.register(CORRELATION, |handles, ir, _| {
        let x = handles.get_float_tensor::<B>(&ir.inputs[0]);
        let g = handles.get_float_tensor::<B>(&ir.inputs[1]);
        let [width, axes] = [0, 1].map(|i| ir.scalars[i].elem::<u64>() as usize);
        let y = B::kernel_correlation(x, g, width, axes);
        handles.register_float_tensor::<B>(&ir.outputs[0].id, y);
    });
    registry.register(BRICKS, |handles, ir, _| {
        let [x, taps, neighbours] = [0, 1, 2].map(|i| handles.get_float_tensor::<B>(&ir.inputs[i]));
        let adjoint = ir.scalars[0] == ScalarIr::Bool(true);
        let y = B::brick_convolution(x, taps, neighbours, adjoint);
        handles.register_float_tensor::<B>(&ir.outputs[0].id, y);
    });
    registry.register(TABULATED, |handles, ir, _| {
        let w = handles.get_float_tensor::<B>(&ir.inputs[0]);
        let table = handles.get_float_tensor::<B>(&ir.inputs[1]);
        let order = ir.scalars[0].elem::<u64>() as usize;
        let range = TableRange {
            low: ir.scalars[1].elem(),
            high: ir.scalars[2].elem(),
            cells: ir.scalars[3].elem::<u64>() as usize,
        };
        let y = B::tabulated(w, table, range, order);
        handles.register_float_tensor::<B>(&ir.outputs[0].id, y);
    });
}

/// Everything [`linearize`] needs to differentiate and replay the operations of this crate.
pub fn extensions() -> Extensions {
    let mut extensions = Extensions::new();
    extensions
        .rule(CONVOLUTION, Multilinear)
        .rule(CORRELATION, Multilinear)
        .rule(BRICKS, Multilinear)
        .rule(TABULATED, Tabulated);
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
