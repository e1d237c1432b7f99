//! The extension operations composed of Burn tensor operations, for backends without host memory.
//!
//! Transforms go axis by axis, each a product with the matrix of the discrete Fourier transform: any length, and the
//! operation that GPUs are best at. (burn-signal's FFT takes powers of two only.)
#![cfg_attr(not(any(test, feature = "wgpu", feature = "cuda")), allow(dead_code))]

use std::sync::Mutex;

use burn::tensor::{DType, Device, IndexingUpdateOp, Int, Tensor, TensorData};

use crate::fft::lock;
use crate::table::{COEFFICIENTS, TableRange, factor};

/// Real and imaginary part.
pub(crate) type Complex<const R: usize> = (Tensor<R>, Tensor<R>);

/// Matrices made so far: uploading one costs more than a transform.
static MATRICES: Mutex<Vec<(Device, DType, usize, Complex<2>)>> = Mutex::new(Vec::new());

/// `cos` and `sin` of `2 pi i j / n` as `[n, n]` matrices.
fn fourier_matrix<const R: usize>(n: usize, like: &Tensor<R>) -> Complex<2> {
    let (device, dtype) = (like.device(), like.dtype());
    let mut matrices = lock(&MATRICES);
    if let Some(found) = matrices
        .iter()
        .find(|m| m.0 == device && m.1 == dtype && m.2 == n)
    {
        return found.3.clone();
    }
    let angle = |i: usize| 2.0 * std::f64::consts::PI * ((i / n) * (i % n) % n) as f64 / n as f64;
    let matrix = |f: fn(f64) -> f64| {
        let values: Vec<f64> = (0..n * n).map(|i| f(angle(i))).collect();
        Tensor::from_data(TensorData::new(values, [n, n]), (&device, dtype))
    };
    let made = (matrix(f64::cos), matrix(f64::sin));
    matrices.push((device.clone(), dtype, n, made.clone()));
    made
}

/// Complex transform along one axis, not normalised.
fn transform_axis<const R: usize>((re, im): Complex<R>, axis: usize, inverse: bool) -> Complex<R> {
    let n = re.dims()[axis];
    let (cos, sin) = fourier_matrix(n, &re);
    let apply = |x: Tensor<R>, matrix: &Tensor<2>| {
        let x = x.swap_dims(axis, R - 1);
        let dims = x.dims();
        let rows = dims.iter().product::<usize>() / n;
        let y: Tensor<2> = x.reshape([rows, n]).matmul(matrix.clone());
        y.reshape(dims).swap_dims(axis, R - 1)
    };
    // exp(-i t) forward, exp(+i t) inverse; both matrices are symmetric.
    let sin = if inverse { sin.neg() } else { sin };
    (
        apply(re.clone(), &cos) + apply(im.clone(), &sin),
        apply(im, &cos) - apply(re, &sin),
    )
}

fn transform<const R: usize>(mut z: Complex<R>, axes: usize, inverse: bool) -> Complex<R> {
    for axis in R - axes..R {
        z = transform_axis(z, axis, inverse);
    }
    z
}

fn forward<const R: usize>(x: Tensor<R>, axes: usize) -> Complex<R> {
    let zero = x.zeros_like();
    transform((x, zero), axes, false)
}

/// Real part of the normalised inverse transform.
fn inverse<const R: usize>(z: Complex<R>, axes: usize) -> Tensor<R> {
    let points: usize = z.0.dims()[R - axes..].iter().product();
    transform(z, axes, true).0 / points as f64
}

/// Places of a kernel's entries along an axis of `n` cells, its centre at the origin.
fn wrapped(width: usize, n: usize, device: &Device) -> Tensor<1, Int> {
    let places: Vec<i32> = (0..width)
        .map(|i| (i as i32 - (width / 2) as i32).rem_euclid(n as i32))
        .collect();
    Tensor::from_data(TensorData::new(places, [width]), device)
}

