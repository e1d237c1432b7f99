//! The extension operations on the CPU backends, through the host kernels, in `f64` or `f32`.

use std::borrow::Cow;

use burn_backend::{
    Backend, DType, Element, Shape, TensorData, TensorMetadata, tensor::FloatTensor,
};
use burn_ir::{BackendIr, TensorStatus};
use linearize::{CustomOpRegistry, ELEMENTWISE};

use crate::brick_convolution;
use crate::convolution::{convolve, correlate};
use crate::fft::{Real, Transform};
use crate::filter::SpectralFilter;
use crate::ops::{GridOps, Operation};
use crate::table::evaluate;
use crate::vector::{self, Motion, SharedUpdate, VectorOps};
use crate::{elementwise, profile, slices};

/// A backend whose tensors are in the memory of the host.
pub(crate) trait Host: Backend {
    /// What lends the values of a tensor.
    type Lender;

    /// Takes a tensor whose values are to be lent.
    fn lender(x: FloatTensor<Self>) -> Self::Lender;

    /// The values, in the precision of the tensor.
    fn values<T: Real + Element>(lender: &Self::Lender) -> &[T];

    /// The values without copying, if the tensor is `given` away and nobody else holds them; otherwise the lender.
    fn owned<T: Real + Element>(lender: Self::Lender, given: bool) -> Result<Vec<T>, Self::Lender>;

    fn tensor<T: Real + Element>(values: Vec<T>, shape: Shape) -> FloatTensor<Self>;

    /// Changes the values in place, or a copy of them if somebody else holds them.
    fn changed<T: Real + Element>(
        x: FloatTensor<Self>,
        f: impl FnOnce(&mut [T]),
    ) -> FloatTensor<Self>;
}

fn into_values<T: Element>(data: TensorData) -> Vec<T> {
    data.try_into_vec()
        .expect("the tensor has the element type of its dtype")
}

/// Runs a generic host kernel in the tensor's own precision.
macro_rules! in_precision {
    ($dtype:expr, $type:ident => $body:expr) => {
        match $dtype {
            DType::F64 => {
                type $type = f64;
                $body
            }
            DType::F32 => {
                type $type = f32;
                $body
            }
            other => unreachable!("grid operations run on f64 or f32 tensors, got {other:?}"),
        }
    };
}

impl<B: Host> GridOps for B {
    fn grid(operation: Operation<B>) -> FloatTensor<B> {
        match operation {
            Operation::Convolution(x, kernel, adjoint) => {
                let (dtype, shape, kernel_shape) = (x.dtype(), x.shape(), kernel.shape());
                // Batch axes lead.
                let grid = &shape[shape.num_dims() - kernel_shape.num_dims()..];
                let (x, kernel) = (B::lender(x), B::lender(kernel));
                in_precision!(dtype, T => {
                    let (x, kernel) = (B::values::<T>(&x), B::values(&kernel));
                    let y = convolve(x, grid, kernel, kernel_shape[0], adjoint);
                    B::tensor(y, shape)
                })
            }
            Operation::Correlation(x, g, width, axes) => {
                let (dtype, shape) = (x.dtype(), x.shape());
                let grid = &shape[shape.num_dims() - axes..];
                let (x, g) = (B::lender(x), B::lender(g));
                in_precision!(dtype, T => {
                    let c = correlate(B::values::<T>(&x), B::values(&g), grid, width);
                    B::tensor(c, vec![width; axes].into())
                })
            }
            Operation::Bricks(x, taps, neighbours, passes) => {
                let (dtype, shape) = (x.dtype(), x.shape());
                let axes = shape.num_dims();
                let bricks = (shape[axes - 1], axes);
                let [x, taps, neighbours] = [x, taps, neighbours].map(B::lender);
                in_precision!(dtype, T => {
                    let x = B::values::<T>(&x);
                    let (taps, neighbours) = (B::values(&taps), B::values(&neighbours));
                    let y = brick_convolution::convolve(
                        x, bricks, neighbours, taps, passes, [0.0; 2],
                    );
                    B::tensor(y, shape)
                })
            }
            Operation::Tabulated(w, table, range, order) => {
                let (dtype, shape) = (w.dtype(), w.shape());
                let (w, table) = (B::lender(w), B::lender(table));
                in_precision!(dtype, T => {
                    B::tensor(evaluate(B::values::<T>(&w), range, B::values(&table), order), shape)
                })
            }
        }
    }
}

