//! Operations of Fourier transforms on CubeCL backends, composed of Burn's own and of transforms along single axes.
//!
//! A transform along an axis is a [kernel](crate::kernels), of any length and in the precision of its tensors. Burn's matrix products in
//! single precision are in TensorFloat-32 where there are tensor cores: with the matrix of the transform they are off by 2e-4 on an NVIDIA H100.
//! burn-signal's FFT takes powers of two only.

use std::sync::Mutex;

use burn::tensor::{DType, Device, IndexingUpdateOp, Int, Tensor, TensorData};

use crate::fft::lock;
use crate::kernels;
use crate::primitive::{CubeTensor, down, up};

/// Real and imaginary part.
type Complex<const R: usize> = (Tensor<R>, Tensor<R>);

/// Roots made so far: uploading them costs more than a transform.
static ROOTS: Mutex<Vec<(Device, DType, usize, Tensor<1>)>> = Mutex::new(Vec::new());

/// `cos` of `2 pi k / n` for all `k`, and then `sin`.
fn roots_of_unity(n: usize, device: &Device, dtype: DType) -> Tensor<1> {
    let mut roots = lock(&ROOTS);
    let found = roots
        .iter()
        .find(|r| &r.0 == device && r.1 == dtype && r.2 == n);
    if let Some(found) = found {
        return found.3.clone();
    }
    let angles = (0..n).map(|k| std::f64::consts::TAU * k as f64 / n as f64);
    let values: Vec<f64> = (angles.clone().map(f64::cos))
        .chain(angles.map(f64::sin))
        .collect();
    let made = Tensor::from_data(TensorData::new(values, [2 * n]), (device, dtype));
    roots.push((device.clone(), dtype, n, made.clone()));
    made
}

/// Complex transform along the last axes, not normalized. An imaginary part that is absent is zero.
fn transform<const R: usize>(
    mut re: Tensor<R>,
    mut im: Option<Tensor<R>>,
    axes: usize,
    inverse: bool,
) -> Complex<R> {
    for axis in R - axes..R {
        let roots = roots_of_unity(re.dims()[axis], &re.device(), re.dtype());
        let of = kernels::transform(down(re), im.map(down), &down(roots), axis, inverse);
        (re, im) = (up(of.0), Some(up(of.1)));
    }
    (re, im.expect("a grid has axes"))
}

fn forward<const R: usize>(x: Tensor<R>, axes: usize) -> Complex<R> {
    transform(x, None, axes, false)
}

/// Real part of the normalized inverse transform.
fn inverse<const R: usize>(re: Tensor<R>, im: Tensor<R>, axes: usize) -> Tensor<R> {
    let points: usize = re.dims()[R - axes..].iter().product();
    transform(re, Some(im), axes, true).0 / points as f64
}

/// Places of a kernel's entries along an axis of `n` cells, its centre at the origin.
fn wrapped(width: usize, n: usize, device: &Device) -> Tensor<1, Int> {
    let places: Vec<i32> = (0..width)
        .map(|i| (i as i32 - (width / 2) as i32).rem_euclid(n as i32))
        .collect();
    Tensor::from_data(TensorData::new(places, [width]), device)
}

/// The kernel on a grid, its centre at the origin.
fn on_grid<const K: usize>(kernel: Tensor<K>, grid: &[usize]) -> Tensor<K> {
    let device = kernel.device();
    let width = kernel.dims()[0];
    let mut full = kernel;
    for (axis, &n) in grid.iter().enumerate() {
        // Adds each slice at its wrapped place: a product with a 0-1 matrix would do the same with more work.
        let mut dims = full.dims();
        dims[axis] = n;
        let indices = wrapped(width, n, &device);
        let zeros = Tensor::<K>::zeros(dims, (&device, full.dtype()));
        full = zeros.select_assign(axis, indices, full, IndexingUpdateOp::Add);
    }
    full
}

