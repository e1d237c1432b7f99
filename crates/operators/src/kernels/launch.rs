//! What all kernels are launched with.

use burn::backend::Cube;
use burn::tensor::{BackendPrimitive, DType, Tensor, kind::Basic};
use burn_backend::TensorMetadata;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use cubecl::calculate_cube_count_elemwise;
use cubecl::prelude::*;

/// A tensor of the same shape and precision, not filled.
pub(super) fn like(x: &CubeTensor) -> CubeTensor {
    let (client, device) = (x.client.clone(), x.device.clone());
    empty_device_contiguous_dtype(client, device, x.shape(), x.dtype)
}

/// Values in the order of their indices, in the precision of a kernel: in another one it would read beyond their memory.
pub(super) fn values(x: CubeTensor, dtype: DType) -> BufferArg {
    assert_eq!(x.dtype, dtype, "a kernel has one precision");
    into_contiguous(x).into_buffer_arg()
}

/// Numbers that were uploaded as such.
pub(super) fn numbers<K>(x: &Tensor<1, K>) -> BufferArg
where
    K: Basic + BackendPrimitive<Cube, Primitive = CubeTensor>,
{
    let x = x.clone().try_into_primitive::<Cube>();
    into_contiguous(x.expect("it is on the device of the vectors")).into_buffer_arg()
}

/// Cubes of threads, a thread for each of so many values.
pub(super) fn threads_for(client: &Client, values: usize) -> (CubeCount, CubeDim) {
    assert!(u32::try_from(values).is_ok(), "kernels count in 32 bits");
    let threads = CubeDim::new(client, values);
    (
        calculate_cube_count_elemwise(client, values, threads),
        threads,
    )
}