/// Changes `x` by a function of its values and those of `y`.
macro_rules! changed {
    ($x:ident, $y:ident, $f:expr) => {{
        let y = B::lender($y);
        in_precision!($x.dtype(), T => B::changed::<T>($x, |x| $f(x, B::values(&y))))
    }};
}

/// Changes `x` by a function of each of its values and that of `y` there, in double precision.
fn mapped<B: Host>(
    x: FloatTensor<B>,
    y: FloatTensor<B>,
    f: impl Fn(f64, f64) -> f64 + Sync,
) -> FloatTensor<B> {
    changed!(x, y, |x: &mut [T], y| slices::zip_apply(x, y, |x, y| {
        T::of(f(x.double(), y.double()))
    }))
}

impl<B: Host> VectorOps for B {
    fn inner_product(a: FloatTensor<B>, b: FloatTensor<B>) -> FloatTensor<B> {
        let dtype = a.dtype();
        let (a, b) = (B::lender(a), B::lender(b));
        let sum = in_precision!(dtype, T => slices::dot::<T>(B::values(&a), B::values(&b)));
        B::tensor(vec![sum], vec![1].into())
    }

    fn squared_distance(a: FloatTensor<B>, b: FloatTensor<B>) -> FloatTensor<B> {
        let dtype = a.dtype();
        let (a, b) = (B::lender(a), B::lender(b));
        let sum = in_precision!(dtype, T => {
            slices::squared_distance::<T>(B::values(&a), B::values(&b))
        });
        B::tensor(vec![sum], vec![1].into())
    }

    fn scaled(x: FloatTensor<B>, a: f64, dtype: DType) -> FloatTensor<B> {
        let (own, shape) = (x.dtype(), x.shape());
        let x = B::lender(x);
        in_precision!(own, T => in_precision!(dtype, U => {
            let a = T::of(a);
            B::tensor(slices::map(B::values::<T>(&x), |x| U::of((a * x).double())), shape)
        }))
    }

    fn spectral_filter(x: FloatTensor<B>, filter: SpectralFilter) -> FloatTensor<B> {
        let (dtype, shape) = (x.dtype(), x.shape());
        let x = B::lender(x);
        in_precision!(dtype, T => {
            let y = Transform::of_shape(&shape[..]).filter_real(B::values::<T>(&x), filter.symbol());
            B::tensor(y, shape)
        })
    }

    fn moved(x: FloatTensor<B>, y: FloatTensor<B>, motion: Motion) -> FloatTensor<B> {
        match motion {
            Motion::Straight(alpha) => changed!(x, y, |x: &mut [T], y| {
                let alpha = T::of(alpha);
                slices::zip_apply(x, y, |x, y| x + alpha * y);
            }),
            Motion::Combined(a, b) => changed!(x, y, |x: &mut [T], y| {
                let (a, b) = (T::of(a), T::of(b));
                slices::zip_apply(x, y, |x, y| a * x + b * y);
            }),
            Motion::Retracted(t) => {
                changed!(x, y, |x: &mut [T], y| profile::retract_values(x, y, t))
            }
            Motion::Extrapolated(factor) => mapped::<B>(x, y, |u, previous| {
                profile::extrapolated(u, previous, factor)
            }),
        }
    }

    fn update_on_host(
        x: FloatTensor<B>,
        z: FloatTensor<B>,
        update: SharedUpdate,
    ) -> FloatTensor<B> {
        changed!(z, x, |z, x| vector::call(&update, x, z))
    }
}

