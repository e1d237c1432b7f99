//! Passes over active bricks.
#![expect(clippy::used_underscore_binding, reason = "the macro does it")]

use burn_backend::TensorMetadata;
use burn_backend::cubecl::dtype_to_storage_type;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::launch::{like, threads_for, values};
use crate::ops::Passes;

/// See [`crate::brick_convolution`]: one launch for each pass.
pub(crate) fn brick_convolution(
    mut x: CubeTensor,
    taps: &CubeTensor,
    neighbours: &CubeTensor,
    passes: Passes,
) -> CubeTensor {
    let shape = x.shape();
    let (axes, side) = (shape.num_dims(), shape[shape.num_dims() - 1]);
    for axis in passes.order(axes) {
        let result = like(&x);
        let (client, dtype) = (x.client.clone(), x.dtype);
        let (count, threads) = threads_for(&client, shape.num_elements());
        brick_pass::launch(
            &client,
            count,
            threads,
            values(x, dtype),
            values(taps.clone(), dtype),
            values(neighbours.clone(), dtype),
            values(result.clone(), dtype),
            shape.num_elements(),
            side.pow((axes - 1 - axis) as u32),
            2 * axis,
            2 * axes,
            side,
            side.pow(axes as u32),
            taps.shape()[0],
            passes.adjoint,
            dtype_to_storage_type(dtype),
        );
        x = result;
    }
    x
}

/// `sum_k t_k x_{a+k}` along one axis, the taps mirrored if so said. Cells of bricks that are not active count as zero.
#[cube(launch)]
fn brick_pass<E: Float>(
    x: &[E],
    taps: &[E],
    neighbours: &[E],
    result: &mut [E],
    len: usize,
    stride: usize,
    column: usize,
    #[comptime] columns: usize,
    #[comptime] side: usize,
    #[comptime] volume: usize,
    #[comptime] width: usize,
    #[comptime] mirrored: bool,
    #[define(E)] _dtype: ElemType,
) {
    let cell = ABSOLUTE_POS;
    if cell >= len {
        terminate!();
    }
    let brick = cell / volume;
    let along = (cell / stride) % side;
    // The first cell of the line through this one.
    let line = cell % volume - along * stride;
    let mut sum = E::new(0.0);
    #[unroll]
    for k in 0..width {
        // Counted from the beginning of the brick before.
        let place = along + (k + side - width / 2);
        let mut value = E::new(0.0);
        if place >= side && place < 2 * side {
            value = x[brick * volume + line + (place - side) * stride];
        } else {
            let next = usize::cast_from(place >= side);
            let number = neighbours[brick * columns + column + next];
            if number >= E::new(0.0) {
                let other = usize::cast_from(number);
                value = x[other * volume + line + (place % side) * stride];
            }
        }
        let tap = if mirrored { width - 1 - k } else { k };
        sum += taps[tap] * value;
    }
    result[cell] = sum;
}