/// The spectrum of a kernel on a grid.
struct Spectrum {
    /// Kept, so that its memory does not become that of another one.
    kernel: CubeTensor,
    grid: Vec<usize>,
    parts: (CubeTensor, CubeTensor),
}

impl Spectrum {
    fn is_of(&self, kernel: &CubeTensor, grid: &[usize]) -> bool {
        let place = |x: &CubeTensor| {
            let handle = &x.handle;
            let memory = handle.memory.clone().binding().id();
            (memory, handle.offset_start, handle.offset_end)
        };
        self.grid == grid
            && self.kernel.device == kernel.device
            && (self.kernel.dtype, &self.kernel.meta) == (kernel.dtype, &kernel.meta)
            && place(&self.kernel) == place(kernel)
    }
}

/// Those that were needed last: products with the Hessian have the same ones all the time, on grids of a few sizes.
static SPECTRA: Mutex<Vec<Spectrum>> = Mutex::new(Vec::new());
/// Points of all grids whose spectra are kept, unless it is a single one.
const KEPT_POINTS: usize = 1 << 25;

fn kernel_spectrum<const R: usize, const K: usize>(
    kernel: Tensor<K>,
    grid: &[usize],
) -> Complex<R> {
    let mut spectra = lock(&SPECTRA);
    let key = down(kernel.clone());
    let found = spectra
        .iter()
        .position(|spectrum| spectrum.is_of(&key, grid));
    let spectrum = match found {
        Some(place) => spectra.remove(place),
        None => {
            let (re, im) = forward(on_grid(kernel, grid), K);
            Spectrum {
                kernel: key,
                grid: grid.to_vec(),
                parts: (down(re), down(im)),
            }
        }
    };
    let (re, im) = spectrum.parts.clone();
    spectra.insert(0, spectrum);
    let points = |spectra: &[Spectrum]| -> usize {
        let of = |spectrum: &Spectrum| spectrum.grid.iter().product::<usize>();
        spectra.iter().map(of).sum()
    };
    while spectra.len() > 1 && points(&spectra) > KEPT_POINTS {
        spectra.pop();
    }
    // A batch of grids has more axes.
    let mut shape = [1; R];
    shape[R - K..].copy_from_slice(grid);
    (up::<K>(re).reshape(shape), up::<K>(im).reshape(shape))
}

/// See [`crate::circular_convolution`].
pub(crate) fn circular_convolution<const R: usize, const K: usize>(
    x: Tensor<R>,
    kernel: Tensor<K>,
    adjoint: bool,
) -> Tensor<R> {
    let grid: Vec<usize> = x.dims()[R - K..].to_vec();
    let (kre, kim) = kernel_spectrum::<R, K>(kernel, &grid);
    let (re, im) = forward(x, K);
    // Correlation multiplies by the conjugate of the kernel's spectrum, its adjoint by the spectrum.
    let kim = if adjoint { kim } else { kim.neg() };
    let product = re.clone() * kre.clone() - im.clone() * kim.clone();
    inverse(product, re * kim + im * kre, K)
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
    let mut re = xre.clone() * gre.clone() + xim.clone() * gim.clone();
    let mut im = xim * gre - xre * gim;
    for axis in 0..R - K {
        (re, im) = (re.sum_dim(axis), im.sum_dim(axis));
    }
    let mut correlation = inverse(re, im, K);
    for (axis, &n) in grid.iter().enumerate() {
        correlation = correlation.select(R - K + axis, wrapped(width, n, &device));
    }
    correlation.reshape([width; K])
}

/// Multiplies the spectrum by a real symbol given row-major over all frequencies.
pub(crate) fn spectral_filter<const R: usize>(x: Tensor<R>, symbol: Tensor<1>) -> Tensor<R> {
    let symbol = symbol.reshape(x.dims());
    let (re, im) = forward(x, R);
    inverse(re * symbol.clone(), im * symbol, R)
}
