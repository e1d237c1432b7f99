//! The operations on the backends: through the host, in `f64`, whatever the tensor's precision and place.

use burn::backend::Backend;
use burn_backend::{DType, TensorData, TensorMetadata, tensor::FloatTensor};

use crate::ops::{FemOps, host};

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

macro_rules! on_host {
    ($backend:ty) => {
        impl FemOps for $backend {
            fn fem_mass(x: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
                through_host::<Self, 1>([x], |[x]| host(scheme).mass(&x))
            }

            fn fem_heat_solve(x: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
                through_host::<Self, 1>([x], |[x]| host(scheme).heat_solve(&x))
            }

            fn fem_product(
                a: FloatTensor<Self>,
                b: FloatTensor<Self>,
                c: FloatTensor<Self>,
                scheme: u64,
            ) -> FloatTensor<Self> {
                through_host::<Self, 3>([a, b, c], |[a, b, c]| host(scheme).product(&a, &b, &c))
            }

            fn fem_implicit_step(u: FloatTensor<Self>, scheme: u64) -> FloatTensor<Self> {
                through_host::<Self, 1>([u], |[u]| host(scheme).implicit_step(&u))
            }

            fn fem_linearized_solve(
                v: FloatTensor<Self>,
                g: FloatTensor<Self>,
                scheme: u64,
            ) -> FloatTensor<Self> {
                through_host::<Self, 2>([v, g], |[v, g]| host(scheme).linearized_solve(&v, &g))
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
