//! The extension operations on the CPU backends, through the host kernels, in `f64` or `f32`.

use burn_backend::Shape;

use crate::brick_convolution::{self, Ghosts};
use crate::convolution::{convolve, correlate};
use crate::fft::{Real, Transform};
use crate::filter::SpectralFilter;
use crate::table::{TableRange, evaluate};

/// Grid axes and width of a kernel from its shape; batch axes lead.
fn grid_axes<'a>(x: &'a Shape, kernel: &Shape) -> (&'a [usize], usize) {
    let axes = kernel.num_dims();
    (&x[x.num_dims() - axes..], kernel[0])
}

pub(crate) fn circular_convolution<T: Real>(
    x: &[T],
    shape: &Shape,
    kernel: &[T],
    kernel_shape: &Shape,
    adjoint: bool,
) -> Vec<T> {
    let (grid, width) = grid_axes(shape, kernel_shape);
    convolve(x, grid, kernel, width, adjoint)
}

pub(crate) fn kernel_correlation<T: Real>(
    x: &[T],
    shape: &Shape,
    g: &[T],
    width: usize,
    axes: usize,
) -> Vec<T> {
    correlate(x, g, &shape[shape.num_dims() - axes..], width)
}

pub(crate) fn brick_convolution<T: Real>(
    x: &[T],
    shape: &Shape,
    taps: &[T],
    neighbours: &[T],
    adjoint: bool,
) -> Vec<T> {
    let axes = shape.num_dims();
    let bricks = (shape[axes - 1], axes);
    brick_convolution::convolve(x, bricks, neighbours, taps, adjoint, Ghosts::Zero)
}

pub(crate) fn tabulated<T: Real>(w: &[T], table: &[T], range: TableRange, order: usize) -> Vec<T> {
    evaluate(w, range, table, order)
}

