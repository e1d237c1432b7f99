//! What all kernels are launched with.

use burn::backend::Cube;
use burn::tensor::{BackendPrimitive, Tensor, kind::Basic};
use burn_backend::TensorMetadata;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use cubecl::calculate_cube_count_elemwise;
use cubecl::prelude::*;

/// A tensor of the same shape and precision, not filled.
pub(super) fn like(x: &CubeTensor) -> CubeTensor {
    let (client, device) = (x.client.clone(), x.device.clone());
    empty_device_contiguous_dtype(client, device, x.shape(), x.dtype)
}

pub(super) fn primitive<K>(x: &Tensor<1, K>) -> CubeTensor
where
    K: Basic + BackendPrimitive<Cube, Primitive = CubeTensor>,
{
    let x = x.clone().try_into_primitive::<Cube>();
    x.expect("it is on the device of the vectors")
}

pub(super) fn buffer<K>(x: &Tensor<1, K>) -> BufferArg
where
    K: Basic + BackendPrimitive<Cube, Primitive = CubeTensor>,
{
    primitive(x).into_buffer_arg()
}

/// A thread for every value.
pub(super) fn launch(x: &CubeTensor) -> (CubeCount, CubeDim) {
    let values = x.shape().num_elements();
    let threads = CubeDim::new(&x.client, values);
    (
        calculate_cube_count_elemwise(&x.client, values, threads),
        threads,
    )
}
