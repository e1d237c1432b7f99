//! The operations on the backends: through the host, in `f64`, whatever the tensor's precision and place.

use burn::backend::Backend;
use burn_backend::{DType, TensorData, TensorMetadata, tensor::FloatTensor};

use crate::ops::{FemOps, Operation, host};

/// The values of a tensor as doubles.
fn values<B: Backend>(x: FloatTensor<B>) -> Vec<f64> {
    burn_std::reader::try_read_sync(B::float_into_data(x))
        .expect("native backends read synchronously")
        .expect("a tensor of a running device can be read")
        .convert::<f64>()
        .try_into_vec()
        .expect("converted to doubles above")
}

/// An operation of the finite elements of this number, by its identifier; the result has the place, shape and precision of the first input.
pub(crate) fn on_host<B: Backend>(
    id: &str,
    inputs: Vec<FloatTensor<B>>,
    elements: u64,
) -> FloatTensor<B> {
    let (shape, dtype, device) = (inputs[0].shape(), inputs[0].dtype(), inputs[0].device());
    let inputs: Vec<_> = inputs.into_iter().map(values::<B>).collect();
    let data = TensorData::new(host(elements).run(id, &inputs), shape);
    let data = match dtype {
        DType::F64 => data,
        other => data.convert_dtype(other),
    };
    B::float_from_data(data, &device)
}

macro_rules! on_host {
    ($backend:ty) => {
        impl FemOps for $backend {
            fn fem(operation: Operation<Self>, elements: u64) -> FloatTensor<Self> {
                let (id, inputs) = operation.parts();
                on_host::<Self>(id, inputs, elements)
            }
        }
    };
}

#[cfg(feature = "flex")]
on_host!(burn_flex::Flex);
#[cfg(feature = "ndarray")]
on_host!(burn_ndarray::NdArray);
#[cfg(any(feature = "wgpu", feature = "cuda"))]
on_host!(burn::backend::Cube);
