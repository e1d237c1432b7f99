//! The extension operations on CubeCL backends (wgpu, CUDA): composed of Burn's own operations.

use burn::backend::{Cube, tensor::FloatTensor};
use burn::tensor::{DType, Tensor, TensorData};
use burn_backend::TensorMetadata;

use crate::composed;
use crate::filter::SpectralFilter;
use crate::ops::{GridOps, Operation};
use crate::profile;
use crate::vector::{self, Motion, SharedUpdate, VectorOps};

type CubeTensor = FloatTensor<Cube>;

fn up<const R: usize>(x: CubeTensor) -> Tensor<R> {
    Tensor::from_primitive::<Cube>(x)
}

fn down<const R: usize>(x: Tensor<R>) -> CubeTensor {
    x.try_into_primitive::<Cube>()
        .expect("operations on a tensor of this backend stay on it")
}

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
                    down(composed::circular_convolution::<R, K>(up(x), up(kernel), adjoint))
                })
            }
            Operation::Correlation(x, g, width, axes) => {
                gridded!(rank(&x), axes, (2 2) (3 2) (3 3) (4 2) (4 3), R, K => {
                    down(composed::kernel_correlation::<R, K>(up(x), up(g), width))
                })
            }
            Operation::Bricks(x, taps, neighbours, adjoint) => ranked!(rank(&x), 2 3, R => {
                down(composed::brick_convolution::<R>(up(x), up(taps), up(neighbours), adjoint))
            }),
            Operation::Tabulated(w, table, range, order) => ranked!(rank(&w), 1 2 3 4, R => {
                down(composed::tabulated::<R>(up(w), up(table), range, order))
            }),
        }
    }
}

impl VectorOps for Cube {
    fn inner_product(a: CubeTensor, b: CubeTensor) -> CubeTensor {
        ranked!(a.shape().num_dims(), 1 2 3 4, R => down((up::<R>(a) * up::<R>(b)).sum()))
    }

    fn spectral_filter(x: CubeTensor, filter: SpectralFilter) -> CubeTensor {
        ranked!(x.shape().num_dims(), 2 3, R => {
            let x = up::<R>(x);
            let symbol = filter.on_device(&x.device(), x.dtype());
            down(composed::spectral_filter::<R>(x, symbol))
        })
    }

    fn moved(x: CubeTensor, y: CubeTensor, motion: Motion) -> CubeTensor {
        ranked!(x.shape().num_dims(), 1 2 3 4, R => {
            let (x, y) = (up::<R>(x), up::<R>(y));
            down(match motion {
                Motion::Straight(alpha) => x + y * alpha,
                Motion::Retracted(t) => profile::retract(x, y, t),
                Motion::Extrapolated(factor) => profile::extrapolate(x, y, factor),
            })
        })
    }

    fn update_on_host(x: CubeTensor, z: CubeTensor, update: SharedUpdate) -> CubeTensor {
        ranked!(x.shape().num_dims(), 1 2 3 4, R => {
            let (x, z) = (up::<R>(x), up::<R>(z));
            let (shape, device) = (z.dims(), z.device());
            let read = |t: Tensor<R>| -> Vec<f32> {
                let data = t.try_into_data_dtype(DType::F32).expect("the device answers");
                data.try_into_vec().expect("single precision was asked for")
            };
            let (x, mut z) = (read(x), read(z));
            vector::call(&update, &x, &mut z);
            down(Tensor::<R>::from_data(TensorData::new(z, shape), (&device, DType::F32)))
        })
    }
}
