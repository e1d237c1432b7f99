//! The extension operations on Burn's `Tensor`.

use burn::backend::Dispatch;
use burn::tensor::Tensor;

use crate::ops::{GridOps, Operation, Passes};
use crate::table::TableRange;

fn grid<const R: usize>(operation: Operation<Dispatch>) -> Tensor<R> {
    Tensor::from_dispatch(<Dispatch as GridOps>::grid(operation))
}

/// `y_a = sum_b K_b x_{a+b}` (or `x_{a-b}` if `adjoint`) with periodic `x`: the paper's `K * U`.
///
/// `x` has the kernel's `K` axes, preceded by any batch axes; `kernel` has odd width `n_K` on each axis. Differentiable
/// in both.
pub fn circular_convolution<const R: usize, const K: usize>(
    x: Tensor<R>,
    kernel: Tensor<K>,
    adjoint: bool,
) -> Tensor<R> {
    let (x, kernel) = (x.into_dispatch(), kernel.into_dispatch());
    grid(Operation::Convolution(x, kernel, adjoint))
}

/// `y_a = sum_{b,..,c} t_b .. t_c x_{a+(b,..,c)}` on active bricks (`geometry::Bricks`), as one pass along each axis, the last one first; every pass
/// takes what is not active as zero. The transpose of that if `adjoint`: the passes in the opposite order with mirrored taps.
///
/// `x` has the shape of `Bricks::shape`; `taps` are odd in number with the centre in the middle, and reach no further than the
/// next brick; `neighbours` is `Bricks::neighbours`. Linear and differentiable in `x`; the others are constant.
pub fn brick_convolution<const D: usize>(
    x: Tensor<D>,
    taps: Tensor<1>,
    neighbours: Tensor<2>,
    adjoint: bool,
) -> Tensor<D> {
    let passes = Passes {
        axis: None,
        adjoint,
    };
    on_bricks(x, taps, neighbours, passes)
}

/// The only pass of a [`brick_convolution`] along one axis: `y_a = sum_b t_b x_{a + b e}`, `e` the unit vector of the axis.
pub fn brick_pass<const D: usize>(
    x: Tensor<D>,
    taps: Tensor<1>,
    neighbours: Tensor<2>,
    axis: usize,
) -> Tensor<D> {
    let passes = Passes {
        axis: Some(axis),
        adjoint: false,
    };
    on_bricks(x, taps, neighbours, passes)
}

fn on_bricks<const D: usize>(
    x: Tensor<D>,
    taps: Tensor<1>,
    neighbours: Tensor<2>,
    passes: Passes,
) -> Tensor<D> {
    let (taps, neighbours) = (taps.into_dispatch(), neighbours.into_dispatch());
    grid(Operation::Bricks(
        x.into_dispatch(),
        taps,
        neighbours,
        passes,
    ))
}

/// `F^(order)(w)` entry by entry, `F` given by the coefficients `[cells, 6]` of a [`crate::HermiteTable`].
///
/// Differentiable in `w`; the table is constant.
pub fn tabulated<const R: usize>(
    w: Tensor<R>,
    table: Tensor<2>,
    range: TableRange,
    order: usize,
) -> Tensor<R> {
    let (w, table) = (w.into_dispatch(), table.into_dispatch());
    grid(Operation::Tabulated(w, table, range, order))
}
