//! The extension operations as a Burn backend trait, with their autodiff and capture implementations.

use burn::backend::{Backend, ExtensionType, backend_extension, tensor::FloatTensor};
use burn_autodiff::{Autodiff, checkpoint::strategy::CheckpointStrategy};
use burn_backend::TensorMetadata;
use burn_capture::CaptureBackend;
use burn_ir::ScalarIr;

use self::Operation::{Bricks, Convolution, Correlation, Tabulated};
use crate::recording::{Pullback, captured, on_tape};
use crate::table::TableRange;

pub(crate) const CONVOLUTION: &str = "operators::circular_convolution";
pub(crate) const CORRELATION: &str = "operators::kernel_correlation";
pub(crate) const BRICKS: &str = "operators::brick_convolution";
pub(crate) const TABULATED: &str = "operators::tabulated";

/// An operation that Burn does not have, on its arguments.
#[derive(ExtensionType)]
pub enum Operation<B: Backend> {
    /// [`crate::circular_convolution`] of a grid with a kernel, its adjoint if so said.
    Convolution(FloatTensor<B>, FloatTensor<B>, bool),
    /// `sum_a g_a x_{a+b}`, of `x` and `g`, for all offsets `b` of a kernel of this width and number of axes; also summed over leading
    /// batch axes. The derivative of the convolution by its kernel.
    Correlation(FloatTensor<B>, FloatTensor<B>, usize, usize),
    /// [`crate::brick_convolution`] of a field with taps, given the neighbours, or one pass of it.
    Bricks(FloatTensor<B>, FloatTensor<B>, FloatTensor<B>, Passes),
    /// [`crate::tabulated`], of this order, at every entry of a grid, by the coefficients of a table.
    Tabulated(FloatTensor<B>, FloatTensor<B>, TableRange, usize),
}

/// The passes of a convolution on bricks.
#[derive(Clone, Copy, Debug)]
pub struct Passes {
    /// The axis of the only pass, if there is one pass and not one along each axis.
    pub axis: Option<usize>,
    /// Whether it is the transpose: the opposite order with mirrored taps.
    pub adjoint: bool,
}

impl Passes {
    /// The axes of the passes in their order, of so many.
    pub(crate) fn order(self, axes: usize) -> Vec<usize> {
        match (self.axis, self.adjoint) {
            (Some(axis), _) => vec![axis],
            (None, true) => (0..axes).collect(),
            (None, false) => (0..axes).rev().collect(),
        }
    }

    pub(crate) fn transposed(self) -> Self {
        let adjoint = !self.adjoint;
        Self { adjoint, ..self }
    }
}

/// Operations on grids, closed under differentiation in both modes.
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(any(feature = "wgpu", feature = "cuda")),
    Capture,
    Autodiff
)]
pub trait GridOps: Backend {
    /// The result of an operation.
    fn grid(#[extension_type] operation: Operation<Self>) -> FloatTensor<Self>;
}

impl GridOps for CaptureBackend {
    fn grid(operation: Operation<Self>) -> FloatTensor<Self> {
        let count = |n: usize| ScalarIr::UInt(n as u64);
        let (id, inputs, scalars) = match operation {
            Convolution(x, kernel, adjoint) => {
                (CONVOLUTION, vec![x, kernel], vec![ScalarIr::Bool(adjoint)])
            }
            Correlation(x, g, width, axes) => {
                let scalars = vec![count(width), count(axes)];
                return captured(CORRELATION, vec![x, g], vec![width; axes].into(), scalars);
            }
            Bricks(x, taps, neighbours, Passes { axis, adjoint }) => {
                let mut scalars = vec![ScalarIr::Bool(adjoint)];
                scalars.extend(axis.map(count));
                (BRICKS, vec![x, taps, neighbours], scalars)
            }
            Tabulated(w, table, TableRange { low, high, cells }, order) => {
                let ends = [low, high].map(ScalarIr::Float);
                let scalars = vec![count(order), ends[0], ends[1], count(cells)];
                (TABULATED, vec![w, table], scalars)
            }
        };
        let shape = inputs[0].shape();
        captured(id, inputs, shape, scalars)
    }
}

impl<B: Backend + GridOps, C: CheckpointStrategy> GridOps for Autodiff<B, C> {
    fn grid(operation: Operation<Self>) -> FloatTensor<Self> {
        match operation {
            Convolution(x, kernel, adjoint) => {
                let nodes = [x.node(), kernel.node()];
                let (x, kernel) = (x.into_primitive(), kernel.into_primitive());
                let y = B::grid(Convolution(x.clone(), kernel.clone(), adjoint));
                let (width, axes) = (kernel.shape()[0], kernel.shape().num_dims());
                let to_x = move |g| B::grid(Convolution(g, kernel.clone(), !adjoint));
                let to_kernel = move |g| {
                    let (x, g) = if adjoint {
                        (g, x.clone())
                    } else {
                        (x.clone(), g)
                    };
                    B::grid(Correlation(x, g, width, axes))
                };
                on_tape::<B, C, 2>(nodes, y, [Pullback::new(to_x), Pullback::new(to_kernel)])
            }
            Correlation(x, g, width, axes) => {
                let nodes = [x.node(), g.node()];
                let (x, g) = (x.into_primitive(), g.into_primitive());
                let y = B::grid(Correlation(x.clone(), g.clone(), width, axes));
                let to_x = move |c| B::grid(Convolution(g.clone(), c, true));
                let to_g = move |c| B::grid(Convolution(x.clone(), c, false));
                on_tape::<B, C, 2>(nodes, y, [Pullback::new(to_x), Pullback::new(to_g)])
            }
            Bricks(x, taps, neighbours, passes) => {
                let (node, x) = (x.node(), x.into_primitive());
                // Taps and neighbours are data, not variables.
                let (taps, neighbours) = (taps.into_primitive(), neighbours.into_primitive());
                let run =
                    move |x, passes| B::grid(Bricks(x, taps.clone(), neighbours.clone(), passes));
                let y = run(x, passes);
                let to_x = move |g| run(g, passes.transposed());
                on_tape::<B, C, 1>([node], y, [Pullback::new(to_x)])
            }
            Tabulated(w, table, range, order) => {
                let node = w.node();
                // The table is data, not a variable: no gradient flows into it.
                let (w, table) = (w.into_primitive(), table.into_primitive());
                let run = move |order| B::grid(Tabulated(w.clone(), table.clone(), range, order));
                let y = run(order);
                let to_w = move |g| B::float_mul(g, run(order + 1));
                on_tape::<B, C, 1>([node], y, [Pullback::new(to_w)])
            }
        }
    }
}
