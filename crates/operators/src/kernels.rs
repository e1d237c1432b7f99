//! CubeCL kernels of what a step spends its time in. A thread computes one value, in the precision of the tensors. How many there are is an
//! argument, since the lengths of buffers on CUDA are those of their memory, which is longer.

mod bricks;
mod corners;
mod elementwise;
mod launch;
mod tables;
mod transform;

pub(crate) use bricks::brick_convolution;
pub(crate) use corners::{add_interpolated, corner_sums};
pub(crate) use elementwise::elementwise;
pub(crate) use tables::tabulated;
pub(crate) use transform::transform;