/// The kernel on the grid `grid`, centre at the origin, as a tensor with `R` axes (leading ones of length 1).
fn on_grid<const R: usize, const K: usize>(kernel: Tensor<K>, grid: &[usize]) -> Tensor<R> {
    let device = kernel.device();
    let width = kernel.dims()[0];
    let mut shape = [1; R];
    shape[R - K..].copy_from_slice(grid);
    let mut full: Tensor<K> = kernel;
    for (axis, &n) in grid.iter().enumerate() {
        // Adds each slice at its wrapped place: a product with a 0-1 matrix would do the same with more work.
        let mut dims = full.dims();
        dims[axis] = n;
        let indices = wrapped(width, n, &device);
        let zeros = Tensor::<K>::zeros(dims, (&device, full.dtype()));
        full = zeros.select_assign(axis, indices, full, IndexingUpdateOp::Add);
    }
    full.reshape(shape)
}

/// See [`crate::circular_convolution`].
pub(crate) fn circular_convolution<const R: usize, const K: usize>(
    x: Tensor<R>,
    kernel: Tensor<K>,
    adjoint: bool,
) -> Tensor<R> {
    let grid: Vec<usize> = x.dims()[R - K..].to_vec();
    let (kre, kim) = forward(on_grid::<R, K>(kernel, &grid), K);
    let (re, im) = forward(x, K);
    // Correlation multiplies by the conjugate of the kernel's spectrum, its adjoint by the spectrum.
    let kim = if adjoint { kim } else { kim.neg() };
    let product = (
        re.clone() * kre.clone() - im.clone() * kim.clone(),
        re * kim + im * kre,
    );
    inverse(product, K)
}

/// See [`crate::Operation::Correlation`].
pub(crate) fn kernel_correlation<const R: usize, const K: usize>(
    x: Tensor<R>,
    g: Tensor<R>,
    width: usize,
) -> Tensor<K> {
    let device = x.device();
    let grid: Vec<usize> = x.dims()[R - K..].to_vec();
    let (xre, xim) = forward(x, K);
    let (gre, gim) = forward(g, K);
    let mut product = (
        xre.clone() * gre.clone() + xim.clone() * gim.clone(),
        xim * gre - xre * gim,
    );
    for axis in 0..R - K {
        product = (product.0.sum_dim(axis), product.1.sum_dim(axis));
    }
    let mut correlation = inverse(product, K);
    for (axis, &n) in grid.iter().enumerate() {
        correlation = correlation.select(R - K + axis, wrapped(width, n, &device));
    }
    correlation.reshape([width; K])
}

/// See [`crate::brick_convolution`]: in every pass a product of the bricks, between their neighbours, with a banded matrix.
pub(crate) fn brick_convolution<const R: usize>(
    x: Tensor<R>,
    taps: Tensor<1>,
    neighbours: Tensor<2>,
    adjoint: bool,
) -> Tensor<R> {
    let dims = x.dims();
    let (side, device) = (dims[R - 1], x.device());
    let (bricks, volume) = (neighbours.dims()[0], side.pow(R as u32));
    let matrix = banded(taps, side, adjoint);
    // What is not active is a brick of zeros behind the last.
    let absent = neighbours.clone().lower_elem(0.0);
    let neighbours = neighbours.mask_fill(absent, bricks as f64).int();
    let ghost = Tensor::<2>::zeros([1, volume], (&device, x.dtype()));
    let mut y: Tensor<2> = x.reshape([bricks, volume]);
    for pass in 0..R {
        let axis = if adjoint { pass } else { R - 1 - pass };
        let (outer, inner) = (side.pow(axis as u32), side.pow((R - 1 - axis) as u32));
        let in_lines = |y: Tensor<2>| -> Tensor<4> { y.reshape([bricks, outer, side, inner]) };
        let stored = Tensor::cat(vec![y.clone(), ghost.clone()], 0);
        let beside = |column: usize| {
            let numbers = (neighbours.clone()).slice([0..bricks, column..column + 1]);
            in_lines(stored.clone().select(0, numbers.reshape([bricks])))
        };
        let window = vec![beside(2 * axis), in_lines(y), beside(2 * axis + 1)];
        let passed = matrix.clone().matmul(Tensor::cat(window, 2));
        y = passed.reshape([bricks, volume]);
    }
    y.reshape(dims)
}

