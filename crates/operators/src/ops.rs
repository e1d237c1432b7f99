//! The extension operations as a Burn backend trait, with their autodiff and capture implementations.

use burn::backend::{Backend, backend_extension, tensor::FloatTensor};
use burn_autodiff::{
    Autodiff,
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind, binary, unary},
};
use burn_backend::{Shape, TensorMetadata};
use burn_capture::CaptureBackend;
use burn_ir::{CustomOpIr, OperationIr, OperationOutput, ScalarIr, TensorIr};
use burn_router::RouterClient;

use crate::table::TableRange;

/// Identifier of [`GridOps::circular_convolution`] in captured graphs.
pub(crate) const CONVOLUTION: &str = "operators::circular_convolution";
/// Identifier of [`GridOps::kernel_correlation`] in captured graphs.
pub(crate) const CORRELATION: &str = "operators::kernel_correlation";
/// Identifier of [`GridOps::brick_convolution`] in captured graphs.
pub(crate) const BRICKS: &str = "operators::brick_convolution";
/// Identifier of [`GridOps::tabulated`] in captured graphs.
pub(crate) const TABULATED: &str = "operators::tabulated";

/// Operations that Burn does not have, closed under differentiation in both modes.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(any(feature = "wgpu", feature = "cuda")),
    Capture,
    Autodiff
)]
pub trait GridOps: Backend {
    /// `sum_b K_b x_{a+b}`, or `x_{a-b}` if `adjoint`, over the trailing axes (as many as the kernel has).
    fn circular_convolution(
        x: FloatTensor<Self>,
        kernel: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self>;
    /// `sum_a g_a x_{a+b}` for the `width^D` offsets `b` of a kernel, also summed over leading batch axes.
    fn kernel_correlation(
        x: FloatTensor<Self>,
        g: FloatTensor<Self>,
        width: usize,
        axes: usize,
    ) -> FloatTensor<Self>;
    /// `sum_b t_b .. t_c x_{a+(b,..,c)}` over the cells of active bricks, pass by pass; the transpose if `adjoint`.
    fn brick_convolution(
        x: FloatTensor<Self>,
        taps: FloatTensor<Self>,
        neighbours: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self>;
    /// The `order`-th derivative of a tabulated function at every entry of `w`.
    fn tabulated(
        w: FloatTensor<Self>,
        table: FloatTensor<Self>,
        range: TableRange,
        order: usize,
    ) -> FloatTensor<Self>;
}

impl GridOps for CaptureBackend {
    fn circular_convolution(
        x: FloatTensor<Self>,
        kernel: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self> {
        let shape = x.shape();
        record(
            CONVOLUTION,
            [x, kernel],
            shape,
            vec![ScalarIr::Bool(adjoint)],
        )
    }

    fn kernel_correlation(
        x: FloatTensor<Self>,
        g: FloatTensor<Self>,
        width: usize,
        axes: usize,
    ) -> FloatTensor<Self> {
        let scalars = vec![ScalarIr::UInt(width as u64), ScalarIr::UInt(axes as u64)];
        record(CORRELATION, [x, g], Shape::from(vec![width; axes]), scalars)
    }

    fn brick_convolution(
        x: FloatTensor<Self>,
        taps: FloatTensor<Self>,
        neighbours: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self> {
        let shape = x.shape();
        let scalars = vec![ScalarIr::Bool(adjoint)];
        record(BRICKS, [x, taps, neighbours], shape, scalars)
    }

    fn tabulated(
        w: FloatTensor<Self>,
        table: FloatTensor<Self>,
        range: TableRange,
        order: usize,
    ) -> FloatTensor<Self> {
        let shape = w.shape();
        let scalars = vec![
            ScalarIr::UInt(order as u64),
            ScalarIr::Float(range.low),
            ScalarIr::Float(range.high),
            ScalarIr::UInt(range.cells as u64),
        ];
        record(TABULATED, [w, table], shape, scalars)
    }
}

fn record<const N: usize>(
    id: &'static str,
    inputs: [FloatTensor<CaptureBackend>; N],
    shape: Shape,
    scalars: Vec<ScalarIr>,
) -> FloatTensor<CaptureBackend> {
    let client = inputs[0].client.clone();
    let inputs = inputs.map(burn_router::RouterTensor::into_ir);
    let output = TensorIr::uninit(client.create_empty_handle(), shape, inputs[0].dtype);
    let operation = CustomOpIr::with_scalars(id, &inputs, &[output], scalars);
    client.register(OperationIr::Custom(operation)).output()
}

/// Width of a kernel: its extent along the first axis.
fn width_of<B: Backend>(kernel: &FloatTensor<B>) -> (usize, usize) {
    let shape = kernel.shape();
    (shape[0], shape.num_dims())
}

impl<B: Backend + GridOps, C: CheckpointStrategy> GridOps for Autodiff<B, C> {
    fn circular_convolution(
        x: FloatTensor<Self>,
        kernel: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Convolution;
        impl<B: Backend + GridOps> Backward<B, 2> for Convolution {
            type State = (FloatTensor<B>, FloatTensor<B>, bool);
            fn backward(
                self,
                ops: Ops<Self::State, 2>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (x, kernel, adjoint) = ops.state;
                let (width, axes) = width_of::<B>(&kernel);
                binary::<B, _, _>(
                    ops.parents,
                    ops.node,
                    grads,
                    |g| B::circular_convolution(g, kernel, !adjoint),
                    |g| {
                        let (x, g) = if adjoint { (g, x) } else { (x, g) };
                        B::kernel_correlation(x, g, width, axes)
                    },
                );
            }
        }
        let nodes = [x.node(), kernel.node()];
        let (x, kernel) = (x.into_primitive(), kernel.into_primitive());
        let y = B::circular_convolution(x.clone(), kernel.clone(), adjoint);
        match Convolution.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((x, kernel, adjoint), y),
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }

    fn kernel_correlation(
        x: FloatTensor<Self>,
        g: FloatTensor<Self>,
        width: usize,
        axes: usize,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Correlation;
        impl<B: Backend + GridOps> Backward<B, 2> for Correlation {
            type State = (FloatTensor<B>, FloatTensor<B>);
            fn backward(
                self,
                ops: Ops<Self::State, 2>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (x, g) = ops.state;
                binary::<B, _, _>(
                    ops.parents,
                    ops.node,
                    grads,
                    |c| B::circular_convolution(g, c, true),
                    |c| B::circular_convolution(x, c, false),
                );
            }
        }
        let nodes = [x.node(), g.node()];
        let (x, g) = (x.into_primitive(), g.into_primitive());
        let y = B::kernel_correlation(x.clone(), g.clone(), width, axes);
        match Correlation.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((x, g), y),
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }

    fn brick_convolution(
        x: FloatTensor<Self>,
        taps: FloatTensor<Self>,
        neighbours: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Bricks;
        impl<B: Backend + GridOps> Backward<B, 1> for Bricks {
            type State = (FloatTensor<B>, FloatTensor<B>, bool);
            fn backward(
                self,
                ops: Ops<Self::State, 1>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (taps, neighbours, adjoint) = ops.state;
                unary::<B, _>(ops.parents, ops.node, grads, |g| {
                    B::brick_convolution(g, taps, neighbours, !adjoint)
                });
            }
        }
        let node = x.node();
        // Taps and neighbours are data, not variables.
        let (taps, neighbours) = (taps.into_primitive(), neighbours.into_primitive());
        let y = B::brick_convolution(
            x.into_primitive(),
            taps.clone(),
            neighbours.clone(),
            adjoint,
        );
        match Bricks.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((taps, neighbours, adjoint), y),
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }

    fn tabulated(
        w: FloatTensor<Self>,
        table: FloatTensor<Self>,
        range: TableRange,
        order: usize,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Tabulated;
        impl<B: Backend + GridOps> Backward<B, 1> for Tabulated {
            type State = (FloatTensor<B>, FloatTensor<B>, TableRange, usize);
            fn backward(
                self,
                ops: Ops<Self::State, 1>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (w, table, range, order) = ops.state;
                unary::<B, _>(ops.parents, ops.node, grads, |g| {
                    B::float_mul(g, B::tabulated(w, table, range, order + 1))
                });
            }
        }
        let node = w.node();
        // The table is data, not a variable: no gradient flows into it.
        let (w, table) = (w.into_primitive(), table.into_primitive());
        let y = B::tabulated(w.clone(), table.clone(), range, order);
        match Tabulated.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish((w, table, range, order), y),
            OpsKind::UnTracked(prepared) => prepared.finish(y),
        }
    }
}
