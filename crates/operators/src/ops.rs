//! The extension operations as a Burn backend trait, with their autodiff and capture implementations.

use burn::backend::{Backend, backend_extension, tensor::FloatTensor};
use burn_autodiff::{Autodiff, checkpoint::strategy::CheckpointStrategy};
use burn_backend::{Shape, TensorMetadata};
use burn_capture::CaptureBackend;
use burn_ir::ScalarIr;

use crate::recording::{Pullback, captured, on_tape};
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
        let scalars = vec![ScalarIr::Bool(adjoint)];
        captured(CONVOLUTION, vec![x, kernel], shape, scalars)
    }

    fn kernel_correlation(
        x: FloatTensor<Self>,
        g: FloatTensor<Self>,
        width: usize,
        axes: usize,
    ) -> FloatTensor<Self> {
        let scalars = vec![ScalarIr::UInt(width as u64), ScalarIr::UInt(axes as u64)];
        let shape = Shape::from(vec![width; axes]);
        captured(CORRELATION, vec![x, g], shape, scalars)
    }

    fn brick_convolution(
        x: FloatTensor<Self>,
        taps: FloatTensor<Self>,
        neighbours: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self> {
        let shape = x.shape();
        let scalars = vec![ScalarIr::Bool(adjoint)];
        captured(BRICKS, vec![x, taps, neighbours], shape, scalars)
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
        captured(TABULATED, vec![w, table], shape, scalars)
    }
}

impl<B: Backend + GridOps, C: CheckpointStrategy> GridOps for Autodiff<B, C> {
    fn circular_convolution(
        x: FloatTensor<Self>,
        kernel: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self> {
        let nodes = [x.node(), kernel.node()];
        let (x, kernel) = (x.into_primitive(), kernel.into_primitive());
        let y = B::circular_convolution(x.clone(), kernel.clone(), adjoint);
        let (width, axes) = (kernel.shape()[0], kernel.shape().num_dims());
        let to_x = move |g| B::circular_convolution(g, kernel.clone(), !adjoint);
        let to_kernel = move |g| {
            let (x, g) = if adjoint {
                (g, x.clone())
            } else {
                (x.clone(), g)
            };
            B::kernel_correlation(x, g, width, axes)
        };
        on_tape::<B, C, 2>(nodes, y, [Pullback::new(to_x), Pullback::new(to_kernel)])
    }

    fn kernel_correlation(
        x: FloatTensor<Self>,
        g: FloatTensor<Self>,
        width: usize,
        axes: usize,
    ) -> FloatTensor<Self> {
        let nodes = [x.node(), g.node()];
        let (x, g) = (x.into_primitive(), g.into_primitive());
        let y = B::kernel_correlation(x.clone(), g.clone(), width, axes);
        let to_x = move |c| B::circular_convolution(g.clone(), c, true);
        let to_g = move |c| B::circular_convolution(x.clone(), c, false);
        on_tape::<B, C, 2>(nodes, y, [Pullback::new(to_x), Pullback::new(to_g)])
    }

    fn brick_convolution(
        x: FloatTensor<Self>,
        taps: FloatTensor<Self>,
        neighbours: FloatTensor<Self>,
        adjoint: bool,
    ) -> FloatTensor<Self> {
        let (node, x) = (x.node(), x.into_primitive());
        // Taps and neighbours are data, not variables.
        let (taps, neighbours) = (taps.into_primitive(), neighbours.into_primitive());
        let y = B::brick_convolution(x, taps.clone(), neighbours.clone(), adjoint);
        let to_x = move |g| B::brick_convolution(g, taps.clone(), neighbours.clone(), !adjoint);
        on_tape::<B, C, 1>([node], y, [Pullback::new(to_x)])
    }

    fn tabulated(
        w: FloatTensor<Self>,
        table: FloatTensor<Self>,
        range: TableRange,
        order: usize,
    ) -> FloatTensor<Self> {
        let node = w.node();
        // The table is data, not a variable: no gradient flows into it.
        let (w, table) = (w.into_primitive(), table.into_primitive());
        let y = B::tabulated(w.clone(), table.clone(), range, order);
        let to_w = move |g| {
            let slope = B::tabulated(w.clone(), table.clone(), range, order + 1);
            B::float_mul(g, slope)
        };
        on_tape::<B, C, 1>([node], y, [Pullback::new(to_w)])
    }
}