/// `[1, 1, side, 3 side]`: row `i` has tap `k` in column `side + i + k - reach`.
fn banded(taps: Tensor<1>, side: usize, mirrored: bool) -> Tensor<4> {
    let (width, device) = (taps.dims()[0], taps.device());
    let taps = if mirrored { taps.flip([0]) } else { taps };
    let places: Vec<i32> = (0..side * 3 * side)
        .map(|place| {
            let (i, j) = (place / (3 * side), place % (3 * side));
            let tap = (j + width / 2).checked_sub(side + i);
            // Behind the last tap there is a zero.
            tap.unwrap_or(width).min(width) as i32
        })
        .collect();
    let zero = Tensor::<1>::zeros([1], (&device, taps.dtype()));
    let count = places.len();
    let places = Tensor::<1, Int>::from_data(TensorData::new(places, [count]), &device);
    (Tensor::cat(vec![taps, zero], 0).select(0, places)).reshape([1, 1, side, 3 * side])
}

/// See [`crate::tabulated`].
pub(crate) fn tabulated<const R: usize>(
    w: Tensor<R>,
    table: Tensor<2>,
    range: TableRange,
    order: usize,
) -> Tensor<R> {
    let (TableRange { low, cells, .. }, width) = (range, range.width());
    let dims = w.dims();
    let points = dims.iter().product();
    let w: Tensor<1> = w.reshape([points]);
    let s = (w - low) / width;
    let inside = s.clone().clamp(0.0, cells as f64);
    let cell = inside.clone().floor().clamp(0.0, (cells - 1) as f64);
    let t = inside.clone() - cell.clone();
    let coefficients = table.select(0, cell.int());
    let polynomial = |order: usize| {
        let mut sum = t.zeros_like();
        for j in (order..COEFFICIENTS).rev() {
            let c: Tensor<1> = coefficients
                .clone()
                .slice([0..points, j..j + 1])
                .reshape([points]);
            sum = sum * t.clone() + c * factor(width, j, order);
        }
        sum
    };
    // Beyond the ends: the Taylor polynomial of degree 2; `distance` is zero inside.
    let distance = (s - inside) * width;
    let mut result = polynomial(order);
    if order > 2 {
        let outside = distance.clone().not_equal_elem(0.0);
        result = result.mask_fill(outside, 0.0);
    }
    let mut weight = distance.clone();
    for (step, higher) in (order + 1..3).enumerate() {
        result = result + polynomial(higher) * weight.clone();
        weight = weight * distance.clone() / (step + 2) as f64;
    }
    result.reshape(dims)
}

/// Multiplies the spectrum by a real symbol given row-major over all frequencies.
pub(crate) fn spectral_filter<const R: usize>(x: Tensor<R>, symbol: Tensor<1>) -> Tensor<R> {
    let symbol = symbol.reshape(x.dims());
    let (re, im) = forward(x, R);
    inverse((re * symbol.clone(), im * symbol), R)
}

#[cfg(all(test, feature = "flex"))]
mod tests {
    use super::*;
    use crate::{ComputeDevice, DeviceKind, HermiteTable, SpectralFilter};

    fn wave(n: usize, speed: f64) -> Vec<f64> {
        (0..n).map(|i| (speed * i as f64).sin()).collect()
    }

    fn assert_close<const R: usize>(a: Tensor<R>, b: Tensor<R>) {
        assert_eq!(a.dims(), b.dims());
        let scale = b.clone().abs().max().into_scalar::<f64>();
        let difference = (a - b).abs().max().into_scalar::<f64>();
        assert!(
            scale > 0.0 && difference < 1e-12 * scale,
            "{difference:e} of {scale:e}"
        );
    }

