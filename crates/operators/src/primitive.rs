//! Tensors of any backend, and those of CubeCL backends below them.

use burn::backend::{Cube, tensor::FloatTensor};
use burn::tensor::Tensor;

pub(crate) type CubeTensor = FloatTensor<Cube>;

pub(crate) fn up<const R: usize>(x: CubeTensor) -> Tensor<R> {
    Tensor::from_primitive::<Cube>(x)
}

pub(crate) fn down<const R: usize>(x: Tensor<R>) -> CubeTensor {
    x.try_into_primitive::<Cube>()
        .expect("operations on a tensor of this backend stay on it")
}
