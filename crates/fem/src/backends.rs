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

/// Applies `f` to the values of the inputs; the result has the place, shape and precision of the first.
fn through_host<B: Backend, const N: usize>(
    inputs: [FloatTensor<B>; N],
    f: impl FnOnce([Vec<f64>; N]) -> Vec<f64>,
) -> FloatTensor<B> {
    let (shape, dtype, device) = (inputs[0].shape(), inputs[0].dtype(), inputs[0].device());
    let result = f(inputs.map(values::<B>));
    let data = TensorData::new(result, shape);
    let data = match dtype {
        DType::F64 => data,
        other => data.convert_dtype(other),
    };
    B::float_from_data(data, &device)
}

fn on_host<B: Backend>(operation: Operation<B>, scheme: u64) -> FloatTensor<B> {
    let host = host(scheme);
    match operation {
        Operation::Mass(x) => through_host::<B, 1>([x], |[x]| host.mass(&x)),
        Operation::HeatSolve(x) => through_host::<B, 1>([x], |[x]| host.heat_solve(&x)),
        Operation::Product(a, b, c) => {
            through_host::<B, 3>([a, b, c], |[a, b, c]| host.product(&a, &b, &c))
        }
        Operation::ImplicitStep(u) => through_host::<B, 1>([u], |[u]| host.implicit_step(&u)),
        Operation::LinearizedSolve(v, g) => {
            through_host::<B, 2>([v, g], |[v, g]| host.linearized_solve(&v, &g))
        }
    }
}

macro_rules! on_host {
    ($backend:ty) => {
        impl FemOps for $backend {
            fn fem(operation: Operation<Self>, scheme: u64) -> FloatTensor<Self> {
                on_host(operation, scheme)
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