    /// In `f64` on the CPU the composed operations equal the host kernels, for every shape and batch.
    #[test]
    fn composed_operations_equal_the_host_kernels() {
        let device = ComputeDevice::open(DeviceKind::Flex).unwrap();
        let x = device.tensor::<3>(&wave(2 * 9 * 10, 0.37), [2, 9, 10]);
        let g = device.tensor::<3>(&wave(2 * 9 * 10, 0.73), [2, 9, 10]);
        let kernel = device.tensor::<2>(&wave(25, 1.1), [5, 5]);
        for adjoint in [false, true] {
            assert_close(
                circular_convolution::<3, 2>(x.clone(), kernel.clone(), adjoint),
                crate::circular_convolution(x.clone(), kernel.clone(), adjoint),
            );
        }
        let leaf = kernel.autodiff().require_grad();
        let y = crate::circular_convolution(x.clone().autodiff(), leaf.clone(), false);
        let gradients = (y * g.clone().autodiff()).sum().backward();
        assert_close(
            kernel_correlation::<3, 2>(x, g, 5),
            leaf.grad(&gradients).unwrap(),
        );

        let volume = device.tensor::<3>(&wave(6 * 7 * 8, 0.41), [6, 7, 8]);
        let kernel = wave(27, 0.9);
        let cube = device.tensor::<3>(&kernel, [3, 3, 3]);
        assert_close(
            circular_convolution::<3, 3>(volume.clone(), cube.clone(), false),
            crate::circular_convolution(volume.clone(), cube, false),
        );
        let filter =
            SpectralFilter::from_kernel(&[6, 7, 8], &kernel, 3, |k| 1.0 / (1.0 + k.norm_sqr()));
        let symbol = filter.on_device(&volume.device(), volume.dtype());
        assert_close(
            spectral_filter(volume.clone(), symbol),
            crate::spectral_filter(volume, &filter),
        );
    }

    #[test]
    fn composed_passes_over_bricks_equal_the_host_kernel() {
        fn check<const D: usize>(side: usize, reach: usize) {
            let device = ComputeDevice::open(DeviceKind::Flex).unwrap();
            let odd = |place: [usize; D]| place.iter().sum::<usize>() % 3 != 1;
            let bricks = geometry::Bricks::<D>::new(3 * side, side, odd, |_| true).unwrap();
            let x = device.tensor::<D>(&wave(bricks.len(), 0.37), bricks.shape());
            let taps = device.tensor::<1>(&wave(2 * reach + 1, 1.1), [2 * reach + 1]);
            let count = bricks.places().len();
            let neighbours = device.tensor::<2>(&bricks.neighbours(), [count, 2 * D]);
            for adjoint in [false, true] {
                let host =
                    crate::brick_convolution(x.clone(), taps.clone(), neighbours.clone(), adjoint);
                let composed =
                    brick_convolution(x.clone(), taps.clone(), neighbours.clone(), adjoint);
                assert_close(composed, host);
            }
        }
        check::<2>(16, 5);
        check::<3>(8, 8);
    }

    #[test]
    fn composed_table_equals_the_host_table_inside_and_beyond() {
        let device = ComputeDevice::open(DeviceKind::Flex).unwrap();
        let range = TableRange {
            low: -1.5,
            high: 1.5,
            cells: 37,
        };
        let table = HermiteTable::new(range, |w| [w.sin(), w.cos(), -w.sin()]).unwrap();
        let coefficients = device.tensor::<2>(table.coefficients(), [37, COEFFICIENTS]);
        let w: Vec<f64> = (0..60).map(|i| -2.3 + 0.08 * f64::from(i)).collect();
        let w = device.tensor::<2>(&w, [6, 10]);
        for order in 0..5 {
            assert_close(
                tabulated(w.clone(), coefficients.clone(), range, order),
                crate::tabulated(w.clone(), coefficients.clone(), range, order),
            );
        }
    }
}