pub(crate) fn spectral_filter<T: Real>(x: &[T], shape: &Shape, filter: &SpectralFilter) -> Vec<T> {
    let symbol: &[T] = filter.symbol();
    Transform::of_shape(&shape[..]).filter_real(x, symbol)
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

#[cfg(feature = "flex")]
pub(crate) mod flex {
    use burn_backend::{DType, Element, TensorData, TensorMetadata};
    use burn_flex::{Flex, FlexTensor};
    use burn_ir::TensorStatus;
    use linearize::{CustomOpRegistry, ELEMENTWISE};

    use super::{SpectralFilter, TableRange};
    use crate::elementwise::{self, Operand};
    use crate::filter::FilterOps;
    use crate::ops::GridOps;
    use crate::slices;
    use crate::vector::{self, SharedUpdate, VectorOps};

    fn contiguous(x: FlexTensor) -> FlexTensor {
        if x.is_contiguous() {
            x
        } else {
            x.to_contiguous()
        }
    }

    /// The values of a contiguous tensor. Its storage can hold more: that of the tensor it is a slice of.
    fn values<T: Element + bytemuck::Pod>(x: &FlexTensor) -> &[T] {
        x.as_slice()
            .expect("the tensor is contiguous and of this type")
    }

    impl GridOps for Flex {
        fn circular_convolution(x: FlexTensor, kernel: FlexTensor, adjoint: bool) -> FlexTensor {
            let (x, kernel) = (contiguous(x), contiguous(kernel));
            let (shape, kernel_shape) = (x.shape(), kernel.shape());
            in_precision!(x.dtype(), T => {
                let y = super::circular_convolution::<T>(values(&x), &shape, values(&kernel), &kernel_shape, adjoint);
                FlexTensor::from_data(TensorData::new(y, shape))
            })
        }

        fn kernel_correlation(
            x: FlexTensor,
            g: FlexTensor,
            width: usize,
            axes: usize,
        ) -> FlexTensor {
            let (x, g) = (contiguous(x), contiguous(g));
            let shape = x.shape();
            in_precision!(x.dtype(), T => {
                let y = super::kernel_correlation::<T>(values(&x), &shape, values(&g), width, axes);
                FlexTensor::from_data(TensorData::new(y, vec![width; axes]))
            })
        }

        fn brick_convolution(
            x: FlexTensor,
            taps: FlexTensor,
            neighbours: FlexTensor,
            adjoint: bool,
        ) -> FlexTensor {
            let [x, taps, neighbours] = [x, taps, neighbours].map(contiguous);
            let shape = x.shape();
            in_precision!(x.dtype(), T => {
                let (taps, neighbours) = (values(&taps), values(&neighbours));
                let y = super::brick_convolution::<T>(values(&x), &shape, taps, neighbours, adjoint);
                FlexTensor::from_data(TensorData::new(y, shape))
            })
        }

        fn tabulated(
            w: FlexTensor,
            table: FlexTensor,
            range: TableRange,
            order: usize,
        ) -> FlexTensor {
            let (w, table) = (contiguous(w), contiguous(table));
            let shape = w.shape();
            in_precision!(w.dtype(), T => {
                let y = super::tabulated::<T>(values(&w), values(&table), range, order);
                FlexTensor::from_data(TensorData::new(y, shape))
            })
        }
    }

    /// Changes `x` in place, or a copy of it if somebody else holds it; `y` stays.
    macro_rules! in_place {
        ($x:ident, $y:ident, $f:expr) => {{
            let (mut x, y) = (contiguous($x), contiguous($y));
            in_precision!(x.dtype(), T => {
                let (start, end) = x.layout().contiguous_offsets().expect("x is contiguous");
                $f(&mut x.storage_mut::<T>()[start..end], values::<T>(&y));
            });
            x
        }};
    }

    impl VectorOps for Flex {
        fn inner_product(a: FlexTensor, b: FlexTensor) -> FlexTensor {
            let (a, b) = (contiguous(a), contiguous(b));
            let sum = in_precision!(a.dtype(), T => slices::dot::<T>(values(&a), values(&b)));
            FlexTensor::from_data(TensorData::new(vec![sum], vec![1]))
        }

        fn add_scaled(x: FlexTensor, y: FlexTensor, alpha: f64) -> FlexTensor {
            in_place!(x, y, |x, y| vector::axpy(x, y, alpha))
        }

        fn retract(u: FlexTensor, p: FlexTensor, t: f64) -> FlexTensor {
            in_place!(u, p, |u, p| vector::retract_values(u, p, t))
        }

        fn extrapolate(u: FlexTensor, previous: FlexTensor, factor: f64) -> FlexTensor {
            in_place!(u, previous, |u, before| vector::extrapolate_values(
                u, before, factor
            ))
        }

        fn update_on_host(x: FlexTensor, z: FlexTensor, update: SharedUpdate) -> FlexTensor {
            in_place!(z, x, |z, x| vector::call(&update, x, z))
        }
    }

    /// Runs gathered elementwise operations of captured programs.
    pub(crate) fn register_elementwise(registry: &mut CustomOpRegistry<Flex>) {
        registry.register(ELEMENTWISE, |handles, ir, _| {
            let inputs: Vec<FlexTensor> = (ir.inputs.iter())
                .map(|t| contiguous(handles.get_float_tensor::<Flex>(t)))
                .collect();
            let results = in_precision!(ir.inputs[0].dtype, T => {
                // A tensor that was given away and that nobody else holds lends its memory to a result.
                let (mut given, mut lent) = (Vec::new(), Vec::new());
                for (x, ir) in inputs.into_iter().zip(&ir.inputs) {
                    if ir.status == TensorStatus::ReadWrite && x.is_unique() {
                        given.push(x.into_data().try_into_vec::<T>().ok());
                        lent.push(None);
                    } else {
                        given.push(None);
                        lent.push(Some(x));
                    }
                }
                let operands = (given.into_iter().zip(&lent))
                    .map(|pair| match pair {
                        (Some(values), _) => Operand::Given(values),
                        (None, Some(x)) => Operand::Lent(values::<T>(x)),
                        (None, None) => unreachable!("the tensor has the type of its description"),
                    })
                    .collect();
                elementwise::run_operation::<T>(ir, operands)
            });
            for (result, out) in results.into_iter().zip(&ir.outputs) {
                let data = result.into_data(out.shape.clone());
                handles.register_float_tensor::<Flex>(&out.id, FlexTensor::from_data(data));
            }
        });
    }

    impl FilterOps for Flex {
        fn spectral_filter(x: FlexTensor, filter: SpectralFilter) -> FlexTensor {
            let x = contiguous(x);
            let shape = x.shape();
            in_precision!(x.dtype(), T => {
                let y = super::spectral_filter::<T>(values(&x), &shape, &filter);
                FlexTensor::from_data(TensorData::new(y, shape))
            })
        }
    }
}

#[cfg(feature = "ndarray")]
pub(crate) mod ndarray {
    use burn_backend::{
        DType, Element, TensorData, TensorMetadata, ops::FloatTensorOps, tensor::FloatTensor,
    };
    use burn_ndarray::NdArray;
    use linearize::{CustomOpRegistry, ELEMENTWISE};

    use super::{SpectralFilter, TableRange};
    use crate::elementwise::{self, Operand};
    use crate::fft::Real;
    use crate::filter::FilterOps;
    use crate::ops::GridOps;
    use crate::slices;
    use crate::vector::{self, SharedUpdate, VectorOps};

    type NdTensor = FloatTensor<NdArray>;

    fn values<T: Real + Element>(x: NdTensor) -> Vec<T> {
        burn_std::reader::try_read_sync(NdArray::float_into_data(x))
            .expect("the ndarray backend reads synchronously")
            .expect("an ndarray tensor can be read")
            .try_into_vec()
            .expect("the tensor has the element type of its dtype")
    }

    fn tensor<T: Real + Element>(
        values: Vec<T>,
        shape: impl Into<burn_backend::Shape>,
    ) -> NdTensor {
        NdArray::float_from_data(TensorData::new(values, shape), &Default::default())
    }

    impl GridOps for NdArray {
        fn circular_convolution(x: NdTensor, kernel: NdTensor, adjoint: bool) -> NdTensor {
            let (shape, kernel_shape) = (x.shape(), kernel.shape());
            in_precision!(x.dtype(), T => {
                let (x, kernel) = (values::<T>(x), values::<T>(kernel));
                let y = super::circular_convolution(&x, &shape, &kernel, &kernel_shape, adjoint);
                tensor(y, shape)
            })
        }

        fn kernel_correlation(x: NdTensor, g: NdTensor, width: usize, axes: usize) -> NdTensor {
            let shape = x.shape();
            in_precision!(x.dtype(), T => {
                let (x, g) = (values::<T>(x), values::<T>(g));
                tensor(super::kernel_correlation(&x, &shape, &g, width, axes), vec![width; axes])
            })
        }

        fn brick_convolution(
            x: NdTensor,
            taps: NdTensor,
            neighbours: NdTensor,
            adjoint: bool,
        ) -> NdTensor {
            let shape = x.shape();
            in_precision!(x.dtype(), T => {
                let [x, taps, neighbours] = [x, taps, neighbours].map(values::<T>);
                tensor(super::brick_convolution(&x, &shape, &taps, &neighbours, adjoint), shape)
            })
        }

        fn tabulated(w: NdTensor, table: NdTensor, range: TableRange, order: usize) -> NdTensor {
            let shape = w.shape();
            in_precision!(w.dtype(), T => {
                let (w, table) = (values::<T>(w), values::<T>(table));
                tensor(super::tabulated(&w, &table, range, order), shape)
            })
        }
    }

    macro_rules! in_place {
        ($x:ident, $y:ident, $f:expr) => {{
            let shape = $x.shape();
            in_precision!($x.dtype(), T => {
                let (mut x, y) = (values::<T>($x), values::<T>($y));
                $f(&mut x[..], &y[..]);
                tensor(x, shape)
            })
        }};
    }

    impl VectorOps for NdArray {
        fn inner_product(a: NdTensor, b: NdTensor) -> NdTensor {
            let sum = in_precision!(a.dtype(), T => slices::dot(&values::<T>(a), &values::<T>(b)));
            tensor(vec![sum], vec![1])
        }

        fn add_scaled(x: NdTensor, y: NdTensor, alpha: f64) -> NdTensor {
            in_place!(x, y, |x, y| vector::axpy(x, y, alpha))
        }

        fn retract(u: NdTensor, p: NdTensor, t: f64) -> NdTensor {
            in_place!(u, p, |u, p| vector::retract_values(u, p, t))
        }

        fn extrapolate(u: NdTensor, previous: NdTensor, factor: f64) -> NdTensor {
            in_place!(u, previous, |u, before| vector::extrapolate_values(
                u, before, factor
            ))
        }

        fn update_on_host(x: NdTensor, z: NdTensor, update: SharedUpdate) -> NdTensor {
            in_place!(z, x, |z, x| vector::call(&update, x, z))
        }
    }

    /// Runs gathered elementwise operations of captured programs.
    pub(crate) fn register_elementwise(registry: &mut CustomOpRegistry<NdArray>) {
        registry.register(ELEMENTWISE, |handles, ir, _| {
            let inputs = (ir.inputs.iter()).map(|t| handles.get_float_tensor::<NdArray>(t));
            let results = in_precision!(ir.inputs[0].dtype, T => {
                let operands = inputs.map(|x| Operand::Given(values::<T>(x))).collect();
                elementwise::run_operation::<T>(ir, operands)
            });
            for (result, out) in results.into_iter().zip(&ir.outputs) {
                let data = result.into_data(out.shape.clone());
                let tensor = NdArray::float_from_data(data, &Default::default());
                handles.register_float_tensor::<NdArray>(&out.id, tensor);
            }
        });
    }

    impl FilterOps for NdArray {
        fn spectral_filter(x: NdTensor, filter: SpectralFilter) -> NdTensor {
            let shape = x.shape();
            in_precision!(x.dtype(), T => {
                tensor(super::spectral_filter(&values::<T>(x), &shape, &filter), shape)
            })
        }
    }
}