/// Runs gathered elementwise operations of captured programs.
pub(crate) fn register_elementwise<B: Host + BackendIr>(registry: &mut CustomOpRegistry<B>) {
    registry.register(ELEMENTWISE, |handles, ir, device| {
        let results = in_precision!(ir.inputs[0].dtype, T => {
            // A tensor that was given away lends its memory to a result.
            let mut inputs: Vec<_> = (ir.inputs.iter())
                .map(|x| {
                    let given = x.status == TensorStatus::ReadWrite;
                    B::owned::<T>(B::lender(handles.get_float_tensor::<B>(x)), given)
                })
                .collect();
            let inputs = inputs.iter_mut().map(|input| match input {
                Ok(values) => Cow::Owned(std::mem::take(values)),
                Err(lender) => Cow::Borrowed(B::values(lender)),
            });
            elementwise::run_operation::<T>(ir, inputs.collect())
        });
        for (result, out) in results.into_iter().zip(&ir.outputs) {
            let data = result.into_data(out.shape.clone());
            handles.register_float_tensor::<B>(&out.id, B::float_from_data(data, device));
        }
    });
}

#[cfg(feature = "flex")]
mod flex {
    use burn_backend::{Element, Shape, TensorData, TensorMetadata};
    use burn_flex::{Flex, FlexTensor};

    use super::{Host, into_values};
    use crate::fft::Real;
    use crate::slices;

    fn contiguous(x: FlexTensor) -> FlexTensor {
        if x.is_contiguous() {
            x
        } else {
            x.to_contiguous()
        }
    }

    impl Host for Flex {
        type Lender = FlexTensor;

        fn lender(x: FlexTensor) -> FlexTensor {
            contiguous(x)
        }

        /// Its storage can hold more: that of the tensor it is a slice of.
        fn values<T: Real + Element>(x: &FlexTensor) -> &[T] {
            x.as_slice()
                .expect("the tensor is contiguous and of this type")
        }

        fn owned<T: Real + Element>(x: FlexTensor, given: bool) -> Result<Vec<T>, FlexTensor> {
            if given && x.is_unique() {
                Ok(into_values(x.into_data()))
            } else {
                Err(x)
            }
        }

        fn tensor<T: Real + Element>(values: Vec<T>, shape: Shape) -> FlexTensor {
            FlexTensor::from_data(TensorData::new(values, shape))
        }

        fn changed<T: Real + Element>(x: FlexTensor, f: impl FnOnce(&mut [T])) -> FlexTensor {
            let mut x = contiguous(x);
            if !x.is_unique() {
                let shape = x.shape();
                let mut values = slices::map(Self::values::<T>(&x), |x| x);
                f(&mut values);
                return Self::tensor(values, shape);
            }
            let (start, end) = x.layout().contiguous_offsets().expect("x is contiguous");
            f(&mut x.storage_mut::<T>()[start..end]);
            x
        }
    }
}

#[cfg(feature = "ndarray")]
mod ndarray {
    use burn_backend::{
        Element, Shape, TensorData, TensorMetadata, ops::FloatTensorOps, tensor::FloatTensor,
    };
    use burn_ndarray::NdArray;

    use super::{Host, into_values};
    use crate::fft::Real;

    type NdTensor = FloatTensor<NdArray>;

    impl Host for NdArray {
        type Lender = TensorData;

        fn lender(x: NdTensor) -> TensorData {
            burn_std::reader::try_read_sync(NdArray::float_into_data(x))
                .expect("the ndarray backend reads synchronously")
                .expect("an ndarray tensor can be read")
        }

        fn values<T: Real + Element>(data: &TensorData) -> &[T] {
            data.as_slice()
                .expect("the tensor has the element type of its dtype")
        }

        fn owned<T: Real + Element>(data: TensorData, _: bool) -> Result<Vec<T>, TensorData> {
            Ok(into_values(data))
        }

        fn tensor<T: Real + Element>(values: Vec<T>, shape: Shape) -> NdTensor {
            NdArray::float_from_data(TensorData::new(values, shape), &Default::default())
        }

        fn changed<T: Real + Element>(x: NdTensor, f: impl FnOnce(&mut [T])) -> NdTensor {
            let shape = x.shape();
            let mut values = into_values::<T>(Self::lender(x));
            f(&mut values);
            Self::tensor(values, shape)
        }
    }
}
