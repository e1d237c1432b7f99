//! The extension operations on CubeCL backends (wgpu, CUDA).

use burn::backend::Cube;
use burn::tensor::{DType, Element, Tensor, TensorData};
use burn_backend::TensorMetadata;
use burn_backend::ops::FloatTensorOps;

use linearize::{CustomOpRegistry, ELEMENTWISE, Elementwise, Output};

use crate::fft::Real;
use crate::filter::SpectralFilter;
use crate::kernels;
use crate::ops::{GridOps, Operation};
use crate::primitive::{CubeTensor, down, up};
use crate::profile;
use crate::spectral;
use crate::vector::{self, Motion, SharedUpdate, VectorOps};

/// Calls a function of tensors of static rank for a run-time rank.
macro_rules! ranked {
    ($rank:expr, $($r:literal)+, $R:ident => $body:expr) => {
        match $rank {
            $($r => { const $R: usize = $r; $body })+
            rank => unreachable!("grid operations take tensors of 1 to 4 axes, got {rank}"),
        }
    };
}

/// The same for the ranks of a batch of grids and of a kernel.
macro_rules! gridded {
    ($rank:expr, $axes:expr, $(($r:literal $k:literal))+, $R:ident, $K:ident => $body:expr) => {
        match ($rank, $axes) {
            $(($r, $k) => {
                const $R: usize = $r;
                const $K: usize = $k;
                $body
            })+
            shape => unreachable!("grids have 2 or 3 axes, 4 with the batch, got {shape:?}"),
        }
    };
}

impl GridOps for Cube {
    fn grid(operation: Operation<Self>) -> CubeTensor {
        let rank = |x: &CubeTensor| x.shape().num_dims();
        match operation {
            Operation::Convolution(x, kernel, adjoint) => {
                gridded!(rank(&x), rank(&kernel), (2 2) (3 2) (3 3) (4 2) (4 3), R, K => {
                    down(spectral::circular_convolution::<R, K>(up(x), up(kernel), adjoint))
                })
            }
            Operation::Correlation(x, g, width, axes) => {
                gridded!(rank(&x), axes, (2 2) (3 2) (3 3) (4 2) (4 3), R, K => {
                    down(spectral::kernel_correlation::<R, K>(up(x), up(g), width))
                })
            }
            Operation::Bricks(x, taps, neighbours, passes) => {
                kernels::brick_convolution(x, &taps, &neighbours, passes)
            }
            Operation::Tabulated(w, table, range, order) => {
                kernels::tabulated(w, table, range, order)
            }
        }
    }
}

impl VectorOps for Cube {
    fn inner_product(a: CubeTensor, b: CubeTensor) -> CubeTensor {
        Self::float_sum(kernels::partial_sums(a, Some(b)))
    }

    fn squared_distance(a: CubeTensor, b: CubeTensor) -> CubeTensor {
        let difference = Self::float_sub(a, b);
        Self::inner_product(difference.clone(), difference)
    }

    fn scaled(x: CubeTensor, a: f64, dtype: DType) -> CubeTensor {
        ranked!(x.shape().num_dims(), 1 2 3 4, R => down((up::<R>(x) * a).cast(dtype)))
    }

    fn spectral_filter(x: CubeTensor, filter: SpectralFilter) -> CubeTensor {
        ranked!(x.shape().num_dims(), 2 3, R => {
            let x = up::<R>(x);
            let symbol = filter.on_device(&x.device(), x.dtype());
            down(spectral::spectral_filter::<R>(x, symbol))
        })
    }

    fn moved(x: CubeTensor, y: CubeTensor, motion: Motion) -> CubeTensor {
        ranked!(x.shape().num_dims(), 1 2 3 4, R => {
            let (x, y) = (up::<R>(x), up::<R>(y));
            down(match motion {
                Motion::Straight(alpha) => x + y * alpha,
                Motion::Combined(a, b) => x * a + y * b,
                Motion::Retracted(t) => profile::retract(x, y, t),
                Motion::Extrapolated(factor) => profile::extrapolate(x, y, factor),
            })
        })
    }

    fn update_on_host(x: CubeTensor, z: CubeTensor, update: SharedUpdate) -> CubeTensor {
        let device = ranked!(x.shape().num_dims(), 1 2 3 4, R => up::<R>(x.clone()).device());
        if let Some(interpolation) = update.on_device(&device, x.dtype()) {
            let (dtype, sums) = (x.dtype(), kernels::restricted(x, &interpolation));
            let sums = up::<3>(sums).sum_dim(1);
            let len = sums.shape().num_elements();
            let mut sums = read::<3, f64>(sums);
            update.at_corners(&mut sums);
            let values = Tensor::<1>::from_data(TensorData::new(sums, [len]), (&device, dtype));
            return kernels::prolonged(z, down(values), &interpolation);
        }
        ranked!(x.shape().num_dims(), 1 2 3 4, R => {
            let (x, z) = (up::<R>(x), up::<R>(z));
            let (shape, dtype) = (z.dims(), z.dtype());
            let len = shape.iter().product::<usize>();
            let data = if dtype == DType::F64 {
                TensorData::new(updated::<R, f64>(x, z, &update), [len])
            } else {
                TensorData::new(updated::<R, f32>(x, z, &update), [len])
            };
            down(Tensor::<1>::from_data(data, (&device, dtype)).reshape(shape))
        })
    }
}

/// `z` after an update on the host.
fn updated<const R: usize, T: Real + Element>(
    x: Tensor<R>,
    z: Tensor<R>,
    update: &SharedUpdate,
) -> Vec<T> {
    let (x, mut z) = (read::<R, T>(x), read::<R, T>(z));
    vector::call(update, &x, &mut z);
    z
}

/// The values of a tensor.
fn read<const R: usize, T: Element>(x: Tensor<R>) -> Vec<T> {
    let data = x
        .try_into_data_dtype(T::dtype())
        .expect("the device answers");
    data.try_into_vec().expect("this precision was asked for")
}

/// Runs fused elementwise operations of captured programs.
pub(crate) fn register_elementwise(registry: &mut CustomOpRegistry<Cube>) {
    registry.register(ELEMENTWISE, |handles, ir, _device| {
        let program = Elementwise::of(ir);
        let inputs = ir
            .inputs
            .iter()
            .map(|x| handles.get_float_tensor::<Cube>(x));
        let results = kernels::elementwise(&program, inputs.collect());
        for ((result, output), out) in results.into_iter().zip(&program.outputs).zip(&ir.outputs) {
            let result = match output {
                Output::Values(_) => result,
                Output::Sum(_) => Cube::float_sum(kernels::partial_sums(result, None)),
            };
            let result = Cube::float_cast(result, out.dtype.into());
            handles.register_float_tensor::<Cube>(&out.id, result);
        }
    });
}
