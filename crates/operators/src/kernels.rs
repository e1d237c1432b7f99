//! CubeCL kernels of what a step spends its time in, in the precision of their tensors. A thread writes one entry of each result.
//!
//! On CUDA they run without bounds checks, and the buffer of an uploaded tensor may be longer than it, since its rows are padded. So
//! every kernel has the number of entries as an argument, and its buffers go through [`launch`].

mod bricks;
mod corners;
mod elementwise;
mod launch;
mod sums;
mod tables;
mod transform;

pub(crate) use bricks::brick_convolution;
pub(crate) use corners::{prolonged, restricted};
pub(crate) use elementwise::elementwise;
pub(crate) use sums::partial_sums;
pub(crate) use tables::tabulated;
pub(crate) use transform::transform;
